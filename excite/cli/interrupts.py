"""Ctrl-C on the command line: the first one ends the search, and no further one spoils the saving of what it found."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def one_interrupt() -> Iterator[Callable[[], None]]:
    """Let the first Ctrl-C in the block raise KeyboardInterrupt, and ignore those after it.

    Yields
    ------
    callable
        To be called when nothing is left but to save: from then on every Ctrl-C is ignored.

    Where Ctrl-C is not Python's to answer (a job in the background ignores it), nothing changes.
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
