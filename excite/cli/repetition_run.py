"""``excite identify --repeat N``: repetitions in simulation, compared with the predicted accuracy."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from excite.cli.interrupts import deferred_interrupt, interrupted_status, one_interrupt
from excite.cli.literal_console import console_of_progress
from excite.cli.messages import in_options
from excite.cli.options import FigureChoice
from excite.cli.sign_of_life import something_is_shown
from excite.cli.streams import remark, say, verbosity
from excite.cli.terminal import can_move
from excite.errors import LostWorkersError
from excite.identification.identification import Identification
from excite.identification.result import RepeatedParameter, RepetitionSummary
from excite.identification.result_json import SO_FAR, amend_result_file
from excite.registry import is_addressed
from excite.study.repetitions import Repetitions
from regressors.errors import InputError

_SILENCE = 2.0  # before the first line of progress [s]
_PAUSE = 5.0  # between two lines of it [s]


def repeat_and_write(
    result: Identification,
    out: Path,
    count: int,
    seed: int,
    figures: FigureChoice,
    *,
    executor: str,
    workers: int | None,
) -> tuple[Identification, int]:
    """Repeat an identification in simulation, add the statistics to its result, and draw them beside it."""
    from excite.study.repetitions import repetitions

    try:
        with _interrupts(executor) as answer, _progress(count) as progress:

            def report_progress(done: int, of: int) -> None:
                progress(done, of)
                if done < of:
                    answer()

            repeated_runs = repetitions(
                result, count, seed, report_progress, executor=executor, workers=workers, kept=out / SO_FAR
            )
            result = replace(result, kept=result.facts, repetitions=summary_of(repeated_runs))
            amend_result_file(out, result)
    except KeyboardInterrupt:
        say("excite: interrupted; the result is saved, without repetitions")
        return result, interrupted_status()
    except InputError as error:
        raise InputError(f"{error}; the result in {out} is saved, without repetitions") from error
    except LostWorkersError as error:
        saved = f"the result in {out} is saved, without repetitions"
        raise LostWorkersError(*error.args, saved + _continued(out)) from error
    if figures:
        from excite.views.figures import write_view_figures
        from excite.views.identification_view import repetitions_view

        write_view_figures(repetitions_view(result, repeated_runs), out, **figures.how)
    if repeated_runs.interrupted:
        done = f"with {repeated_runs.count} of {count} repetitions"
        say(f"excite: interrupted; the result is saved, {in_options(done + _continued(out))}")
        return result, interrupted_status()
    return result, 0


def _continued(out: Path) -> str:
    return "; with `force`, the same command goes on" if (out / SO_FAR).exists() else ""


def summary_of(repeated: Repetitions) -> RepetitionSummary:
    """Statistics of repetitions, as a result keeps them."""
    numbers = (repeated.deviation, repeated.predicted_deviation, repeated.bias, repeated.bias_error, repeated.coverage)
    rows = zip(repeated.names, repeated.units, *(each.tolist() for each in numbers), strict=True)
    return RepetitionSummary(repeated.count, repeated.seed, tuple(RepeatedParameter(*row) for row in rows))


@contextmanager
def _interrupts(executor: str) -> Iterator[Callable[[], None]]:
    """Defer a signal to the end of the repetitions at work; while this process waits for Dask, heed it at once."""
    if is_addressed("executor", executor):
        with one_interrupt():
            yield lambda: None
        return
    with deferred_interrupt("stopping after the repetitions at work") as answer:
        yield answer


@contextmanager
def _progress(total: int) -> Iterator[Callable[[int, int], None]]:
    if verbosity().quiet or not can_move(sys.stderr):
        yield _Lines()
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    something_is_shown()
    columns = (TextColumn("repeating"), BarColumn(), MofNCompleteColumn(), TextColumn("left"), TimeRemainingColumn())
    with Progress(*columns, console=console_of_progress()) as bar:
        task = bar.add_task("repeating", total=total)
        yield lambda done, _: bar.update(task, completed=done)


class _Lines:
    """Progress in lines, not more often than every few seconds."""

    def __init__(self) -> None:
        self.began = time.monotonic()
        self.next = self.began + _SILENCE

    def __call__(self, done: int, count: int) -> None:
        now = time.monotonic()
        if done < count and now < self.next:
            return
        self.next = now + _PAUSE
        left = (now - self.began) / done * (count - done)
        remark(f"excite: {done} of {count} repetitions" + f", about {left:.0f} s left" * (done < count))
