"""What a command is doing, on stderr, once it has taken some time; a command that ends sooner prints nothing of it.

On a terminal it is one line that moves: a mark that turns, the step, and for how long it has been at work. Elsewhere
each step is a line that ends in three dots, and no other line does.
"""

from __future__ import annotations

import os
import shutil
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from excite.cli.terminal import can_move
from excite.design.interruption import repeat_lost_signal
from excite.operating_system import ForkSafeThread
from regressors.errors import one_line

SECONDS = 1.5
_BETWEEN = 0.2  # seconds between two drawings of the line
_MARKS = "|/-\\"


class _Sign:
    """The steps of one command."""

    def __init__(self, handle: int, *, moves: bool) -> None:
        self.handle, self.moves, self.what = handle, moves, "working"
        self.began = self.step_began = time.monotonic()
        self.shown = self.drawn = self.left_out = self.quiet = False
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
            if self.ended.is_set() or self.left_out or self.quiet or (self.shown and not self.moves):
                return
            self.shown = True
            self._print()

    def tell(self, what: str) -> None:
        """State the next step, which is printed where an earlier one has been, or would have been."""
        with self.lock:
            self.what, self.step_began, self.left_out = what, time.monotonic(), False
            self.shown = self.shown or time.monotonic() - self.began > SECONDS
            if self.shown and not self.quiet:
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
    handle = _handle()
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


def _handle() -> int | None:
    """Number of the file that stderr is; None where it is none."""
    try:
        return None if sys.stderr is None else sys.stderr.fileno()
    except (AttributeError, OSError, ValueError):
        return None


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
        sign.quiet = True
        sign.clear()
