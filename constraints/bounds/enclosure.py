"""Extrema of nonlinear functions of a motion between its samples, from rigorous bounds refined until they decide.

Around the middle m of a time interval of half length h, ``g(t)`` lies in ``g(m) + [dg/dt] [-h, h]`` with dg/dt enclosed
over all states that the motion can have in that interval (mean value form). Undecided intervals are split.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from constraints.bounds.certificate import ENCLOSED, LimitUse, limit_uses, worst_of_each
from constraints.bounds.extrema import Extrema
from constraints.nonlinear import NonlinearConstraint
from regressors.samples import Array, Samples

_INTERVALS = 1024
_PARTS = 4
_DEPTH = 9
_CLOSE = 1e-3  # of a function's scale: near a limit, bounds this close to values that occur are accepted
_LOOSE = 1e-2  # the same where no limit is near
_ROUNDING = 1e-12  # of a function's scale and value: the rounding error of a value
_MOST = 200_000


@dataclass(frozen=True, eq=False)
class Enclosure:
    """Bounds that hold at every instant."""

    extrema: Extrema  # outer bounds of every function over continuous time, and instants near which they are approached
    intervals: int  # number of time intervals that were evaluated

    def uses(self, constraint: NonlinearConstraint) -> list[LimitUse]:
        """Certificate of each label of the constraint that was enclosed, in the quantity that is reported."""
        shown = constraint.shown
        times = (self.extrema.low_time, self.extrema.high_time)
        seen = Extrema(shown(self.extrema.low), shown(self.extrema.high), *times)
        bounds = _Shown(
            constraint.labels, constraint.units, shown(constraint.lower), shown(constraint.upper), constraint.quantity
        )
        return worst_of_each(limit_uses(bounds, seen, ENCLOSED))


@dataclass(eq=False)
class _Shown:
    """Bounds as they are reported."""

    labels: tuple[str, ...]
    units: tuple[str, ...]
    lower: Array
    upper: Array
    quantity: str


def enclose(
    constraint: NonlinearConstraint, motion: Callable[[Array], Samples], duration: float, jerk: Array
) -> Enclosure:
    """Bounds of a constraint's functions over a motion.

    Within a function's scale of a limit they exceed values that occur by at most 0.01 of that scale, and near or beyond
    the limit by at most 0.001; by more only where a motion varies so fast that 9 splits do not decide.
    """  # jerk (n,)
    half = np.full(_INTERVALS, 0.5 * duration / _INTERVALS)
    middle = (np.arange(_INTERVALS) + 0.5) * duration / _INTERVALS
    k = len(constraint.labels)
    high, low = np.full(k, -np.inf), np.full(k, np.inf)
    reached_high, reached_low = np.full(k, -np.inf), np.full(k, np.inf)
    high_time, low_time = np.zeros(k), np.zeros(k)
    total = 0
    for depth in range(_DEPTH + 1):
        total += middle.size
        value, slack = _mean_value(constraint, motion(middle), half, jerk)
        best, least = value.argmax(axis=0), value.argmin(axis=0)
        higher, lower = value[best, np.arange(k)] > reached_high, value[least, np.arange(k)] < reached_low
        high_time, low_time = np.where(higher, middle[best], high_time), np.where(lower, middle[least], low_time)
        reached_high = np.maximum(reached_high, value.max(axis=0))
        reached_low = np.minimum(reached_low, value.min(axis=0))
        above = _undecided(value + slack, reached_high, constraint.upper, constraint.scale)
        below = _undecided(slack - value, -reached_low, -constraint.lower, constraint.scale)
        split = np.any(above | below, axis=1)
        if depth == _DEPTH or split.sum() * _PARTS > _MOST:
            split[:] = False
        kept = ~split
        high = np.maximum(high, (value + slack)[kept].max(axis=0, initial=-np.inf))
        low = np.minimum(low, (value - slack)[kept].min(axis=0, initial=np.inf))
        if not np.any(split):
            break
        offsets = (2 * np.arange(_PARTS) + 1) / _PARTS - 1.0
        middle = (middle[split, None] + half[split, None] * offsets).ravel()
        half = np.repeat(half[split] / _PARTS, _PARTS)
    return Enclosure(Extrema(low, high, low_time, high_time), total)


def _undecided(bound: Array, reached: Array, limit: Array, scale: Array) -> NDArray[np.bool_]:
    """Select the bounds that are too far above values that occur; far from a limit no accuracy is required."""
    beyond, left = (bound - reached) / scale, (limit - bound) / scale
    loose, close = (beyond > _LOOSE) & (left < 1.0), (beyond > _CLOSE) & (left < _CLOSE)
    return np.asarray(loose | close, dtype=bool)


def _mean_value(constraint: NonlinearConstraint, samples: Samples, half: Array, jerk: Array) -> tuple[Array, Array]:
    """Values in the middle of intervals, and the largest deviations from them inside, shape (N, k) each."""
    h = half[:, None]
    third = np.broadcast_to(jerk, samples.q.shape)
    second = third * h
    first = np.abs(samples.ddq) * h + third * h**2 / 2
    zeroth = np.abs(samples.dq) * h + np.abs(samples.ddq) * h**2 / 2 + third * h**3 / 6
    spread = (zeroth, first, second)
    centre = (samples.q, samples.dq, samples.ddq)
    low = [np.ascontiguousarray((x - s).T) for x, s in zip(centre, spread, strict=True)]
    high = [np.ascontiguousarray((x + s).T) for x, s in zip(centre, spread, strict=True)]
    slow, fast = constraint.rate([*low, np.ascontiguousarray(-third.T)], [*high, np.ascontiguousarray(third.T)])
    steepest = np.maximum(np.abs(slow), np.abs(fast)).T
    value = constraint.values(samples)
    return value, steepest * h + _ROUNDING * (constraint.scale + np.abs(value))
