"""Half-widths after several runs of one motion, and the fewest runs that meet a precision target.

Information adds, so that n runs of a motion with covariance C leave ``C / n``, and ``(n C^-1 + P)^-1`` after earlier
experiments with the information P; their rows also settle the estimate of the noise, see
`excite.information.half_widths`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from excite.information.earlier_precision import InformationInHand
from excite.information.half_widths import (
    TorquePrecision,
    allowed_half_widths,
    half_width_factor,
    residual_degrees_of_freedom,
    torque_precision,
)
from excite.information.identifiability import inverse_half
from excite.information.target import IdentificationTarget
from excite.tasks.precision_target import PrecisionTarget
from regressors.samples import Array, Samples

_MOST_RUNS = 10**9


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

    runs: int
    seconds: float
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

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "met": self.met,
            "runs": self.runs,
            "seconds_per_run": self.seconds,
            "robot_seconds": self.robot_seconds,
            "level": self.level,
            "probability": self.probability,
            "parameters": [vars(parameter) for parameter in self.parameters],
        }


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
    """

    target: IdentificationTarget
    precision: PrecisionTarget
    half: Array
    rows: int
    seconds: float
    in_hand: InformationInHand | None = None

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
        half = inverse_half(W / np.tile(noise, W.shape[0] // noise.size)[:, None])
        return cls(target, precision, half, W.shape[0], seconds, in_hand)

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
        """Standard deviations after one run, in the order of `allowed`."""
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
        if self.in_hand is None:
            return np.asarray(self._factor(runs) * self.deviation / math.sqrt(runs))
        together = np.vstack([self.in_hand.R, math.sqrt(runs) * np.linalg.pinv(self.half)])
        return np.asarray(self._factor(runs) * self._deviations(inverse_half(together)))

    def use(self, runs: int) -> float:
        """Largest half-width over the allowed one after a number of runs."""
        return float(np.max(self.half_widths(runs) / self.allowed))

    def fewest_runs(self) -> int:
        """The fewest runs that meet the target; at least one."""
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
        given = self.precision
        return PrecisionForecast(
            runs,
            self.seconds,
            given.level,
            given.probability,
            tuple(
                ParameterPrecision(name, unit, float(h), float(a) if np.isfinite(a) else None)
                for name, unit, h, a in zip(self.names, self.units, self.half_widths(runs), self.allowed, strict=True)
            ),
        )

    def _factor(self, runs: int) -> float:
        f = residual_degrees_of_freedom(
            float(runs) * self.rows, self.target.base.rank, len(self.target.model.row_labels)
        )
        f += 0 if self.in_hand is None else self.in_hand.degrees_of_freedom
        return half_width_factor(f, level=self.precision.level, probability=self.precision.probability)
