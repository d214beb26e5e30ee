"""Executors: the starts of each round are optimised beside each other, and written to disk as soon as they end."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import chain, pairwise
from pathlib import Path
from typing import Any, cast
from weakref import WeakKeyDictionary

import cloudpickle

from excite.design.formulation import Formulation
from excite.design.interruption import deferred_interruption
from excite.design.kept_starts import remove_temporary
from excite.design.search_rounds import Rounds
from excite.design.single_start import optimise_starts
from excite.design.start_results import PlannedStart, StartResult
from excite.design.workers import NotPreparedError, Work, Workers, environment_of_workers, optimise_job, work_on_starts
from excite.registry import instance
from regressors.errors import InputError

Progress = Callable[[StartResult], None]
Starts = Sequence[PlannedStart | int]
StartsOfRounds = Iterable[Starts]
_TOGETHER = 4  # starts that are optimised together: what is measured of them comes when all have ended
_log = logging.getLogger(__name__)


def pickled(*content: Any) -> bytes:
    """Functions, a blueprint and more, pickled for other processes, with classes of the user's script by value."""
    try:
        return bytes(cloudpickle.dumps(content))
    except Exception as error:
        raise InputError(
            f"a part of this task cannot be sent to other processes ({error}); Search(executor='serial') keeps it in "
            "this one"
        ) from error


def serial(formulation: Formulation, rounds: StartsOfRounds, folder: Path, progress: Progress) -> None:
    """Optimise the starts of each round in this process."""
    search, origin = formulation.task.search, formulation.identity.origin
    with deferred_interruption() as answer:
        problem, method = formulation.problem, instance("solver", search.solver)
        answer()
        for starts in rounds:
            for some in shares(starts, 1, formulation):
                for result in optimise_starts(problem, method, search.seed, some, folder, answer, origin):
                    progress(result)
                answer()


def shares(starts: Starts, workers: int, formulation: Formulation) -> list[Starts]:
    """The starts of a round in equal parts, each for one worker at a time, which optimises its starts together.

    Alone, where they are all of a search, so that each is on disk as early as can be, or where evaluations are
    expensive for other reasons than their number.
    """
    alone = not formulation.task.search.adaptive or formulation.problem.limits.nonlinear_in_x
    parts = len(starts) if alone else min(len(starts), workers * -(-len(starts) // (_TOGETHER * workers)))
    ends = [len(starts) * k // parts for k in range(parts + 1)]
    return [starts[begin:end] for begin, end in pairwise(ends)]


def run_in_pool(formulation: Formulation, rounds: StartsOfRounds, folder: Path, progress: Progress) -> None:
    """Optimise the starts of each round in worker processes; one that ends unexpectedly is announced and replaced.

    Where worker processes cannot build the problem, a warning is logged, and the starts run in this process. The
    arguments are those of `serial`.
    """
    seed = formulation.task.search.seed
    following, starts = iter(rounds), cast("Starts", ())
    with _workers(formulation) as workers:
        try:
            for starts in following:
                parts = shares(starts, workers.count, formulation)
                for result in workers.run((seed, some, folder) for some in parts):
                    progress(result)
            return
        except NotPreparedError as error:
            workers.end()
            _log.warning("worker processes cannot build the problem (%s): the starts run in this process", error)
        except BaseException:
            workers.end()
            raise
        finally:
            remove_temporary(folder)
    serial(formulation, chain([starts], following), folder, progress)


@contextmanager
def ready_workers(formulation: Formulation) -> Iterator[None]:
    """Start the worker processes of a search now, and keep them for all its calls of `run_in_pool` in the block.

    To be entered before threads are started, such as that of a progress bar: a process without threads forks its
    workers, which costs next to nothing; another one has each of them import everything and build the problem.
    """
    if formulation.task.search.executor != "process":
        yield
        return
    with _workers(formulation) as workers:
        workers.start()
        yield


_kept: WeakKeyDictionary[Formulation, Workers] = WeakKeyDictionary()


@contextmanager
def _workers(formulation: Formulation) -> Iterator[Workers]:
    """The processes of a problem, those of an outer block if there are any."""
    if formulation in _kept:
        yield _kept[formulation]
        return
    search, origin = formulation.task.search, formulation.identity.origin
    content = pickled(work_on_starts, formulation.blueprint, origin)

    def prepared() -> Work:
        return partial(optimise_job, formulation.problem, instance("solver", search.solver), origin)

    with environment_of_workers():
        largest = Rounds(search).largest
        workers = Workers(content, prepared, min(search.workers or os.cpu_count() or 1, largest))
        _kept[formulation] = workers
        try:
            yield workers
        finally:
            del _kept[formulation]
            workers.end()
