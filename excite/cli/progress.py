"""Progress of long work on stderr, redrawn on a terminal, in lines elsewhere; and its interruption."""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from excite.cli.streams import SECONDS, can_move, remark, say, something_is_shown, tell, verbosity
from excite.design.interruption import Interruption, answered_signals, current_interruption, deferred_interruption

if TYPE_CHECKING:
    from excite.design.start_results import StartResult
    from excite.design.starts import KeptStarts
    from excite.design.sweeps.run_sweep import CellProgress


_Steps = Callable[[int, int], None]  # of what is done, and of the total
_MANY = 100  # starts above which a line comes before the first of them has ended
_BETWEEN = 2.0  # seconds between two lines of a simulation
_SILENCE = 2.0  # before the first line on repetitions [s]
_PAUSE = 5.0  # between two lines of it [s]


@contextmanager
def progress_of_starts(kept: KeptStarts) -> Iterator[Callable[[StartResult], None]]:
    """Report finished starts and the best value so far."""
    if verbosity().quiet:
        yield lambda _: None
    elif verbosity().verbose or not can_move(sys.stderr):
        yield _lines(kept)
    else:
        best, done = kept.best, len(kept.done)
        text, shown = "starts, best {task.fields[best]}", f"{best:.4g}" if done else "-"
        with _bar(text, total=kept.count, completed=done, best=shown) as update:

            def report(result: StartResult) -> None:
                nonlocal best
                best = min(best, result.value)
                update(advance=1, best=f"{best:.4g}")

            yield report


@contextmanager
def _bar(text: str, *, verb: str = "designing", remaining: bool = False, **first: Any) -> Iterator[Callable[..., None]]:
    """A bar on a terminal; what is yielded moves it."""
    from rich import progress

    from excite.cli.summary import console_of_progress

    something_is_shown()
    count = (progress.TextColumn(verb), progress.BarColumn(), progress.MofNCompleteColumn(), progress.TextColumn(text))
    left = (progress.TextColumn("left"), progress.TimeRemainingColumn()) if remaining else ()
    columns = (*count, progress.TimeElapsedColumn(), *left)
    with progress.Progress(*columns, console=console_of_progress()) as bar:
        yield partial(bar.update, bar.add_task("", **first))


def _lines(kept: KeptStarts) -> Callable[[StartResult], None]:
    total, best, done = kept.count, kept.best, len(kept.done)
    of_all = f" of {total}" if total is not None else ""
    if total is not None and total - done > _MANY:
        say(f"excite: {total - done} starts to run")

    def report(result: StartResult) -> None:
        nonlocal best, done
        done += 1
        better = result.value < best
        best = min(best, result.value)
        if verbosity().verbose:
            say(f"start {done}{of_all}: {result.value:.4g} in {result.cpu:.1f} s, {result.status}; best {best:.4g}")
        elif better:
            something_is_shown()
            say(f"start {done}{of_all}: best so far {best:.4g}")

    return report


@contextmanager
def progress_of_cells() -> Iterator[tuple[Callable[[int, int], None], Callable[[CellProgress], None]]]:
    """Report finished cells of a campaign, in lines at most every two seconds where there is no terminal."""
    if verbosity().quiet:
        yield (lambda _, __: None), (lambda _: None)
    elif verbosity().verbose or not can_move(sys.stderr):
        yield (lambda _, left: say(f"excite: {left} cells to run") if left else None), _lines_of_cells()
    else:
        with _bar("cells, last {task.fields[last]}", remaining=True, total=None, last="-") as update:
            yield (
                lambda done, left: update(total=done + left, completed=done),
                lambda ended: update(completed=ended.done, last=_of_cell(ended)),
            )


def _of_cell(ended: CellProgress) -> str:
    return f"{ended.cell}: {ended.status}" if ended.status else f"{ended.cell}: {ended.condition or math.inf:.4g}"


def _lines_of_cells() -> Callable[[CellProgress], None]:
    shown = 0.0

    def report(ended: CellProgress) -> None:
        nonlocal shown
        now = time.monotonic()
        if verbosity().verbose or now - shown > _BETWEEN or ended.done == ended.total:
            shown = now
            something_is_shown()
            because = f", {ended.reason}" if ended.reason and verbosity().verbose else ""
            say(f"cell {ended.done} of {ended.total}: {_of_cell(ended)}{because}")

    return report


@contextmanager
def progress_of_repetitions(total: int) -> Iterator[_Steps]:
    """Report finished repetitions, in lines not more often than every few seconds where there is no terminal."""
    if verbosity().quiet or not can_move(sys.stderr):
        yield _lines_of_repetitions()
    else:
        with _bar("", verb="repeating", remaining=True, total=total) as update:
            yield lambda done, _: update(completed=done)


def _lines_of_repetitions() -> _Steps:
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
def progress_of_samples(verb: str = "simulated") -> Iterator[_Steps]:
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
def stoppable(progress: AbstractContextManager[_Steps], message: str) -> Iterator[_Steps]:
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
