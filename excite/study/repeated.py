"""Repetitions of an experiment through the whole chain, in little memory, on several processes, resumed."""

from __future__ import annotations

import hashlib
import json
import logging
import time
import zipfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing, nullcontext
from dataclasses import dataclass
from functools import cached_property, partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from excite.design.interruption import current_interruption
from excite.design.problem_identity import PACKAGES, NotComparable, plain_value
from excite.errors import LostWorkersError
from excite.estimates.work_prediction import announce
from excite.executors.dask_cluster import DaskCluster
from excite.executors.dask_starts import check_versions
from excite.executors.unit_executor import SHORT, InProcesses, InThisProcess, LostUnit, UnitExecutor, Work
from excite.executors.unit_executors import unit_executor
from excite.identification.repetition_count import repetition_prediction
from excite.storage.atomic import replacing
from excite.study.batch_estimators import Solved
from excite.study.experiment import Chain, Experiment
from excite.study.jax_moments import has_gpu
from excite.study.repetitions import Repetition, Repetitions, experiment_prediction, fitting_workers, repetition_seconds
from regressors.errors import InputError
from regressors.input_files import LOG, opened
from regressors.numerical import numerical_work
from regressors.quantities import check

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


_EVERY = 5.0  # seconds between two writes

_UNREADABLE = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile)


class KeptRepetitions:
    """A file with the repetitions of an experiment that are computed."""

    def __init__(self, path: Path, common: SeededExperiment) -> None:
        self.path, self._identity = path, _identity(common)
        self._next = time.monotonic() + _EVERY

    def read(self, count: int) -> dict[int, Repetition]:
        """Repetitions of numbers below ``count`` that are in the file; none where there is no file."""
        if not self._identity or not self.path.exists():
            return {}
        try:
            with opened(self.path, LOG) as stream, np.load(stream, allow_pickle=False) as content:
                identity, numbers = str(content["identity"]), content["number"].tolist()
                rows = zip(content["error"], content["deviation"], content["noise"], strict=True)
                found = {number: Repetition(*row) for number, row in zip(numbers, rows, strict=True)}
        except _UNREADABLE:
            _log.warning("%s cannot be read; its repetitions are computed again", self.path)
            return {}
        if identity != self._identity:
            _log.warning("%s is of another experiment, and is replaced", self.path)
            return {}
        found = {number: one for number, one in found.items() if number < count}
        _log.info("%d of %d repetitions are already done in %s", len(found), count, self.path)
        return found

    def save(self, repetitions: Mapping[int, Repetition], *, now: bool = False) -> bool:
        """Write them, not more often than every few seconds if not ``now``; say whether they can be used later."""
        if not self._identity or not repetitions:
            return False
        if now or time.monotonic() >= self._next:
            error, deviation, noise = (np.array(part) for part in zip(*repetitions.values(), strict=True))
            identity, number = np.array(self._identity), np.array(list(repetitions))
            with replacing(self.path, "wb") as stream:
                np.savez(stream, identity=identity, number=number, error=error, deviation=deviation, noise=noise)
            self._next = time.monotonic() + _EVERY
        return True

    def remove(self) -> None:
        """Remove the file."""
        self.path.unlink(missing_ok=True)


def _identity(common: SeededExperiment) -> str:
    """Hash of what repetitions depend on; empty where a later process could not tell whether it is the same."""
    try:
        content = [plain_value(common.experiment), common.seed, {name: version(name) for name in PACKAGES}]
    except NotComparable:
        return ""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
