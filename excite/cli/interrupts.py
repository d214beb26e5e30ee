"""Ctrl-C on the command line: the first one ends the search; further ones cannot disturb saving its result."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def one_interrupt() -> Iterator[Callable[[], None]]:
    """Let the first Ctrl-C in the block raise KeyboardInterrupt, and ignore later ones.

    Yields
    ------
    callable
        To be called when only saving remains: from then on every Ctrl-C is ignored.

    Where Python does not handle Ctrl-C (a background job ignores it), nothing changes.
    """
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler:
        yield lambda: None
        return

    answered = False

    def first(_: int, __: FrameType | None) -> None:
        if not answered:
            ignore()
            raise KeyboardInterrupt

    def ignore() -> None:
        nonlocal answered
        answered = True

    signal.signal(signal.SIGINT, first)
    try:
        yield ignore
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def deferred_interrupt(message: str) -> Iterator[Callable[[], None]]:
    """Defer a Ctrl-C in the block to a safe point: compiled computations must not be interrupted.

    Parameters
    ----------
    message : str
        Printed when Ctrl-C is pressed.

    Yields
    ------
    callable
        Raises KeyboardInterrupt if Ctrl-C was pressed.

    Where Python does not handle Ctrl-C, nothing changes.
    """
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler:
        yield lambda: None
        return

    pressed = False

    def press(_: int, __: FrameType | None) -> None:
        nonlocal pressed
        if not pressed:
            os.write(2, f"excite: {message}\n".encode())  # not through streams, which may be in the middle of a write
        pressed = True

    def answer() -> None:
        if pressed:
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, press)
    try:
        yield answer
    finally:
        signal.signal(signal.SIGINT, before)
