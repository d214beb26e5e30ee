"""Ctrl-C, SIGTERM and SIGHUP on the command line: the first one ends the work, and the best so far is saved."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from excite.design.interruption import Interruption, answered_signals, current_interruption, deferred_interruption


@contextmanager
def one_interrupt() -> Iterator[Interruption]:
    """Let the first signal in the block raise KeyboardInterrupt; a second one ends the process at once."""
    installed = current_interruption()
    if installed is None:
        with answered_signals() as own:
            yield own
        return
    try:
        yield installed
    finally:
        installed.heed()


@contextmanager
def deferred_interrupt(message: str) -> Iterator[Callable[[], None]]:
    """Defer a signal in the block to a safe point: compiled computations must not be interrupted."""

    def say() -> None:  # not through streams, which may be in the middle of a write
        with suppress(OSError):
            os.write(2, f"excite: {message}\n".encode())

    with deferred_interruption(say) as answer:
        yield answer


def interrupted_status() -> int:
    """Exit status after a signal: 130 for Ctrl-C, 143 for SIGTERM, 129 for SIGHUP."""
    installed = current_interruption()
    return Interruption().status if installed is None else installed.status
