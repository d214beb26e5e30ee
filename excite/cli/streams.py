"""What a command prints beside its result, wherever that goes: a closed or broken stderr ends no work."""

from __future__ import annotations

import io
import logging
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

import click

from excite.cli.messages import in_options
from excite.cli.sign_of_life import clear_line
from excite.cli.verbosity import verbosity

_LEVELS = {
    "excite.estimates": logging.INFO, "excite.montecarlo": logging.INFO, "regressors.input_files": logging.DEBUG
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
