"""Half-widths after several runs of one motion, and the fewest runs that meet a precision target.

Information adds, so that n runs of a motion with covariance C leave ``C / n``, and ``(n C^-1 + P)^-1`` after earlier
experiments with the information P; their rows also settle the estimate of the noise, see
`excite.information.half_widths`.

Friction may hold a drive near standstill, so that identification leaves rows of slow drives out, and allows for the
change d of the estimate without those of twice that speed [`excite.identification.biases`]. With V(v) of the rows in
which every drive is faster than v times the typical speed, or its own where that is less, the variance of d is
``V(2 v) - V(v)`` [Hausman 1978], and

    C = V(v) + chi2(p, 1) (V(2 v) - V(v))

is exceeded by no parameter's ``V(v) + d d'`` with probability p.

A sensor of torque may have an offset o, of variance one in the columns G beforehand, which a model without offsets
lacks. It changes the estimate by ``R o`` with ``R = -W^+ G``, and n runs leave it known by ``P = (1 + n S)^-1`` with
``S = G'(1 - W W^+)G``. Identification adds ``R (m m' + P) R'`` with its mean m [`excite.identification.biases`], where
``E(m m') = P n S P`` if there is no offset: counted is ``R (P + chi2(p, 1) P n S P) R'``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import scipy

from excite.information.earlier_precision import InformationInHand
from excite.information.half_widths import (
    BIAS_SHARE,
    OFFSET_SHARE,
    TorquePrecision,
    allowed_half_widths,
    half_width_factor,
    residual_degrees_of_freedom,
    torque_precision,
)
from excite.information.prior import prior_of
from excite.information.target import IdentificationTarget, inverse_half, least_speeds, typical_speed, usual_speeds
from excite.storage.codec import INLINE, Beside, named
from excite.tasks.precision_target import PrecisionTarget
from regressors.errors import InputError
from regressors.numerical import column_lengths, or_none
from regressors.robot.columns import OFFSET
from regressors.samples import Array, Samples

_MOST_RUNS = 10**9
SLOW = 0.2  # of the typical speed: rows of slower drives are not counted on
_WORTH = 1.05  # times narrower, from which a change is said to help


@dataclass(frozen=True)
class ParameterPrecision:
    """Half-width of one base parameter's confidence interval, or of the error of a joint's torque on a task motion."""

    name: str
    unit: str
    half_width: float  # predicted, after all runs
    allowed: float | None  # the largest that meets the target; None where nothing is asked

    @property
    def use(self) -> float:
        """Half-width over the allowed one; zero where nothing is asked."""
        return 0.0 if self.allowed is None else self.half_width / self.allowed


@dataclass(frozen=True)
class PrecisionForecast:
    """What a number of runs is predicted to reach.

    Parameters
    ----------
    runs : int
    seconds : float
        Robot time of one run, with approach and return where there are any [s].
    level, probability : float
        Of the intervals; with which none is wider.
    parameters : tuple of ParameterPrecision
    """

    beside: ClassVar[Beside] = {"met": lambda each: each.met, "robot_seconds": lambda each: each.robot_seconds}

    runs: int
    seconds: float = field(metadata=named("seconds_per_run"))
    level: float
    probability: float
    parameters: tuple[ParameterPrecision, ...]

    @property
    def robot_seconds(self) -> float:
        """Robot time of all runs [s]."""
        return self.runs * self.seconds

    @property
    def worst(self) -> ParameterPrecision:
        """The parameter that comes nearest to its allowed half-width, or exceeds it most."""
        return max(self.parameters, key=lambda parameter: parameter.use)

    @property
    def met(self) -> bool:
        """Whether no half-width exceeds the allowed one."""
        return self.worst.use <= 1.0

    @property
    def too_wide(self) -> tuple[ParameterPrecision, ...]:
        """Parameters whose half-width exceeds the allowed one, worst first."""
        return tuple(sorted((p for p in self.parameters if p.use > 1.0), key=lambda p: -p.use))


_TOO_SLOW = (
    "no precision can be promised for this motion: its rows in which all drives that act on a joint are faster than "
    f"{2 * SLOW:g} of their typical speed do not determine all parameters, and what friction does near standstill "
    "would decide on the others; let coupled drives move at the same time, or leave `precision` out"
)


@dataclass(frozen=True, eq=False)
class RunInformation:
    """Information of one run against a precision target.

    Parameters
    ----------
    target : IdentificationTarget
    precision : PrecisionTarget
    half : ndarray, shape (b, b)
        H with the covariance ``H H'`` of one run, for the stated noise.
    rows : int
        Equations of one run.
    seconds : float
        Robot time of one run [s].
    in_hand : InformationInHand, optional
        Of earlier experiments.
    offsets : (ndarray, ndarray), shapes (b, k) and (k, k), optional
        R and S of the offsets that measured torques may have.
    """

    target: IdentificationTarget
    precision: PrecisionTarget
    half: Array
    rows: int
    seconds: float
    in_hand: InformationInHand | None = None
    offsets: tuple[Array, Array] | None = None

    @classmethod
    def of(
        cls,
        precision: PrecisionTarget,
        target: IdentificationTarget,
        samples: Samples,
        noise: Array,
        seconds: float,
        in_hand: InformationInHand | None = None,
    ) -> RunInformation:
        """Of a motion, at the instants that the model requires, for the noise of each equation."""
        W = target.model.assemble(samples)[:, target.base.index]
        sigma = np.tile(noise, W.shape[0] // noise.size)[:, None]
        W, G = W / sigma, _likely_offsets(target, samples) / sigma
        rows = W.shape[0]
        if target.model.torque_equations() is None or target.model.coulomb_friction() is None:
            return cls(target, precision, inverse_half(W), rows, seconds, in_hand, _offsets(target, W, G))
        usual, typical = usual_speeds(target.robot, [samples]), typical_speed(target.robot, [samples])
        least = least_speeds(target, samples, np.minimum(usual, typical)).ravel()  # a slower drive by its own speed
        A, fast = (rows / column_lengths(W) for rows in (W, W[least >= 2.0 * SLOW]))
        if np.linalg.matrix_rank(fast.T @ fast, hermitian=True) < np.linalg.matrix_rank(A.T @ A, hermitian=True):
            raise InputError(_TOO_SLOW)
        near, far = (H @ H.T for H in (inverse_half(W[least >= share]) for share in (SLOW, 2.0 * SLOW)))
        chi2 = scipy.special.chdtri(1, 1.0 - precision.probability)
        C = (1.0 - chi2) * near + chi2 * far
        size = np.sqrt(np.diag(C))
        values, vectors = np.linalg.eigh(C / np.outer(size, size))
        half = size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
        kept = least >= SLOW
        offsets = _offsets(target, W[kept], G[kept])
        return cls(target, precision, half, int(np.count_nonzero(kept)), seconds, in_hand, offsets)

    @cached_property
    def torques(self) -> TorquePrecision | None:
        """The torques along the task motion, where there is one."""
        asked = self.precision.torques
        return None if asked is None else torque_precision(asked, self.target)

    @cached_property
    def allowed(self) -> Array:
        """Largest half-widths of the parameters, infinite if nothing is asked, and of the torques of a task motion."""
        allowed = allowed_half_widths(self.precision, self.target)
        return allowed if self.torques is None else np.append(allowed, self.torques.allowed)

    @cached_property
    def deviation(self) -> Array:
        """Standard deviations after one run by noise alone, in the order of `allowed`."""
        return self._deviations(self.half)

    def _deviations(self, half: Array) -> Array:
        deviation = np.asarray(np.linalg.norm(half, axis=1))
        return deviation if self.torques is None else np.append(deviation, self.torques.deviations(half))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of what has a half-width."""
        return (*self.target.base.names, *(() if self.torques is None else self.torques.names))

    @property
    def units(self) -> tuple[str, ...]:
        """Their units."""
        return (*self.target.base.units, *(() if self.torques is None else self.torques.units))

    def half_widths(self, runs: int) -> Array:
        """Half-widths after a number of runs, in the order of `allowed`."""
        half = self.half / math.sqrt(runs)
        if self.in_hand is not None:
            half = inverse_half(np.vstack([self.in_hand.R, math.sqrt(runs) * np.linalg.pinv(self.half)]))
        return np.asarray(self._factor(runs) * self._deviations(np.hstack([half, self._by_offsets(runs)])))

    def _by_offsets(self, runs: int) -> Array:
        """Factor of what offsets add to the covariance after a number of runs, shape (b, k)."""
        if self.offsets is None:
            return np.zeros((self.target.base.rank, 0))
        R, S = self.offsets
        known, vectors = np.linalg.eigh(runs * S)
        left = 1.0 / (1.0 + np.maximum(known, 0.0))
        chi2 = scipy.special.chdtri(1, 1.0 - self.precision.probability)
        return np.asarray(R @ vectors * np.sqrt(left + chi2 * left * (1.0 - left)))

    def use(self, runs: int) -> float:
        """Largest half-width over the allowed one after a number of runs."""
        return float(np.max(self.half_widths(runs) / self.allowed))

    def fewest_runs(self) -> int:
        """The fewest runs that meet the target, at least one, or 1e9 where more do not help."""
        low, high = 0, 1
        while self.use(high) > 1.0:
            if high >= _MOST_RUNS:
                return _MOST_RUNS
            low, high = high, 2 * high
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if self.use(middle) > 1.0 else (low, middle)
        return high

    def forecast(self, max_time: float) -> PrecisionForecast:
        """Of the fewest runs that meet the target, or of as many as a robot time leaves room for, at least one."""
        runs = min(self.fewest_runs(), max(1, math.floor(max_time / self.seconds)))
        each = zip(self.names, self.units, self.half_widths(runs), self.allowed, strict=True)
        parameters = tuple(ParameterPrecision(name, unit, float(h), or_none(a)) for name, unit, h, a in each)
        return PrecisionForecast(runs, self.seconds, self.precision.level, self.precision.probability, parameters)

    def _factor(self, runs: int) -> float:
        equations = len(self.target.model.row_labels)
        f = residual_degrees_of_freedom(float(runs) * self.rows, self.target.base.rank, equations)
        f += 0 if self.in_hand is None else self.in_hand.degrees_of_freedom
        return half_width_factor(f, level=self.precision.level, probability=self.precision.probability)


def _likely_offsets(target: IdentificationTarget, samples: Samples) -> Array:
    """Offsets of the measured torques, as large as they may be, in the rows, shape (m, k).

    Their size is a share of the described torques; of what is not described it is zero.
    """
    model, base = target.model, target.base
    values = np.nan_to_num(prior_of(model, base, None).base_values(np.eye(base.rank)))
    labels = model.instantaneous().row_labels
    torques = (model.instantaneous().instants(samples)[:, base.index] @ values).reshape(-1, len(labels))
    size = OFFSET_SHARE * np.sqrt(np.mean(torques**2, axis=0))
    if model.channel == "wrench":  # of a force and of a moment
        units = np.array([unit for _, unit in labels])
        size = BIAS_SHARE / OFFSET_SHARE * np.sqrt((units[:, None] == units) @ size**2)
    if model.window is None:
        return np.tile(np.diag(size), (len(torques), 1))
    each = (np.broadcast_to(row, torques.shape) for row in np.diag(size))
    return np.column_stack([model.right_side(samples, signal) for signal in each])


_SHOWN = 1e-6  # of a column's length that the parameters do not explain


def _offsets(target: IdentificationTarget, W: Array, G: Array) -> tuple[Array, Array]:
    """R and S of columns beside those of the parameters, without those that are offsets among these."""
    own = W[:, [k for k, index in enumerate(target.base.index) if target.base.columns[int(index)].kind == OFFSET]]
    kept = np.linalg.norm(G - own @ np.linalg.lstsq(own, G)[0], axis=0) > _SHOWN * np.linalg.norm(G, axis=0)
    by_parameters = np.linalg.lstsq(W, G)[0]
    left = G - W @ by_parameters
    return np.asarray(-by_parameters[:, kept]), np.asarray(left[:, kept].T @ left[:, kept])


@dataclass(frozen=True)
class FrontPoint:
    """An experiment than which none that was tried is both shorter and more precise."""

    period: float  # [s]
    runs: int
    robot_seconds: float
    use: float  # largest half-width over the allowed one: 1 meets the target just so, 2 a target twice as wide


@dataclass(frozen=True)
class TriedPeriod:
    """The best motion of one period."""

    period: float  # [s]
    richness: int = field(metadata=named("harmonics"))  # their number, or what the family has instead
    seconds: float = field(metadata=named("seconds_per_run"))  # with approach and return [s]
    runs: int  # the fewest that meet the target
    robot_seconds: float  # of these runs [s]
    use: float = field(metadata=named("use_of_one_run"))  # largest half-width over the allowed one
    course: tuple[tuple[int, float], ...]  # numbers of runs, and the same after them


@dataclass(frozen=True)
class TooWide:
    """A parameter whose half-width stays too large."""

    name: str
    unit: str
    half_width: float  # after as many runs as the robot time leaves room for
    allowed: float
    # parameters that it moves with, and the correlation of the estimates, the closest first
    together: tuple[tuple[str, float], ...]

    @property
    def text(self) -> str:
        """By how much it is too wide, and what it moves with."""
        partners = ", ".join(f"{name} ({correlation:+.2f})" for name, correlation in self.together)
        moves = f"moves together with {partners}" if partners else "moves with no other parameter"
        return f"{self.name}: {self.half_width / self.allowed:.3g} times the allowed half-width, {moves}"


@dataclass(frozen=True)
class SeparationTrial:
    """One change of the problem, tried."""

    change: str
    narrower: float  # factor by which the widest half-width, relative to the allowed one, becomes narrower
    robot_seconds: float  # robot time in which the target would be met then [s]


@dataclass(frozen=True)
class OutOfReach:
    """What keeps a precision out of reach."""

    parameters: tuple[TooWide, ...]  # the widest first
    robot_seconds: float  # robot time in which more runs of the same motion would meet the target [s]
    trials: tuple[SeparationTrial, ...]  # what was tried, the one that helps most first

    @property
    def best(self) -> SeparationTrial | None:
        """The change that helps most; None if none does."""
        return self.trials[0] if self.trials and self.trials[0].narrower > _WORTH else None


@dataclass(frozen=True)
class PrecisionSearch:
    """A search for the shortest experiment that meets a precision.

    Parameters
    ----------
    asked : mapping
        The target, see `PrecisionTarget.to_dict`.
    noise : tuple of float
        Standard deviation of each equation.
    max_time : float
        The most robot time [s].
    period : float
        Of the motion that was chosen [s].
    forecast : PrecisionForecast
        Of its runs.
    trials : tuple of TriedPeriod
        In the order of their periods.
    front : tuple of FrontPoint
    out_of_reach : OutOfReach, optional
        What keeps the target out of reach, where it is.
    """

    asked: Mapping[str, Any]
    noise: tuple[float, ...]
    max_time: float
    period: float
    forecast: PrecisionForecast = field(metadata=INLINE)
    trials: tuple[TriedPeriod, ...]
    front: tuple[FrontPoint, ...]
    out_of_reach: OutOfReach | None = None
