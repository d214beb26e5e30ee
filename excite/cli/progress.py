"""Progress of a search on stderr: a bar on a terminal, a line per improvement elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from excite.cli.sign_of_life import something_is_shown

if TYPE_CHECKING:
    from excite.design.multistart import StartResult


@contextmanager
def progress_of_starts(total: int, at_end: Callable[[], None]) -> Iterator[Callable[[StartResult], None]]:
    """Report finished starts and the best value so far.

    Parameters
    ----------
    total : int
        Number of starts.
    at_end : callable
        Called when the last one has finished.
    """
    if not sys.stderr.isatty():
        yield _lines(total, at_end)
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("designing"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("starts, best {task.fields[best]}"),
        TimeElapsedColumn(),
    )
    something_is_shown()
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("starts", total=total, best="-")
        best, done = float("inf"), 0

        def report(result: StartResult) -> None:
            nonlocal best, done
            best, done = min(best, result.value), done + 1
            bar.update(task, advance=1, best=f"{best:.4g}")
            if done == total:
                at_end()

        yield report


def _lines(total: int, at_end: Callable[[], None]) -> Callable[[StartResult], None]:
    best, done = float("inf"), 0

    def report(result: StartResult) -> None:
        nonlocal best, done
        done += 1
        if result.value < best:
            best = result.value
            click.echo(f"start {done} of {total}: best so far {best:.4g}", err=True)
        if done == total:
            at_end()

    return report
