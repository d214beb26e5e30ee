"""Repetitions of an experiment through the whole chain, in little memory."""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import closing, nullcontext

import numpy as np
from threadpoolctl import threadpool_limits

from excite.design.interruption import current_interruption
from excite.errors import LostWorkersError
from excite.estimates.long_work import announce
from excite.executors.unit_executor import InThisProcess, LostUnit, UnitExecutor, Work
from excite.identification.repetition_count import repetition_prediction
from excite.montecarlo.batch_estimators import Solved
from excite.montecarlo.experiment import Experiment
from excite.montecarlo.repetition_time import repetition_seconds
from excite.montecarlo.repetition_units import (
    SeededExperiment,
    common_of,
    executor_of_repetitions,
    numerical_repetition,
    processes_here,
    repeat_in_one_thread,
    repeat_numbers,
    units_of,
)
from excite.montecarlo.repetitions import Repetitions
from regressors.errors import InputError
from regressors.quantities import check

_ENDED = "Ctrl-C ends them, and what was identified is saved"
_FEWEST = 2  # repetitions that have a scatter
_log = logging.getLogger(__name__)


@numerical_repetition()
def repeat_experiment(
    experiment: Experiment,
    count: int,
    seed: int,
    *,
    progress: Callable[[int, int], None] | None = None,
    executor: str | UnitExecutor = "process",
    workers: int | None = None,
) -> Repetitions:
    """Estimates from repetitions with different noise.

    Parameters
    ----------
    experiment : Experiment
    count : int
        Number of repetitions.
    seed : int
        Repetition k of a seed is the same to the last digit whatever `count`, `executor` and `workers` are; on a GPU to
        rounding.
    progress : callable, optional
        Called with the number of repetitions done and `count`: after each in this process, elsewhere after some.
    executor : str or UnitExecutor
        ``process``, ``serial``, ``dask://HOST:PORT``, ``dask-file:PATH``, ``dask-local`` or ``dask-local:N``: where
        repetitions are computed. ``process`` is worker processes of this machine, but this process where all
        repetitions are predicted to take less than 10 s, where JAX finds a GPU, and where there would be one worker
        only. A worker that is not forked took 1.4 to 2.7 s of processor time to start, so that two of them are quicker
        from 6 s on, and the prediction is right within a factor of three; other machines were not measured.
    workers : int, optional
        Processes of this machine; if not given one per core, or as many as fit into the cap on memory.

    Returns
    -------
    Repetitions
        After Ctrl-C those that were completed, `interrupted`, if there are two or more. Repetitions that end their
        worker again and again are left out, which is logged.

    Raises
    ------
    InputError
        Fewer than two repetitions, asked for or left, more memory than the cap, a motion from which the parameters are
        not identifiable, a method that chooses its settings from the positions, or Dask not reachable.
    LostWorkersError
        Worker processes end again and again, or the Dask scheduler went away.
    """
    check("repeats", count)
    check("seed", seed)
    if count < _FEWEST:
        raise InputError(f"repetitions: expected {_FEWEST} or more, given {count}")
    units = executor_of_repetitions(executor, workers, experiment, count)
    repetition_prediction(count, experiment.base.rank).check()
    announce("the repetitions", repetition_seconds(experiment, count) / max(1, processes_here(units)), _ENDED)
    common = common_of(units, experiment, seed)
    here = isinstance(units, InThisProcess)  # a process that limits its threads could not be forked
    with threadpool_limits(1) if here else nullcontext():
        solved, interrupted = _solved(units, repeat_numbers if here else repeat_in_one_thread, common, count, progress)
    with threadpool_limits(1):
        return _summary(common, solved, interrupted=interrupted)


def _summary(common: SeededExperiment, solved: list[Solved], *, interrupted: bool) -> Repetitions:
    chain, base = common.chain, common.experiment.base
    beta = np.asarray(common.experiment.beta, dtype=float)
    P = np.eye(beta.size) if chain.change is None else chain.change
    estimates = beta + np.array([P @ one.error for one in solved])
    predicted = np.array([np.linalg.norm(P @ one.half, axis=1) for one in solved])
    noise = np.array([one.noise for one in solved])
    return Repetitions(
        base.names, base.units, beta, estimates, predicted, noise, chain.rows - base.rank, common.seed, interrupted
    )


def _solved(
    executor: UnitExecutor,
    work: Work,
    common: SeededExperiment,
    count: int,
    progress: Callable[[int, int], None] | None,
) -> tuple[list[Solved], bool]:
    """The repetitions that were completed, by their numbers, and whether an interrupt ended them before the last."""
    solved: dict[int, Solved] = {}
    units, interrupted = units_of(executor, common, count), False
    try:
        with closing(executor.run(work, common, units)) as results:
            for index, result in results:
                if isinstance(result, LostUnit):
                    _leave_out(units[index], result)
                    continue
                solved.update(zip(units[index], result, strict=True))
                if progress is not None:
                    progress(len(solved), count)
    except KeyboardInterrupt:
        if len(solved) < _FEWEST:
            raise
        interrupted = True
        if (answered := current_interruption()) is not None:
            answered.caught()
    except LostWorkersError as error:
        raise LostWorkersError(error.args[0], "repeat with fewer `workers`, or with another `executor`") from error
    if len(solved) < _FEWEST:
        raise InputError(
            f"repetitions: {len(solved)} of {count} are left, since workers ended; repeat with fewer `workers`, or "
            "with another `executor`"
        )
    return [solved[number] for number in sorted(solved)], interrupted


def _leave_out(numbers: range, lost: LostUnit) -> None:
    which = f"repetition {numbers[0]} is" if len(numbers) == 1 else f"repetitions {numbers[0]} to {numbers[-1]} are"
    _log.warning("%s left out: %s", which, lost.reason)
