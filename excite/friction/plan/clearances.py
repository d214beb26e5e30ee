"""Distances of a robot to itself and to obstacles along straight lines of poses, on which one coordinate moves.

Distances depend on the pose only, so a run is judged over the positions s that it passes, ``q(s) = p + N s``: about the
middle m of an interval of half length h, ``g(s)`` lies in ``g(m) + [dg/ds] [-h, h]``, with dg/ds enclosed over it.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from constraints.certificate import LimitUse
from constraints.collision_limits import collision_limits
from constraints.enclosure import enclose
from constraints.geometry import World
from constraints.nonlinear import NonlinearConstraint
from regressors.models.partial import of_joints
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

_INTERVALS, _PARTS, _DEPTH = 512, 8, 2
_LOOKED_AT = 512
_RESERVE = 2e-3  # of a function's scale: more than the gap between a certificate and the true minimum


@dataclass(frozen=True)
class ClearStretch:
    """Part of a line on which all distances are kept."""

    low: float  # range of s [rad or m]
    high: float
    below: str  # pair that is too near beyond the ends, such as ``forearm to table``; empty where there is none
    above: str


class CollisionChecks:
    """Distances that a robot has to keep."""

    def __init__(self, robot: Robot, world: World) -> None:
        self.world = world
        self.limits = collision_limits(robot, world, of_joints(robot, range(robot.n)))
        self.notes = self.limits[0].notes if self.limits else ()
        self._labels = [*(label for limit in self.limits for label in limit.labels), ""]

    def free(self, pose: Array, line: Array, low: float, high: float) -> list[ClearStretch]:
        """Stretches of a line on which every distance is proven to be kept, to about 1/30,000 of the line."""
        half = 0.5 * (high - low) / _INTERVALS
        middle = np.asarray(low + half * (2 * np.arange(_INTERVALS) + 1))
        ends: list[tuple[float, float, str]] = []  # of each interval, and what is too near there
        for depth in range(_DEPTH + 1):
            kept, lost, nearest = self._decided(pose, line, middle, half)
            remaining = kept | lost if depth < _DEPTH else np.ones_like(kept)
            ends += self._ends(middle[remaining], half, kept[remaining], nearest[remaining])
            parts = half * ((2 * np.arange(_PARTS) + 1) / _PARTS - 1.0)
            middle = (middle[~remaining, None] + parts).ravel()
            half /= _PARTS
            if middle.size == 0:
                break
        return _joined(sorted(ends))

    def likely(self, pose: Array, line: Array, low: float, high: float) -> list[ClearStretch]:
        """Quick estimate of `free` from the distances in 512 poses of the line; nothing is proven."""
        half = 0.5 * (high - low) / _LOOKED_AT
        middle = np.asarray(low + half * (2 * np.arange(_LOOKED_AT) + 1))
        room = self._room(pose, line, middle)
        return _joined(self._ends(middle, half, np.all(room >= 0.0, axis=1), room.argmin(axis=1)))

    def _ends(
        self, middle: Array, half: float, kept: NDArray[np.bool_], nearest: NDArray[np.intp]
    ) -> list[tuple[float, float, str]]:
        """Ends of intervals, and what is too near in each."""
        rows = zip(middle.tolist(), kept, nearest.tolist(), strict=True)
        return [(m - half, m + half, "" if ok else self._labels[number]) for m, ok, number in rows]

    def uses(self, pose: Array, line: Array, low: float, high: float) -> list[LimitUse]:
        """Certificate of each pair of bodies over a stretch; its time is ``s - low``."""

        def passed(time: Array) -> Samples:
            still = np.zeros((time.size, line.size))
            return Samples(time, pose + np.outer(low + time, line), still + line, still, still)

        straight = np.zeros(line.size)
        return [use for limit in self.limits for use in enclose(limit, passed, high - low, straight).uses(limit)]

    def nearest(self, pose: Array, line: Array) -> str:
        """Pair that is too near, or nearest to it, where s is zero."""
        room = self._decided(pose, line, np.zeros(1), 0.0)[2]
        return self._labels[int(room[0])]

    def _decided(
        self, pose: Array, line: Array, middle: Array, half: float
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.intp]]:
        """Intervals of a line that keep all distances, those that violate one throughout, and the least distance."""
        room = self._room(pose, line, middle)
        spread = [_spread(limit, pose, line, middle, half) for limit in self.limits]
        slack = np.hstack([*spread, np.zeros((middle.size, 1))])
        return np.all(room >= slack, axis=1), np.any(room < -slack, axis=1), room.argmin(axis=1)

    def _room(self, pose: Array, line: Array, middle: Array) -> Array:
        """Margins of all distances in poses of a line, with a last column of infinity, shape (N, k)."""
        q = pose + np.outer(middle, line)
        still = np.zeros_like(q)
        samples = Samples(middle, q, still, still, still)
        kept = [limit.values(samples) - limit.lower - _RESERVE * limit.scale for limit in self.limits]
        return np.hstack([*kept, np.full((middle.size, 1), np.inf)])


def _spread(limit: NonlinearConstraint, pose: Array, line: Array, middle: Array, half: float) -> Array:
    """Bound on the change of functions within intervals of a line from their middle, shape (N, k)."""
    q = pose + np.outer(middle, line)
    still, along = np.zeros_like(q), np.broadcast_to(line, q.shape)
    reach = half * np.abs(line)
    low, high = ([np.ascontiguousarray(x.T) for x in (q + side * reach, along, still, still)] for side in (-1, 1))
    slow, fast = limit.rate(low, high)
    return np.asarray(half * np.maximum(np.abs(slow), np.abs(fast)).T)


def _joined(ends: list[tuple[float, float, str]]) -> list[ClearStretch]:
    """Neighbouring free intervals as one."""
    groups = [list(group) for _, group in itertools.groupby(ends, key=lambda end: end[2] == "")]
    joined = []
    for k, group in enumerate(groups):
        if group[0][2] == "":
            below = groups[k - 1][-1][2] if k > 0 else ""
            above = groups[k + 1][0][2] if k + 1 < len(groups) else ""
            joined.append(ClearStretch(group[0][0], group[-1][1], below, above))
    return joined
