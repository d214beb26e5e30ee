"""Every rival on one training set: filter, terms of friction and estimator, with the processor time of each."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from filtered_motion import FilteredLog, at, filtered
from friction_columns import NOT_NEGATIVE, USUAL, VARIANTS, friction_columns
from numpy.typing import NDArray
from possible_bodies import possible
from rigid_regressor import RigidRegressor
from rivals import Fit, ordinary, ridge, weighted

from excite.logs.log import Log

Array = NDArray[np.float64]
CUTOFFS = (5.0, 10.0)  # Hz
ESTIMATORS = {"OLS": ordinary, "weighted": weighted, "ridge": ridge}
PHYSICAL = "physical (SDP)"


@dataclass(frozen=True)
class Rival:
    """One way to identify: nothing in it depends on data."""

    estimator: str
    friction: str
    cutoff: float

    def __str__(self) -> str:
        """Its name in tables."""
        return f"{self.estimator}, {self.friction}, {self.cutoff:g} Hz"


@dataclass(frozen=True, eq=False)
class RivalFit:
    """A rival's estimate.

    Parameters
    ----------
    rival : Rival
    fit : Fit
        In the independent rigid columns, or all of them, then friction.
    carried : ndarray
        Parameters of the independent rigid columns that say what each joint carries.
    cpu, wall : float
        Of filter, regressor and estimate [s].
    """

    rival: Rival
    fit: Fit
    carried: Array
    cpu: float
    wall: float


class RivalLog:
    """A log with its rigid columns at one cutoff.

    Parameters
    ----------
    regressor : RigidRegressor
    log : Log
    cutoff : float
        [Hz]
    """

    def __init__(self, regressor: RigidRegressor, log: Log, cutoff: float) -> None:
        self._regressor = regressor
        self.motion: FilteredLog = filtered(log, cutoff)
        self.rigid = regressor.columns(self.motion.samples)

    @cached_property
    def base(self) -> Array:
        """The independent rigid columns, shape (N, n, b)."""
        return np.asarray(self.rigid[:, :, self._regressor.independent])

    def columns(self, rival: Rival, carried: Array) -> Array:
        """All columns of a rival, shape (N, n, p)."""
        friction = friction_columns(VARIANTS[rival.friction], self.motion.samples.dq, self.base @ carried)
        return np.concatenate([self.rigid if rival.estimator == PHYSICAL else self.base, friction], axis=2)

    def predicted(self, made: RivalFit, instants: Array) -> Array:
        """Torques at a log's own instants, shape (N, n) [Nm]."""
        return at(instants, self.motion.samples.time, self.columns(made.rival, made.carried) @ made.fit.x)


def rival_fits(
    regressor: RigidRegressor, logs: Sequence[Log], spans: Sequence[tuple[float, float]], cutoff: float
) -> Iterator[RivalFit]:
    """All rivals of one cutoff on one training set.

    Parameters
    ----------
    regressor : RigidRegressor
    logs : sequence of Log
    spans : sequence of (float, float)
        First and last instant of each log that makes equations [s].
    cutoff : float
        [Hz]
    """
    began = _clocks()
    parts = [RivalLog(regressor, log, cutoff) for log in logs]
    inside = [_inside(part, span) for part, span in zip(parts, spans, strict=True)]
    y = np.concatenate([part.motion.torque[rows] for part, rows in zip(parts, inside, strict=True)])
    base = np.concatenate([part.base[rows] for part, rows in zip(parts, inside, strict=True)])
    dq = np.concatenate([part.motion.samples.dq[rows] for part, rows in zip(parts, inside, strict=True)])
    usual = weighted(np.concatenate([base, friction_columns(USUAL, dq, dq)], axis=2), y)
    carried = usual.x[: base.shape[2]]
    prepared = _clocks() - began
    for friction in VARIANTS:
        for estimator in (*ESTIMATORS, PHYSICAL):
            began, rival = _clocks(), Rival(estimator, friction, cutoff)
            W = np.concatenate([part.columns(rival, carried)[rows] for part, rows in zip(parts, inside, strict=True)])
            fit = _possible(regressor, rival, W, y) if estimator == PHYSICAL else ESTIMATORS[estimator](W, y)
            cpu, wall = prepared + _clocks() - began
            yield RivalFit(rival, fit, carried, cpu, wall)


def _possible(regressor: RigidRegressor, rival: Rival, W: Array, y: Array) -> Fit:
    """Physically possible bodies; weights from the weighted estimate."""
    kinds, n = VARIANTS[rival.friction], y.shape[1]
    described = np.concatenate([regressor.described, np.zeros(n * len(kinds))])
    friction = np.repeat([kind in NOT_NEGATIVE for kind in kinds], n)
    not_negative = np.concatenate([np.zeros(10 * n, bool), np.ones(n, bool), friction])
    free = np.concatenate([regressor.independent, np.arange(11 * n, W.shape[2])])
    x = possible(W, y, weighted(W[:, :, free], y).noise, n, described, not_negative)
    return Fit(x, None, np.std(y - W @ x, axis=0))


def _inside(part: RivalLog, span: tuple[float, float]) -> NDArray[np.bool_]:
    time = part.motion.samples.time
    return np.asarray((time >= span[0]) & (time <= span[1]))


def _clocks() -> Array:
    """Processor and wall time [s]."""
    return np.array([time.process_time(), time.monotonic()])
