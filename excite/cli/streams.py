"""Lines on stdout and stderr, as much as was asked for."""

from __future__ import annotations

import io
import logging
import os
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any, TextIO

import click

from excite.cli.messages import in_options
from excite.cli.sign_of_life import be_quiet, clear_line

_LEVELS = {
    "excite.storage": logging.INFO, "excite.study": logging.INFO, "regressors.input_files": logging.DEBUG
}  # fmt: skip
_WITH_LINES = ("excite", "regressors.input_files")


def open_streams() -> None:
    """Let standard streams that are closed go nowhere; their numbers would be given to the next files."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        _write_what_is_known(getattr(sys, name))


def _write_what_is_known(stream: TextIO) -> None:
    """Let a stream write a question mark for characters that its encoding lacks, as those of consoles of Windows do."""
    if isinstance(stream, io.TextIOWrapper) and not (stream.encoding or "").lower().startswith("utf"):
        stream.reconfigure(errors="replace")


def say(text: str) -> None:
    """Print a line on stderr, where that is possible."""
    clear_line()
    with suppress(OSError, ValueError):
        click.echo(text, err=True)


def remark(text: str) -> None:
    """Print a line on stderr that ``--quiet`` leaves out, such as a note."""
    if not verbosity().quiet:
        say(text)


class _Lines(logging.Handler):
    """Prints what the library logs as lines of the command: ``--quiet`` leaves warnings, ``--verbose`` adds files."""

    def emit(self, record: logging.LogRecord) -> None:
        chosen = verbosity()
        least = logging.WARNING if chosen.quiet else logging.DEBUG if chosen.verbose else logging.INFO
        if record.levelno >= least and not _is_own(record):
            say(f"excite: {in_options(record.getMessage())}")


def _is_own(record: logging.LogRecord) -> bool:
    """Whether it is about a file with a hidden name, by which commits are kept whole."""
    return record.levelno == logging.DEBUG and any("/." in f"/{argument}" for argument in record.args or ())


@contextmanager
def printed_warnings() -> Iterator[None]:
    """Print what the library logs in the block: warnings, how long work will take, and which files are read."""
    handler = _Lines()
    before = {name: logging.getLogger(name).level for name in _LEVELS}
    for name, level in _LEVELS.items():
        logging.getLogger(name).setLevel(level)
    for name in _WITH_LINES:
        logging.getLogger(name).addHandler(handler)
    try:
        yield
    finally:
        for name in _WITH_LINES:
            logging.getLogger(name).removeHandler(handler)
        for name, level in before.items():
            logging.getLogger(name).setLevel(level)


_KEY = "excite.verbosity"


@dataclass
class Verbosity:
    """What the command line asks to be printed."""

    quiet: bool = False  # only the verdict
    verbose: bool = False  # all tables and notes, times, versions, and the files that are read
    as_json: bool = False  # one JSON document on stdout instead of text
    # when the command line was read, on the clock `time.monotonic` [s]
    began: float = field(default_factory=time.monotonic)

    @property
    def plain(self) -> bool:
        """True if none of the options is given."""
        return not (self.quiet or self.verbose or self.as_json)


def verbosity() -> Verbosity:
    """What the command at work prints."""
    ctx = click.get_current_context(silent=True)
    return Verbosity() if ctx is None else _of(ctx)


def _of(ctx: click.Context) -> Verbosity:
    chosen: Verbosity = ctx.meta.setdefault(_KEY, Verbosity())
    return chosen


def _choose(ctx: click.Context, param: click.Parameter, value: Any) -> None:
    """Note one option; a group's counts for its commands too."""
    chosen, asked = _of(ctx), value == "json" if param.name == "form" else bool(value)
    if not asked:
        return
    setattr(chosen, "as_json" if param.name == "form" else str(param.name), True)
    if chosen.quiet and chosen.verbose:
        raise click.UsageError("--quiet and --verbose exclude each other", ctx)
    if chosen.quiet:
        be_quiet()


def _flag(names: list[str], text: str) -> click.Option:
    return click.Option(names, is_flag=True, default=False, expose_value=False, callback=_choose, help=text)


def loudness_options() -> list[click.Option]:
    """``--quiet`` and ``--verbose``."""
    return [
        _flag(["-q", "--quiet"], "Print only the verdict, and no progress."),
        _flag(["-v", "--verbose"], "Print all tables, notes, times and versions."),
    ]


def form_options(taken: Iterable[str]) -> list[click.Option]:
    """``--json``, and its older spelling ``--format json`` where that name is free."""
    options = [_flag(["--json", "as_json"], "Print the summary as one JSON document.")]
    if "--format" not in taken:
        kinds = click.Choice(["text", "json"])
        options.append(
            click.Option(["--format", "form"], type=kinds, hidden=True, expose_value=False, callback=_choose)
        )
    return options
