"""Repetitions of an experiment through the whole chain, in little memory."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from contextlib import closing, nullcontext
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from excite.design.interruption import current_interruption
from excite.errors import LostWorkersError
from excite.estimates.long_work import announce
from excite.executors.unit_executor import InThisProcess, LostUnit, UnitExecutor, Work
from excite.identification.repetition_count import repetition_prediction
from excite.montecarlo.experiment import Experiment
from excite.montecarlo.kept_repetitions import KeptRepetitions
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
from excite.montecarlo.repetitions import Repetition, Repetitions
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
    kept: str | Path | None = None,
) -> Repetitions:
    """Estimates from repetitions with different noise."""
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
        running = _Running(count, None if kept is None else KeptRepetitions(Path(kept), common), progress)
        running.run(units, repeat_numbers if here else repeat_in_one_thread, common)
    return _summary(common, running.found, interrupted=running.interrupted)


def _summary(common: SeededExperiment, found: Mapping[int, Repetition], *, interrupted: bool) -> Repetitions:
    chain, base = common.chain, common.experiment.base
    beta = np.asarray(common.experiment.beta, dtype=float)
    error, deviation, noise = (np.array(part) for part in zip(*(found[k] for k in sorted(found)), strict=True))
    return Repetitions(
        base.names, base.units, beta, beta + error, deviation, noise, chain.rows - base.rank, common.seed, interrupted
    )


class _Running:
    """Repetitions that are there, and those that are to come."""

    def __init__(self, count: int, kept: KeptRepetitions | None, progress: Callable[[int, int], None] | None) -> None:
        self.count, self._kept, self._progress = count, kept, progress
        self.found = {} if kept is None else kept.read(count)
        self.interrupted = False

    def run(self, executor: UnitExecutor, work: Work, common: SeededExperiment) -> None:
        """Compute what is left, until Ctrl-C."""
        left = [number for number in range(self.count) if number not in self.found]
        units = units_of(executor, common, left) if left else []
        try:
            with closing(executor.run(work, common, units)) as results:
                for index, result in results:
                    self._take(units[index], result)
        except KeyboardInterrupt:
            self._keep()
            if len(self.found) < _FEWEST:
                raise
            self.interrupted = True
            if (answered := current_interruption()) is not None:
                answered.caught()
        except LostWorkersError as error:
            raise LostWorkersError(error.args[0], self._remedy()) from error
        if len(self.found) < _FEWEST:
            raise InputError(
                f"repetitions: {len(self.found)} of {self.count} are left, since workers ended; repeat with fewer "
                "`workers`, or with another `executor`"
            )
        if self._kept is not None and not self.interrupted:
            self._kept.remove()

    def _take(self, numbers: range, result: list[Repetition] | LostUnit) -> None:
        if isinstance(result, LostUnit):
            _leave_out(numbers, result)
            return
        self.found.update(zip(numbers, result, strict=True))
        if self._kept is not None:
            self._kept.save(self.found)
        if self._progress is not None:
            self._progress(len(self.found), self.count)

    def _keep(self) -> bool:
        return self._kept is not None and self._kept.save(self.found, now=True)

    def _remedy(self) -> str:
        if self._kept is not None and self._keep():
            done = f"{len(self.found)} of {self.count} repetitions"
            return f"{done} are kept in {self._kept.path}, and the same call computes the rest"
        return "repeat with fewer `workers`, or with another `executor`"


def _leave_out(numbers: range, lost: LostUnit) -> None:
    which = f"repetition {numbers[0]} is" if len(numbers) == 1 else f"repetitions {numbers[0]} to {numbers[-1]} are"
    _log.warning("%s left out: %s", which, lost.reason)
