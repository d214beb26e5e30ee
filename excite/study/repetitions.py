"""Repetitions of an experiment or of an identification: in little memory, on several processes, resumed."""

from __future__ import annotations

import hashlib
import json
import logging
import time
import zipfile
from collections.abc import Mapping, Sequence
from contextlib import closing, nullcontext
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from excite.design.executors.dask_cluster import DaskCluster, check_versions, unit_executor, versions_of
from excite.design.executors.unit_executor import SHORT, InProcesses, InThisProcess, LostUnit, UnitExecutor
from excite.design.interruption import signal_answered
from excite.design.problem_identity import NotComparable, package_versions, plain_value
from excite.errors import LostWorkersError
from excite.identification.equations import predicted_rows
from excite.identification.estimator import CONFIDENCE
from excite.identification.identification import Identification
from excite.identification.preparation import chosen_method
from excite.identification.recipe import check_estimates, not_repeated
from excite.logs.signals.filters import decimation
from excite.logs.signals.method import delayed, resample
from excite.logs.signals.periods import mean_rate
from excite.storage.atomic import replacing
from excite.study.experiment import Chain, Experiment, Noise
from excite.study.moments import BLOCK, entries_of_equations, has_gpu
from regressors.errors import InputError
from regressors.input_files import LOG, opened
from regressors.numerical import numerical_work, one_thread
from regressors.quantities import check
from regressors.samples import Array
from regressors.work_prediction import FLOAT, Steps, announce, check_memory, memory_cap


def experiment_of(result: Identification, count: int) -> Experiment:
    """The experiment of the first log with the estimate as the truth, to be repeated so many times.

    The true motion is the filtered motion of the log; the noise of positions is what was filtered out of them, the
    noise of torques the residual of the estimate at every instant, both taken as white. Friction has the sign of the
    velocity, smoothed over the sign width if there is one; presliding over a distance is left out.
    """
    if result.friction is not None:
        raise not_repeated()
    recipe, part, model = result.recipe, result.prepared[0], result.target.model
    recipe.check_repeatable(count)
    result.robot.check_open("the repetition of an identification")
    uniform = resample(part.log).log  # what the method chooses for the log, it keeps
    chosen = 1 if recipe.low_pass is None else decimation(mean_rate(part.samples.time), recipe.low_pass)
    return Experiment(
        model=model,
        base=result.target.base,
        samples=part.samples,
        beta=result.estimate.coefficients,
        noise=Noise(effort=effort_noise(result), position=position_noise(result)),
        method=chosen_method(recipe).settled(uniform.time, uniform.q),
        low_pass=recipe.low_pass,
        every=recipe.every or chosen,
        estimator=str(recipe.estimator),
    )


def effort_noise(result: Identification) -> Array:
    """Standard deviation of the residuals of the first log's torques, or wrench, shape (r,) [Nm or N].

    At every instant and before any low-pass, whatever the equations of the identification were. From the median
    magnitude, since large errors at a few sign changes of friction are not noise.
    """
    target = result.target_of_instants
    part, model = result.prepared[0], target.model
    predicted = predicted_rows(target, part.samples, result.recipe, result.estimate.coefficients)
    left = model.right_side(part.samples, part.measured).reshape(predicted.shape) - predicted
    magnitude = np.median(np.abs(left), axis=0)
    return np.asarray(magnitude / scipy.special.ndtri(0.75))


def position_noise(result: Identification) -> Array:
    """Standard deviation of the noise filtered out of the first log's positions, shape (n,) [rad or m]."""
    part = result.prepared[0]
    delay, log = result.recipe.delay_of(part.log.source), part.log
    samples = delayed(part.samples, -delay)  # as the positions were recorded, but for the ends
    within = (log.time >= samples.time[0] + abs(delay)) & (log.time <= samples.time[-1] - abs(delay))
    smooth = np.column_stack([np.interp(log.time[within], samples.time, q) for q in samples.q.T])
    return np.asarray(np.std(log.q[within] - smooth, axis=0))


_UNIT = 0.1  # seconds of a unit

LIKELY_CAUSE = (
    "rows that hardly move, or numbers of very different sizes are the likely cause: "
    "check the units of the log and `rows`"
)
numerical_repetition = partial(numerical_work, "the repetition of the experiment", LIKELY_CAUSE)


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
        with one_thread():
            return Chain(self.experiment)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "chain"}


@numerical_repetition()
def repeat_numbers(common: SeededExperiment, numbers: range) -> list[Repetition]:
    """Repetitions of some numbers."""
    P = np.eye(common.experiment.base.rank) if common.chain.change is None else common.chain.change
    solved = common.chain.repetitions(common.seed, numbers)
    return [(P @ error, np.linalg.norm(P @ half, axis=1), noise) for error, half, noise in solved]


def repeat_in_one_thread(common: SeededExperiment, numbers: range) -> list[Repetition]:
    """The same where linear algebra may have more threads, which add in another order."""
    with one_thread():
        return repeat_numbers(common, numbers)


def executor_of_repetitions(
    given: str | UnitExecutor, workers: int | None, experiment: Experiment, count: int
) -> UnitExecutor:
    """What runs the repetitions of an experiment; memory is checked for the processes that it has here."""
    executor, size = unit_executor(given, workers), bytes_of_process(experiment)
    if given == "process" and isinstance(executor, InProcesses):
        fitting = int(memory_cap() / size) - 1  # beside this process
        most = fitting if workers is None else executor.count
        executor = InProcesses(max(1, min(executor.count, most, count)))
        if executor.count == 1 or has_gpu() or repetition_seconds(experiment, count) < SHORT:
            executor = InThisProcess()
    processes, rows = processes_here(executor), f"a log of {experiment.samples.time.size} rows"
    what = f"{rows} in {processes} worker processes" if processes else rows
    remedy = "repeat a shorter stretch of the log (`rows`)" + ", or lower `workers`" * bool(processes)
    check_memory("the repetition of the experiment", (1 + processes) * size, what, remedy)
    return executor


def processes_here(executor: UnitExecutor) -> int:
    """Worker processes that an executor starts on this machine."""
    if isinstance(executor, DaskCluster):
        return executor.processes_here
    return executor.count if isinstance(executor, InProcesses) else 0


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
FEWEST = 2  # repetitions that have a scatter
_log = logging.getLogger(__name__)


@numerical_repetition()
def repeat_experiment(
    experiment: Experiment,
    count: int,
    seed: int,
    progress: Steps | None = None,
    *,
    executor: str | UnitExecutor = "process",
    workers: int | None = None,
    kept: str | Path | None = None,
) -> Repetitions:
    """Estimates from repetitions with different noise."""
    check("repeats", count)
    check("seed", seed)
    if count < FEWEST:
        raise InputError(f"repetitions: expected {FEWEST} or more, given {count}")
    units = executor_of_repetitions(executor, workers, experiment, count)
    check_estimates(count, experiment.base.rank)
    announce("the repetitions", repetition_seconds(experiment, count) / max(1, processes_here(units)), _ENDED)
    common = SeededExperiment(experiment, seed, versions_of(units))
    # a process that limits its threads could not be forked
    with one_thread() if isinstance(units, InThisProcess) else nullcontext():
        file = KeptRepetitions(None if kept is None else Path(kept), common)
        found, interrupted = _repeated(units, common, count, file, progress or (lambda *_: None))
    base, beta = experiment.base, np.asarray(experiment.beta, dtype=float)
    error, deviation, noise = (np.array(part) for part in zip(*(found[k] for k in sorted(found)), strict=True))
    freedom = common.chain.rows - base.rank
    return Repetitions(base.names, base.units, beta, beta + error, deviation, noise, freedom, seed, interrupted)


def _repeated(
    executor: UnitExecutor, common: SeededExperiment, count: int, kept: KeptRepetitions, progress: Steps
) -> tuple[dict[int, Repetition], bool]:
    """Repetitions by number, those that are kept and those that are computed until Ctrl-C; and whether that came."""
    found, interrupted = kept.read(count), False
    left = [number for number in range(count) if number not in found]
    units = units_of(executor, common, left) if left else []
    work = repeat_numbers if isinstance(executor, InThisProcess) else repeat_in_one_thread
    try:
        with closing(executor.run(work, common, units)) as results:
            for index, result in results:
                if isinstance(result, LostUnit):
                    _log.warning("%s left out: %s", _named(units[index]), result.reason)
                    continue
                found.update(zip(units[index], result, strict=True))
                kept.save(found)
                progress(len(found), count)
    except KeyboardInterrupt:
        kept.save(found, now=True)
        if len(found) < FEWEST:
            raise
        interrupted = True
        signal_answered()
    except LostWorkersError as error:
        remedy = "repeat with fewer `workers`, or with another `executor`"
        if kept.save(found, now=True):
            done = f"{len(found)} of {count} repetitions"
            remedy = f"{done} are kept in {kept.path}, and the same call computes the rest"
        raise LostWorkersError(error.args[0], remedy) from error
    check_enough(len(found), count)
    if not interrupted:
        kept.remove()
    return found, interrupted


def _named(numbers: range) -> str:
    return f"repetitions {numbers[0]} to {numbers[-1]} are" if len(numbers) > 1 else f"repetition {numbers[0]} is"


def check_enough(left: int, count: int) -> None:
    """Raise `InputError` where too few repetitions are left to scatter."""
    if left < FEWEST:
        raise InputError(
            f"repetitions: {left} of {count} are left, since workers ended; repeat with fewer `workers`, or with "
            "another `executor`"
        )


_EVERY = 5.0  # seconds between two writes

_UNREADABLE = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile)


class KeptRepetitions:
    """A file with the repetitions of an experiment that are computed; without a path none are kept."""

    def __init__(self, path: Path | None, common: SeededExperiment) -> None:
        self.path, self._identity = path, "" if path is None else _identity(common)
        self._next = time.monotonic() + _EVERY

    def read(self, count: int) -> dict[int, Repetition]:
        """Repetitions of numbers below ``count`` that are in the file; none where there is no file."""
        if self.path is None or not self._identity or not self.path.exists():
            return {}
        try:
            with opened(self.path, LOG) as stream, np.load(stream, allow_pickle=False) as content:
                identity, numbers = str(content["identity"]), content["number"].tolist()
                rows = zip(content["error"], content["deviation"], content["noise"], strict=True)
                found = dict(zip(numbers, rows, strict=True))
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
        if self.path is None or not self._identity or not repetitions:
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
        if self.path is not None:
            self.path.unlink(missing_ok=True)


def _identity(common: SeededExperiment) -> str:
    """Hash of what repetitions depend on; empty where a later process could not tell whether it is the same."""
    try:
        content = [plain_value(common.experiment), common.seed, package_versions()]
    except NotComparable:
        return ""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


#: One repetition: the estimate less the true value, (b,); the standard deviation that the estimator predicts from this
#: repetition's residuals, (b,); and the standard deviation of each equation's residuals, (r,).
Repetition = tuple[Array, Array, Array]


@dataclass(frozen=True, eq=False)
class Repetitions:
    """Estimates of the same b parameters in R repetitions of an experiment."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    beta: Array  # (b,) True values
    estimates: Array  # (R, b)
    # (R, b) standard deviation that the estimator predicts in each repetition, from that repetition's residuals
    predicted: Array
    noise: Array  # (R, r) standard deviation of each equation's residuals
    degrees_of_freedom: int  # of Student's t for the intervals
    seed: int
    interrupted: bool = False  # whether Ctrl-C ended the repetitions before the last one

    @property
    def count(self) -> int:
        """Number of repetitions, R."""
        return len(self.estimates)

    @property
    def deviation(self) -> Array:
        """Sample standard deviation of the estimates, shape (b,)."""
        return np.asarray(np.std(self.estimates, axis=0, ddof=1))

    @property
    def predicted_deviation(self) -> Array:
        """Root mean square of the predicted deviations, shape (b,)."""
        return np.asarray(np.sqrt(np.mean(self.predicted**2, axis=0)))

    @property
    def bias(self) -> Array:
        """Mean error, shape (b,)."""
        return np.asarray(np.mean(self.estimates - self.beta, axis=0))

    @property
    def bias_error(self) -> Array:
        """Standard deviation of `bias`, shape (b,)."""
        return np.asarray(self.deviation / np.sqrt(self.count))

    @property
    def coverage(self) -> Array:
        """Share of the 99 % intervals that hold the true value, shape (b,)."""
        quantile = scipy.special.stdtrit(self.degrees_of_freedom, 0.5 + CONFIDENCE / 2)
        return np.asarray(np.mean(np.abs(self.estimates - self.beta) <= quantile * self.predicted, axis=0))


_OF_CHANNEL = 12  # numbers of each instant for each joint, and for each torque or component of the wrench
_COPIES = 6  # of the columns of the equations
_PROGRAMS = 2.6e8  # bytes of a process with compiled models


def bytes_of_process(experiment: Experiment) -> float:
    """About what the repetitions of an experiment hold at once in a process; it does not grow with their number.

    Columns of single instants are computed in blocks; those of windows, those that are filtered, and those that are the
    same in all repetitions or are instruments, at once.
    """
    model, N, estimator = experiment.model, experiment.samples.time.size, experiment.estimator
    whole = model.window or experiment.low_pass or experiment.every > 1
    whole = whole or not experiment.noise.moves or estimator == "instrumental"
    channels = model.robot.n + (6 if model.channel == "wrench" else model.robot.n)
    columns = (N if whole else min(N, BLOCK)) * sum(entries_of_equations(model, experiment.base.index))
    table = 0 if experiment.method is None else experiment.method.table_width
    return _PROGRAMS + FLOAT * (N * (_OF_CHANNEL * channels + table) + _COPIES * columns)


_EACH = 2e-3  # seconds of a repetition, however short
_PLAIN_SECONDS, _WHOLE = 3e-8, 8e-8  # seconds of a row and pair of joints; of windows, or with a low-pass


def repetition_seconds(experiment: Experiment, count: int) -> float:
    """Time of some repetitions on one core [s]; right within a factor of three.

    The unit that it grows with is a number of the regressor: rows times joints times joints. Measured with 300 to
    20,000 rows of 3 to 7 joints; fewer than 8000 rows with a low-pass took up to five times as long.
    """
    joints, rows = experiment.model.robot.n, experiment.samples.time.size
    whole = experiment.model.window is not None or experiment.low_pass is not None
    return float(count * (_EACH + (_WHOLE if whole else _PLAIN_SECONDS) * rows * joints**2))
