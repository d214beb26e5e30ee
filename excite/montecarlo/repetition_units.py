"""Repetitions as units of work: ranges of their numbers, and what runs these."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from importlib.metadata import version
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from excite.design.problem_identity import PACKAGES
from excite.executors.dask_cluster import DaskCluster
from excite.executors.dask_starts import check_versions
from excite.executors.in_processes import SHORT, InProcesses
from excite.executors.unit_executor import InThisProcess, UnitExecutor
from excite.executors.unit_executors import unit_executor
from excite.montecarlo.batch_estimators import Solved
from excite.montecarlo.chain import Chain
from excite.montecarlo.experiment import Experiment
from excite.montecarlo.jax_moments import has_gpu
from excite.montecarlo.repetition_memory import experiment_prediction, fitting_workers
from excite.montecarlo.repetition_time import repetition_seconds
from excite.montecarlo.repetitions import Repetition
from regressors.numerical import numerical_work

_UNIT = 0.1  # seconds of a unit

numerical_repetition = partial(
    numerical_work,
    "the repetition of the experiment",
    "rows that hardly move, or numbers of very different sizes are the likely cause: "
    "check the units of the log and `rows`",
)


@dataclass(frozen=True, eq=False)
class SeededExperiment:
    """What all repetitions of an experiment have in common, in whatever process they are computed."""

    experiment: Experiment
    seed: int
    versions: dict[str, str]  # packages that a process elsewhere must have in the same version

    @cached_property
    def chain(self) -> Chain:
        """Built once per process; a forked one inherits it."""
        check_versions(self.versions)
        with threadpool_limits(1):
            return Chain(self.experiment)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "chain"}


@numerical_repetition()
def repeat_numbers(common: SeededExperiment, numbers: range) -> list[Repetition]:
    """Repetitions of some numbers."""
    return [_repetition(common.chain, solved) for solved in common.chain.repetitions(common.seed, numbers)]


def _repetition(chain: Chain, solved: Solved) -> Repetition:
    P = np.eye(solved.error.size) if chain.change is None else chain.change
    return Repetition(P @ solved.error, np.linalg.norm(P @ solved.half, axis=1), solved.noise)


def repeat_in_one_thread(common: SeededExperiment, numbers: range) -> list[Repetition]:
    """The same where linear algebra may have more threads, which add in another order."""
    with threadpool_limits(1):
        return repeat_numbers(common, numbers)


def executor_of_repetitions(
    given: str | UnitExecutor, workers: int | None, experiment: Experiment, count: int
) -> UnitExecutor:
    """What runs the repetitions of an experiment; memory is checked for the processes that it has here."""
    executor = unit_executor(given, workers)
    experiment_prediction(experiment).check()
    if given == "process" and isinstance(executor, InProcesses):
        most = fitting_workers(experiment) if workers is None else executor.count
        executor = InProcesses(max(1, min(executor.count, most, count)))
        if executor.count == 1 or has_gpu() or repetition_seconds(experiment, count) < SHORT:
            return InThisProcess()
    experiment_prediction(experiment, processes_here(executor)).check()
    return executor


def processes_here(executor: UnitExecutor) -> int:
    """Worker processes that an executor starts on this machine."""
    if isinstance(executor, DaskCluster):
        return executor.processes_here
    return executor.count if isinstance(executor, InProcesses) else 0


def common_of(executor: UnitExecutor, experiment: Experiment, seed: int) -> SeededExperiment:
    """What an executor's processes need; those elsewhere must have this one's versions."""
    versions = {} if executor.shares_disk else {name: version(name) for name in PACKAGES}
    return SeededExperiment(experiment, seed, versions)


def units_of(executor: UnitExecutor, common: SeededExperiment, numbers: Sequence[int]) -> list[range]:
    """Ranges of ascending numbers: here what is computed at once, elsewhere about `_UNIT` seconds of work each."""
    at_once = common.chain.batch  # built, and its errors raised, before processes start, which inherit it if forked
    elsewhere = max(1, int(_UNIT / repetition_seconds(common.experiment, 1)))
    size = at_once if isinstance(executor, InThisProcess) else elsewhere
    gaps = np.flatnonzero(np.diff(numbers) > 1) + 1
    return [
        range(first, min(first + size, run[-1] + 1))
        for run in np.split(np.asarray(numbers, dtype=int), gaps)
        for first in range(run[0], run[-1] + 1, size)
    ]
