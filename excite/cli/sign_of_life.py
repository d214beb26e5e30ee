"""A line on the terminal where a command has shown nothing yet after some time."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

SECONDS = 1.5
_timers: list[threading.Timer] = []


@contextmanager
def sign_of_life() -> Iterator[None]:
    """Say that the command in the block is at work, if it takes longer and stderr is a terminal."""
    if sys.stderr is None or not sys.stderr.isatty():
        yield
        return
    handle = sys.stderr.fileno()
    # not through streams, which may be in the middle of a write
    timer = threading.Timer(SECONDS, os.write, (handle, b"excite: working ...\n"))
    timer.daemon = True
    _timers.append(timer)
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        _timers.remove(timer)


def something_is_shown() -> None:
    """Leave the line out: a bar is on the terminal, which it would break."""
    for timer in _timers:
        timer.cancel()
