"""Statistics of an estimator over many repetitions, and the memory and time that these take."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy.stats

from excite.estimates.work_prediction import FLOAT, MemoryPart, WorkPrediction
from excite.identification.estimate import CONFIDENCE
from excite.study.experiment import Experiment
from excite.study.moment_sums import BLOCK, entries_of_equations
from regressors.memory_cap import memory_cap
from regressors.samples import Array


class Repetition(NamedTuple):
    """One repetition."""

    error: Array  # (b,) estimate less true value
    deviation: Array  # (b,) standard deviation that the estimator predicts, from this repetition's residuals
    noise: Array  # (r,) standard deviation of each equation's residuals


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
    def covered(self) -> Array:
        """Whether each 99 % interval holds the true value, shape (R, b)."""
        quantile = scipy.stats.t.ppf(0.5 + CONFIDENCE / 2, self.degrees_of_freedom)
        return np.asarray(np.abs(self.estimates - self.beta) <= quantile * self.predicted)

    @property
    def coverage(self) -> Array:
        """Share of the 99 % intervals that hold the true value, shape (b,)."""
        return np.asarray(np.mean(self.covered, axis=0))


_OF_CHANNEL = 12  # numbers of each instant for each joint, and for each torque or component of the wrench
_COPIES = 4  # of the columns of windows
_FILTERED = 6  # copies of the columns of one equation in the low-pass
_PROGRAMS = 1.2e8  # bytes of compiled models and of libraries that other work does not load
_SHORTER = "repeat a shorter stretch of the log (`rows`)"
_PLAIN = ", or leave out `low_pass`"


def experiment_prediction(experiment: Experiment, processes: int = 0) -> WorkPrediction:
    """Largest memory that the repetitions of an experiment hold at once; it does not grow with their number.

    Columns of single instants are computed in blocks; those of windows and those that are filtered, at once. Where only
    torques are noisy, and for instruments, the columns are held. From once to twice what was measured with 20,000 to
    1,000,000 rows.
    """
    model, N = experiment.model, experiment.samples.time.size
    channels = model.robot.n + (6 if model.channel == "wrench" else model.robot.n)
    remedy = _SHORTER + _PLAIN * (experiment.low_pass is not None)
    entries = entries_of_equations(model, experiment.base.index)
    at_once, held = _at_once(experiment, entries), _held(experiment, entries)
    table = 0 if experiment.method is None else experiment.method.table_width
    own = WorkPrediction(
        "the repetition of the experiment",
        (
            MemoryPart("programs", 1, 1, _PROGRAMS, remedy=remedy),
            MemoryPart("instants", N, channels, FLOAT * _OF_CHANNEL * N * channels, remedy=remedy),
            MemoryPart("instants", N, table, float(FLOAT * N * table), remedy="state fewer `harmonics`"),
            MemoryPart("rows of equations at once", N, at_once / N, FLOAT * at_once, remedy=remedy),
            MemoryPart("rows of equations", N, held / N, FLOAT * held, remedy=remedy),
        ),
    )
    return replace(own, parts=(*own.parts, _of_workers(own, processes))) if processes else own


def _of_workers(own: WorkPrediction, processes: int) -> MemoryPart:
    """What the worker processes hold."""
    part = own.largest
    what = f"{part.what} in each of {processes} worker processes"
    return MemoryPart(what, part.rows, part.columns, processes * own.bytes, "workers", processes)


def fitting_workers(experiment: Experiment) -> int:
    """Number of worker processes that fit into the cap on memory beside this one."""
    own = experiment_prediction(experiment).bytes
    return max(0, int(memory_cap() / own) - 1)


def _at_once(experiment: Experiment, entries: list[int]) -> float:
    """Numbers in the rows of equations that are computed at the same time, and in what they are made of."""
    model, N = experiment.model, experiment.samples.time.size
    if model.window is not None:  # states and densities of all instants, and their integrals
        return float(N * _COPIES * sum(entries))
    if experiment.low_pass is None and experiment.every == 1:
        return float(min(N, BLOCK) * _COPIES * sum(entries))
    return float(N * (sum(entries) + _FILTERED * max(entries)))  # all equations, and one that is filtered


def _held(experiment: Experiment, entries: list[int]) -> float:
    """Numbers in the columns that stay the same in every repetition, and while they are put together once more."""
    held = np.count_nonzero([not experiment.noise.moves, experiment.estimator == "instrumental"])
    return float(experiment.samples.time.size * sum(entries) * (held + 1 if held else 0))


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
