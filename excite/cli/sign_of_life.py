"""What a command is doing, on stderr, once it has taken some time; a command that ends sooner prints nothing of it.

Its lines end in three dots, and no others do.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from excite.cli.streams import say
from excite.design.interruption import repeat_lost_signal
from regressors.quoting import one_line

SECONDS = 1.5


class _Sign:
    """The steps of one command."""

    def __init__(self, handle: int) -> None:
        self.handle, self.what, self.began, self.shown = handle, "working", time.monotonic(), False
        self.lock = threading.Lock()
        self.timer = threading.Timer(SECONDS, self.show)
        self.timer.daemon = True

    def show(self) -> None:
        """Print the step at work; not through streams, which may be in the middle of a write."""
        with self.lock:
            if self.shown:
                return
            self.shown = True
        with suppress(OSError):
            os.write(self.handle, f"{_line(self.what)}\n".encode(errors="replace"))

    def tell(self, what: str) -> None:
        """State the next step, which is printed where an earlier one has been, or would have been."""
        with self.lock:
            self.what = what
            self.shown = self.shown or time.monotonic() - self.began > SECONDS
        if self.shown:
            say(_line(what))

    def leave_out(self) -> None:
        """Print no step before the next one."""
        self.timer.cancel()


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
    sign = _Sign(handle)
    _signs.append(sign)
    sign.timer.start()
    try:
        yield
    finally:
        sign.leave_out()
        _signs.remove(sign)


def _handle() -> int | None:
    """Number of the file that stderr is; None where it is none."""
    try:
        return None if sys.stderr is None else sys.stderr.fileno()
    except (AttributeError, OSError, ValueError):
        return None


def tell(what: str) -> None:
    """State what the command does next, such as ``drawing``; it is shown once the command has taken some time.

    Parameters
    ----------
    what : str

    Raises
    ------
    KeyboardInterrupt
        A signal has arrived that compiled code has swallowed.
    """
    repeat_lost_signal()
    for sign in _signs[-1:]:
        sign.tell(what)


def something_is_shown() -> None:
    """Print no step before the next one: other progress is on the terminal, such as a bar, which it would break."""
    for sign in _signs:
        sign.leave_out()
