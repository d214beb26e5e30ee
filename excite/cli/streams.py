"""Lines on stdout and stderr, as much as was asked for."""

from __future__ import annotations

import io
import logging
import os
import re
import shutil
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any, TextIO

import click

from excite.design.interruption import repeat_lost_signal
from excite.operating_system import ForkSafeThread
from regressors.errors import one_line, printable

_LEVELS = {
    "excite.work": logging.INFO, "excite.study": logging.INFO, "regressors.input_files": logging.DEBUG
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
        stream = getattr(sys, name)
        if isinstance(stream, io.TextIOWrapper) and not (stream.encoding or "").lower().startswith("utf"):
            stream.reconfigure(errors="replace")  # a question mark for what its encoding lacks, as consoles of Windows


def discard_unwritten() -> None:
    """Discard what stderr holds and cannot write, such as on a full disk: else the process would end with 120."""
    try:
        sys.stderr.flush()
    except (OSError, ValueError):
        with suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())


def say(text: str) -> None:
    """Print a line on stderr, where that is possible."""
    clear_line()
    with suppress(OSError, ValueError):
        click.echo(text, err=True)


def remark(text: str) -> None:
    """Print a line on stderr that ``--quiet`` leaves out, such as a note."""
    if not verbosity().quiet:
        say(text)
        verbosity().said.append(text)


class _Lines(logging.Handler):
    """Prints what the library logs as lines of the command: ``--quiet`` leaves warnings, ``--verbose`` adds files."""

    def emit(self, record: logging.LogRecord) -> None:
        chosen = verbosity()
        least = logging.WARNING if chosen.quiet else logging.DEBUG if chosen.verbose else logging.INFO
        # of a file with a hidden name, by which commits are kept whole
        is_own = record.levelno == logging.DEBUG and any("/." in f"/{argument}" for argument in record.args or ())
        if record.levelno >= least and not is_own:
            say(f"excite: {in_options(record.getMessage())}")


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


@dataclass
class Verbosity:
    """What the command line asks to be printed."""

    quiet: bool = False  # only the verdict
    verbose: bool = False  # all tables and notes, times, versions, and the files that are read
    as_json: bool = False  # one JSON document on stdout instead of text
    # when the command line was read, on the clock `time.monotonic` [s]
    began: float = field(default_factory=time.monotonic)
    said: list[str] = field(default_factory=list)  # notes on stderr, which the summary leaves out


def verbosity() -> Verbosity:
    """What the command at work prints."""
    ctx = click.get_current_context(silent=True)
    chosen: Verbosity = Verbosity() if ctx is None else ctx.meta.setdefault("excite.verbosity", Verbosity())
    return chosen


def _choose(ctx: click.Context, param: click.Parameter, value: Any) -> None:
    """Note one option; a group's counts for its commands too."""
    if value in (False, None, "text"):
        return
    chosen = verbosity()
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
    kinds = click.Choice(["text", "json"])
    older = click.Option(["--format", "form"], type=kinds, hidden=True, expose_value=False, callback=_choose)
    json = _flag(["--json", "as_json"], "Print the summary as one JSON document.")
    return [json] if "--format" in taken else [json, older]


SECONDS = 1.5
_BETWEEN = 0.2  # seconds between two drawings of the line
_MARKS = "|/-\\"


class _Sign:
    """The steps of one command."""

    def __init__(self, handle: int, *, moves: bool) -> None:
        self.handle, self.moves, self.what = handle, moves, "working"
        self.began = self.step_began = time.monotonic()
        self.shown = self.drawn = self.left_out = False
        self.lock, self.ended = threading.RLock(), threading.Event()
        self.watch = ForkSafeThread(target=self._watch, daemon=True)

    def _watch(self) -> None:
        """Show the step at work after some time; on a terminal, keep it moving."""
        if self.ended.wait(SECONDS):
            return
        self.show()
        while self.moves and not self.ended.wait(_BETWEEN):
            self.show()

    def show(self) -> None:
        """Print the step at work; not through streams, which may be in the middle of a write."""
        with self.lock:
            if self.ended.is_set() or self.left_out or (self.shown and not self.moves):
                return
            self.shown = True
            self._print()

    def tell(self, what: str) -> None:
        """State the next step, which is printed where an earlier one has been, or would have been."""
        with self.lock:
            self.what, self.step_began, self.left_out = what, time.monotonic(), False
            self.shown = self.shown or time.monotonic() - self.began > SECONDS
            if self.shown and not self.ended.is_set():
                self._print()

    def _print(self) -> None:
        if not self.moves:
            self._write(f"{_line(self.what)}\n")
            return
        seconds = time.monotonic() - self.step_began
        mark = _MARKS[int(seconds / _BETWEEN) % len(_MARKS)]
        text = f"{mark} {_line(self.what)} {seconds:.0f} s"
        self.drawn = True
        self._write(f"\r{text[: shutil.get_terminal_size().columns - 1]}\033[K")

    def clear(self) -> None:
        """Remove the line that moves, for another one; it comes again."""
        with self.lock:
            if self.drawn:
                self.drawn = False
                self._write("\r\033[K")

    def leave_out(self) -> None:
        """Print no step before the next one."""
        with self.lock:
            self.left_out = True
            self.clear()

    def end(self) -> None:
        """Print nothing more."""
        self.ended.set()
        self.clear()

    def _write(self, text: str) -> None:
        with suppress(OSError):
            os.write(self.handle, text.encode(errors="replace"))


_signs: list[_Sign] = []


def _line(what: str) -> str:
    return f"excite: {one_line(what)} ..."


@contextmanager
def sign_of_life() -> Iterator[None]:
    """Say what the command in the block is doing, if it takes longer."""
    handle: int | None = None
    with suppress(AttributeError, OSError, ValueError):  # where stderr is no file
        handle = sys.stderr.fileno()
    if handle is None:
        yield
        return
    sign = _Sign(handle, moves=can_move(sys.stderr))
    _signs.append(sign)
    sign.watch.start()
    try:
        yield
    finally:
        sign.end()
        _signs.remove(sign)


def tell(what: str) -> None:
    """State what the command does next, such as ``drawing``; it is shown once the command has taken some time."""
    repeat_lost_signal()
    for sign in _signs[-1:]:
        sign.tell(what)


def something_is_shown() -> None:
    """Print no step before the next one: other progress is on the terminal, such as a bar, which it would break."""
    for sign in _signs:
        sign.leave_out()


def clear_line() -> None:
    """Remove the line that moves, so that another line can be printed."""
    for sign in _signs:
        sign.clear()


def be_quiet() -> None:
    """Print no step of this command."""
    for sign in _signs:
        sign.end()


_PLAIN = ("dumb", "unknown")


def can_move(stream: TextIO) -> bool:
    """Whether a line on the stream can be drawn again."""
    return stream.isatty() and os.environ.get("TERM", "").lower() not in _PLAIN


def has_colours(stream: TextIO) -> bool:
    """Whether text on the stream may have colours and emphasis."""
    if os.environ.get("NO_COLOR"):
        return False
    plain = os.environ.get("TERM", "").lower() in _PLAIN
    return not plain and (bool(os.environ.get("FORCE_COLOR")) or stream.isatty())


_TYPED: Mapping[str, str] = {
    "position": "--position-limit",
    "velocity": "--velocity-limit",
    "acceleration": "--acceleration-limit",
    "jerk": "--jerk-limit",
    "constraints": "--constraint",
    "replace": "--force",
    "percent": "--speeds",
    "folder": "--out",
    "friction_scale": "--scale-friction",
}
_COMMANDS: Mapping[str, str] = {  # what a function of the API is on the command line
    **{name: name for name in ("identify", "simulate", "verify", "compare")},
    "design_trajectory": "design",
    **dict.fromkeys(("plan_campaign", "next_motion"), "plan"),
    "run_sweep": "sweep run",
    "predict_accuracy": "predict",
    **dict.fromkeys(("export_ensemble", "export_model", "export_motion"), "export"),
    "plan_friction": "friction plan",
    "fit_friction": "friction fit",
    "design_payload_motion": "payload design",
    "calibrate_gains": "payload gains",
    "identify_payload": "payload identify",
    "guess_mapping": "logs",
    "write_report": "report",
}


def in_options(message: str) -> str:
    """A message with every option and call in backticks in its command-line form, and nothing a terminal would obey."""
    return re.sub(r"`(\w+)(?:=([^`]*))?`", _option, printable(" ".join(message.split("\n"))))


def _option(match: re.Match[str]) -> str:
    name, value = match.group(1), match.group(2)
    if value is None and name in _COMMANDS:
        return f"'excite {_COMMANDS[name]}'"
    typed = _TYPED.get(name, "--" + name.replace("_", "-"))
    if value == "False":
        return typed.replace("--", "--no-", 1)
    return typed if value is None or value == "True" else f"{typed} {value.strip(chr(39) + chr(34))}"
