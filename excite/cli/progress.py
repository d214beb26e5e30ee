"""Progress of long work on stderr, redrawn on a terminal, in lines elsewhere; and its interruption."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from functools import partial
from typing import Any

import click

from excite.cli.streams import SECONDS, can_move, has_colours, remark, something_is_shown, tell, verbosity
from excite.design.interruption import Interruption, answered_signals, current_interruption, deferred_interruption
from regressors.work_prediction import Steps

_BETWEEN = 2.0  # seconds between two lines of a simulation
_SILENCE = 2.0  # before the first line on repetitions [s]
_PAUSE = 5.0  # between two lines of it [s]


@contextmanager
def bar(text: str, *, verb: str = "designing", remaining: bool = False, **first: Any) -> Iterator[Callable[..., None]]:
    """A bar on stderr, a terminal; what is yielded moves it."""
    from rich import console, progress

    something_is_shown()
    out = console.Console(stderr=True, color_system="auto" if has_colours(sys.stderr) else None)
    count = (progress.TextColumn(verb), progress.BarColumn(), progress.MofNCompleteColumn(), progress.TextColumn(text))
    left = (progress.TextColumn("left"), progress.TimeRemainingColumn()) if remaining else ()
    columns = (*count, progress.TimeElapsedColumn(), *left)
    with progress.Progress(*columns, console=out) as bar:
        yield partial(bar.update, bar.add_task("", **first))


@contextmanager
def progress_of_repetitions(total: int) -> Iterator[Steps]:
    """Report finished repetitions, in lines not more often than every few seconds where there is no terminal."""
    if verbosity().quiet or not can_move(sys.stderr):
        yield _lines_of_repetitions()
    else:
        with bar("", verb="repeating", remaining=True, total=total) as update:
            yield lambda done, _: update(completed=done)


def _lines_of_repetitions() -> Steps:
    began = time.monotonic()
    due = began + _SILENCE

    def report(done: int, count: int) -> None:
        nonlocal due
        now = time.monotonic()
        if done < count and now < due:
            return
        due = now + _PAUSE
        left = (now - began) / done * (count - done)
        remark(f"excite: {done} of {count} repetitions" + f", about {left:.0f} s left" * (done < count))

    return report


@contextmanager
def progress_of_samples(verb: str = "simulated") -> Iterator[Steps]:
    """Report the share of a simulation, or of other work, that is done, if it takes longer."""
    start = shown = time.monotonic()
    terminal, quiet = can_move(sys.stderr), verbosity().quiet

    def report(done: int, total: int) -> None:
        nonlocal shown
        if quiet:
            return
        now, text = time.monotonic(), f"{verb} {100 * done // total} %"
        if not terminal and now - shown > _BETWEEN:
            shown = now
            tell(text)
        elif terminal and now - start > SECONDS and now - shown > 0.2:
            shown = now
            something_is_shown()
            click.echo(f"\r{text}", err=True, nl=False)

    try:
        yield report
    finally:
        if terminal and shown > start:
            click.echo("\r\033[K", err=True, nl=False)


@contextmanager
def one_interrupt() -> Iterator[Interruption]:
    """Let the first signal in the block raise KeyboardInterrupt; a second one ends the process at once."""
    installed = current_interruption()
    with answered_signals() if installed is None else nullcontext(installed) as interruption:
        try:
            yield interruption
        finally:
            interruption.heed()


@contextmanager
def stoppable(progress: AbstractContextManager[Steps], message: str) -> Iterator[Steps]:
    """Show progress, and defer a signal in the block to a step: compiled computations must not be interrupted."""

    def say() -> None:  # not through streams, which may be in the middle of a write
        with suppress(OSError):
            os.write(2, f"excite: {message}\n".encode())

    with deferred_interruption(say) as answer, progress as report:

        def report_and_answer(done: int, total: int) -> None:
            report(done, total)
            if done < total:
                answer()

        yield report_and_answer


def interrupted_status() -> int:
    """Exit status after a signal: 130 for Ctrl-C, 143 for SIGTERM, 129 for SIGHUP."""
    return (current_interruption() or Interruption()).status
