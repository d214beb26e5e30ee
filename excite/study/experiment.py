"""An experiment to be repeated: the true motion, the measurement noise, and how parameters are estimated."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy
from numpy.typing import ArrayLike

from excite.identification.streamed_rows import Decimation
from excite.logs.signals.method import Method, spacing
from excite.study.moments import (
    BLOCK,
    ESTIMATORS,
    EquationColumns,
    JaxMoments,
    Moments,
    MomentSums,
    Part,
    Solved,
    has_gpu,
    has_jax_form,
)
from regressors.errors import InputError, check_names
from regressors.models.base import Base, triangular_factor
from regressors.models.model import RegressorModel
from regressors.samples import Array, Samples


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise of an experiment; a single number applies to every channel."""

    # (c,) standard deviation of white Gaussian noise on each measured torque, or component of the wrench [Nm or N]
    effort: ArrayLike = 0.0
    position: ArrayLike = 0.0  # (n,) of white Gaussian noise on each joint's position [rad or m]
    # (n,) step of each joint's encoder [rad or m]; 0 for none. The phase of the steps is random in every repetition
    count: ArrayLike = 0.0

    def __post_init__(self) -> None:
        for what in ("effort", "position", "count"):
            values = np.asarray(getattr(self, what), dtype=float)
            if not np.all(np.isfinite(values) & (values >= 0)):
                raise InputError(f"noise, {what}: expected finite numbers, zero or more, given {values.tolist()}")
            object.__setattr__(self, what, values)

    @property
    def moves(self) -> bool:
        """True if positions are not measured exactly."""
        return bool(np.any(self.position) or np.any(self.count))

    def spread(self, joints: int, channels: int) -> tuple[Array, Array, Array]:
        """Deviation of the efforts, shape (c,), of the positions and steps of the encoders, shape (n,)."""
        sizes = {"effort": channels, "position": joints, "count": joints}
        for what, size in sizes.items():
            if getattr(self, what).shape not in ((), (1,), (size,)):
                raise InputError(f"noise, {what}: expected 1 number or {size}, given {getattr(self, what).size}")
        effort, position, count = (np.broadcast_to(getattr(self, what), (size,)) for what, size in sizes.items())
        return effort, position, count


def drawn(seed: int, repetition: int, instants: int, joints: int, channels: int) -> tuple[Array, Array, Array]:
    """Random numbers of a repetition: the same for the same seed and number, whatever else is drawn.

    Standard normal ones for efforts, shape (N, c), and positions, (N, n), and the phase of the encoders' steps, (n,).
    """
    rng = np.random.default_rng([seed, repetition])
    phase = rng.random(joints)
    return rng.standard_normal((instants, channels)), rng.standard_normal((instants, joints)), phase


def measured_position(q: Array, normal: Array, phase: Array, deviation: Array, step: Array) -> Array:
    """Positions as an encoder measures them, ``step (round((q + noise) / step + phase) - phase)``, shape (N, n)."""
    # q, normal (N, n); phase, deviation, step (n,)
    noisy = q + deviation * normal
    whole = np.where(step > 0, step, 1.0)
    counted = whole * (np.round(noisy / whole + phase) - phase)
    return np.where(step > 0, counted, noisy)


_SHOWN = 1e-10  # least singular value of an identifiable scaled regressor, relative to the largest


@dataclass(frozen=True, eq=False)
class Experiment:
    """One experiment, from the true motion to the estimate."""

    model: RegressorModel  # model in which the parameters are identified, and with which the true efforts are computed
    base: Base  # its base columns
    samples: Samples  # True motion, N uniform instants
    beta: Array  # (b,) True base parameters
    noise: Noise = field(default_factory=Noise)
    # how velocity and acceleration are obtained from measured positions, with the settings that it chooses for the
    # true ones; without one the regressor is that of the true motion
    method: Method | None = None
    low_pass: float | None = None  # the same low-pass on both sides of the equations [Hz]
    every: int = 1  # decimation factor of the equations, after the low-pass
    estimator: str = "weighted"  # instruments are the regressor of the true motion

    def __post_init__(self) -> None:
        n = self.samples.q.shape[1]
        if n != self.model.robot.n:
            raise InputError(f"experiment: motion of {n} joints for a robot of {self.model.robot.n}")
        if np.shape(self.beta) != (self.base.rank,) or not np.all(np.isfinite(self.beta)):
            raise InputError(f"experiment: expected {self.base.rank} finite parameters, given {np.asarray(self.beta)}")
        check_names("estimator", [self.estimator], ESTIMATORS)
        if self.noise.moves and self.method is None:
            raise InputError("experiment: positions with noise or counts need a method that differentiates them")
        if self.every < 1:
            raise InputError(f"experiment: every must be 1 or more, given {self.every}")
        if self.model.window is not None and (self.low_pass is not None or self.every > 1):
            raise InputError(
                "experiment: low_pass and every are for models of single instants; a "
                "model of windows integrates already"
            )
        spacing(self.samples.time, "an experiment", 3)
        self.noise.spread(n, self.efforts.shape[1])

    @property
    def efforts(self) -> Array:
        """True joint torques or wrench at every instant, shape (N, c) [Nm or N], without measurement noise."""
        model, standard = self.model.instantaneous(), np.zeros(len(self.model.columns))
        standard[self.base.index] = self.beta
        count = self.samples.time.size
        blocks = (self.samples.rows(slice(first, first + BLOCK)) for first in range(0, count, BLOCK))
        return np.concatenate([model.instants(block) @ standard for block in blocks]).reshape(count, -1)


def check_shown(R: Array, rows: int, names: tuple[str, ...]) -> Array:
    """Singular values of the columns scaled to length one, shape (b,)."""  # R (k, b)
    sizes = np.linalg.norm(R, axis=0)
    if np.any(sizes == 0.0):
        raise InputError(f"experiment: {names[int(np.argmin(sizes))]} is not identifiable from the motion")
    if rows <= len(names):
        raise InputError(f"experiment: {rows} rows are too few for {len(names)} parameters and their noise")
    sigma: Array = np.linalg.svd(R / sizes, compute_uv=False)
    if sigma[-1] < _SHOWN * sigma[0]:
        raise InputError(
            f"experiment: not all of {', '.join(names)} are identifiable from the motion; "
            f"condition number of the scaled regressor {sigma[0] / sigma[-1]:.1e}"
        )
    return sigma


_WELL = 1e5  # condition number up to which second moments of the columns are accurate as they are


class Chain:
    """The true motion of an experiment, its equations, and their columns."""

    def __init__(self, experiment: Experiment) -> None:
        self.experiment = experiment
        true, self.efforts = experiment.samples, experiment.efforts
        self.spread = experiment.noise.spread(true.q.shape[1], self.efforts.shape[1])
        self.kept, self.samples = slice(0, true.time.size), true
        if experiment.method is not None:
            self.motion = experiment.method.operator(true.time, true.q)
            motion = self.motion(true.q)
            self.kept, self.samples = motion.kept, motion.samples
        cut, self.decimation = true.rows(self.kept), None
        if experiment.low_pass is not None or experiment.every > 1:
            self.decimation = Decimation.of(cut.time, experiment.low_pass, experiment.every)
        self.columns = EquationColumns(experiment.model, experiment.base.index, self.decimation)
        instruments = self._whole(cut) if experiment.estimator == "instrumental" else None
        self.fixed = None if experiment.noise.moves else self._whole(self.samples)
        y = self._left(self.samples, self.efforts[self.kept])
        self.count, self.sizes = len(y), np.sqrt(np.mean(y**2, axis=0))
        self.rows = y.size
        self.change = self._conditioned(cut)
        beta = np.asarray(experiment.beta, dtype=float)
        self.sums = MomentSums(self.columns.used, beta, self.change, instruments)
        if self.fixed is not None:
            self.shared = self.sums.shared(self._held())
            self.predicted = np.column_stack(
                [beta[used] @ x for x, used in zip(self.fixed, self.columns.used, strict=True)]
            )
        on_gpu = self.fixed is None and has_gpu() and has_jax_form(self.columns)
        self.jax = JaxMoments(self.sums, self.columns) if on_gpu else None

    @property
    def batch(self) -> int:
        """Repetitions that are computed at once."""
        return 1 if self.jax is None else self.jax.batch(self.samples.time.size)

    def repetitions(self, seed: int, numbers: Sequence[int]) -> Iterator[Solved]:
        """Estimates of some repetitions, by their numbers."""
        if self.jax is None:
            moments: Iterable[Array] = (self._moments(*self._measured(seed, number)) for number in numbers)
        else:
            moments = self.jax([self._measured(seed, number) for number in numbers])
        for G in moments:
            yield ESTIMATORS[self.experiment.estimator](Moments(G, self.count, self.sizes))

    def _measured(self, seed: int, number: int) -> tuple[Samples, Array]:
        """Motion that one repetition sees, and its left-hand sides, shape (m, r)."""
        true, (effort, position, step) = self.experiment.samples, self.spread
        normal, of_motion, phase = drawn(seed, number, true.time.size, true.q.shape[1], self.efforts.shape[1])
        samples = self.samples
        if self.experiment.noise.moves:
            motion = self.motion(measured_position(true.q, of_motion, phase, position, step))
            if motion.kept != self.kept:
                name = "" if self.experiment.method is None else f" {self.experiment.method.name!r}"
                raise InputError(
                    f"repetitions: the method{name} keeps other instants with other noise; give its settings"
                )
            samples = motion.samples
        return samples, self._left(samples, (self.efforts + effort * normal)[self.kept])

    def _moments(self, samples: Samples, y: Array) -> Array:
        if self.fixed is None:
            return self.sums.of(self.columns.parts(samples), y)
        return self.sums.with_errors(self.shared, self._held(), y - self.predicted)

    def _left(self, samples: Samples, efforts: Array) -> Array:
        """Left-hand sides y of all rows, shape (m, r)."""
        y = self.experiment.model.right_side(samples, efforts).reshape(-1, len(self.experiment.model.row_labels))
        return y if self.decimation is None else self.decimation(y)

    def _held(self) -> Iterator[Part]:
        """The columns that are the same in every repetition, in blocks of rows."""
        assert self.fixed is not None
        for first in range(0, self.count, BLOCK):
            rows = slice(first, min(first + BLOCK, self.count))
            yield rows, [x[:, rows] for x in self.fixed]

    def _whole(self, samples: Samples) -> list[Array]:
        """Transposed columns of each equation, of all rows."""
        pieces = zip(*(X for _, X in self.columns.parts(samples)), strict=True)
        return [np.concatenate(each, axis=1) for each in pieces]

    def _conditioned(self, true: Samples) -> Array | None:
        """Matrix P that makes the moments of columns accurate; None where that changes little."""
        names = self.experiment.base.names
        check_shown(self._factor(self.columns.parts(true)), self.rows, names)
        R = self._factor(self.columns.parts(self.samples) if self.fixed is None else self._held())
        sigma = check_shown(R, self.rows, names)
        return None if sigma[0] <= _WELL * sigma[-1] else np.asarray(scipy.linalg.solve_triangular(R, np.eye(len(R))))

    def _factor(self, parts: Iterable[Part]) -> Array:
        """Triangular factor of all columns."""
        b = self.experiment.base.rank
        R = np.zeros((0, b))
        for _, X in parts:
            for x, used in zip(X, self.columns.used, strict=True):
                W = np.zeros((x.shape[1], b))
                W[:, used] = x.T
                R = triangular_factor(np.concatenate([R, W]))
        return R
