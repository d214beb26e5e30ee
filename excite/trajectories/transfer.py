"""Transfers: straight lines in joint space from rest to rest, as fast as the limits of joints and drives allow.

On the line ``q(t) = q0 + s(t) d`` with ``d = q1 - q0`` every limited function ``A q + a0`` is linear in s, so a bound b
on a derivative bounds that of s by ``b / |A d|``; the tightest of them bounds each derivative of s, and the S-curve
within these is the fastest motion on the line. Positions between two poses that keep the limits keep them too.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from constraints.bounds.extrema import Extrema
from constraints.bounds.piecewise import piecewise_extrema
from constraints.constraint import Constraint
from constraints.linear import LinearConstraint, spanned
from constraints.nonlinear import NonlinearConstraint
from excite.trajectories.scurve import SCurve, time_optimal
from excite.trajectories.sequence import Rest
from regressors.errors import InputError
from regressors.samples import Array, Samples

SPEEDING_UP = 0.5  # s from rest to the velocity limit, where no acceleration limit is known
BUILDING_UP = 0.1  # s from zero to the acceleration limit, where no jerk limit is known
_SAME = 1e-9  # rad or m


@dataclass(frozen=True, eq=False)
class Leg:
    """One straight line with its law of motion."""

    start: Array  # (n,) poses q0, q1 [rad or m]
    end: Array  # (n,)
    law: SCurve  # s(t)


@dataclass(frozen=True, eq=False)
class Transfer:
    """Straight lines in sequence, with rest between them."""

    legs: tuple[Leg, ...]  # one or more
    shortest: float  # least duration of all legs together; the transfer may be slower [s]
    # per quantity, ``acceleration`` or ``jerk``: the joints for which no limit is known and one was assumed
    assumed: dict[str, tuple[str, ...]]

    @property
    def poses(self) -> tuple[Array, ...]:
        """Poses from first to last, shapes (n,)."""
        return (self.legs[0].start, *(leg.end for leg in self.legs))

    @property
    def ends(self) -> Array:
        """End time of each leg [s]."""
        return np.cumsum(np.array([leg.law.duration for leg in self.legs]))

    @property
    def duration(self) -> float:
        """Duration of all legs together [s]."""
        return float(self.ends[-1])

    @property
    def jerk(self) -> Array:
        """Largest magnitude of every joint's jerk, shape (n,) [rad/s^3 or m/s^3]."""
        largest = [np.abs(leg.law.derivative(3)).max() * np.abs(leg.end - leg.start) for leg in self.legs]
        return np.asarray(np.max(largest, axis=0))

    def stretched(self, duration: float) -> Transfer:
        """The same lines over another duration [s]."""
        factor = duration / self.duration
        legs = tuple(replace(leg, law=leg.law.stretched(leg.law.duration * factor)) for leg in self.legs)
        return replace(self, legs=legs)

    def samples(self, time: Array) -> Samples:
        """Motion at given instants; exactly at rest in the end poses at both ends and beyond."""  # time (N,)
        time = np.asarray(time, dtype=float)
        starts = np.concatenate([[0.0], self.ends[:-1]])
        number = np.clip(np.searchsorted(starts, time, side="right") - 1, 0, len(self.legs) - 1)
        number[time >= self.duration] = len(self.legs) - 1
        motion = np.zeros((4, time.size, self.legs[0].start.size))
        for k, leg in enumerate(self.legs):
            here = number == k
            s = leg.law.values(time[here] - starts[k])
            motion[:, here] = s[:, :, None] * (leg.end - leg.start)
            motion[0, here] += leg.start
            motion[0, here] = np.where(s[0][:, None] == 1.0, leg.end, motion[0, here])
        motion[0, time >= self.duration] = self.legs[-1].end
        motion[1:, time >= self.duration] = 0.0
        return Samples(time, *(motion + 0.0))  # no negative zeros

    def to_dict(self) -> dict[str, object]:
        """Poses, durations and the law on every line, for JSON; SI."""
        return {
            "duration": self.duration,
            "shortest": self.shortest,
            "form": "q(t) = start + s(t) (end - start); s from 0 to 1, at rest at both ends, jerk constant in pieces",
            "times": "breaks count from the start of the leg, limits from the start of the approach or return",
            "legs": [
                {
                    "start": leg.start.tolist(),
                    "end": leg.end.tolist(),
                    "breaks": leg.law.breaks.tolist(),
                    "jerk": leg.law.derivative(3)[0].tolist(),
                }
                for leg in self.legs
            ],
        }

    def extrema(self, limit: LinearConstraint) -> Extrema:
        """Exact extrema of a limit's functions over continuous time, each a piecewise cubic or its derivative."""
        breaks, pieces = [np.zeros(1)], []
        for leg, begins in zip(self.legs, np.concatenate([[0.0], self.ends[:-1]]), strict=True):
            slope = limit.matrix @ (leg.end - leg.start)
            part = leg.law.derivative(limit.derivative)[:, :, None] * slope
            if limit.derivative == 0:
                part[-1] += limit.matrix @ leg.start + limit.offset
            breaks.append(begins + leg.law.breaks[1:])
            pieces.append(part)
        return piecewise_extrema(np.concatenate(breaks), np.concatenate(pieces, axis=1))


def quickest_transfer(
    poses: Sequence[Array], limits: Sequence[LinearConstraint], joints: Sequence[str]
) -> Transfer | None:
    """Fastest motion on the straight lines through some poses, at rest in each.

    Where no acceleration limit bounds a joint, the velocity limit is reached in 0.5 s or later; where no jerk limit
    does, the acceleration limit is reached in 0.1 s or later.
    """  # poses (n,)
    assumed: dict[str, list[str]] = {"acceleration": [], "jerk": []}
    legs = tuple(
        Leg(start, end, _law(end - start, limits, joints, assumed))
        for start, end in itertools.pairwise(np.asarray(pose, dtype=float) for pose in poses)
        if np.abs(end - start).max() > _SAME
    )
    if not legs:
        return None
    once = {quantity: tuple(name for name in joints if name in joints_of) for quantity, joints_of in assumed.items()}
    return Transfer(legs, sum(leg.law.duration for leg in legs), once)


def _law(
    line: Array, limits: Sequence[LinearConstraint], joints: Sequence[str], assumed: dict[str, list[str]]
) -> SCurve:
    """S-curve within the tightest bounds along a line; joints for which a bound is assumed are recorded."""
    velocity, acceleration, jerk = (_tightest(line, limits, derivative) for derivative in (1, 2, 3))
    free = [_unbounded(line, limits, joints, (derivative,)) for derivative in (2, 3)]
    if unlimited := _unbounded(line, limits, joints, (1, 2)):
        raise InputError(
            f"no velocity or acceleration limit bounds joint {', '.join(unlimited)}, which moves on the approach or "
            "return; give `velocity` and `acceleration`, or limits in the robot's file"
        )
    if free[0] and velocity < np.inf:
        acceleration = min(acceleration, velocity / SPEEDING_UP)
        assumed["acceleration"] += free[0]
    if free[1]:
        jerk = min(jerk, acceleration / BUILDING_UP)
        assumed["jerk"] += free[1]
    return time_optimal(velocity, acceleration, jerk)


def _tightest(line: Array, limits: Sequence[LinearConstraint], derivative: int) -> float:
    """Bound on a derivative of s, ``min b / |A d|``; infinite where there is none."""
    tightest = np.inf
    for limit in limits:
        if limit.derivative == derivative:
            size = np.abs(limit.matrix @ line)
            bound = np.minimum(limit.upper, -limit.lower)
            ratio = np.divide(bound, size, out=np.full_like(size, np.inf), where=size > 0.0)
            tightest = min(tightest, float(ratio.min(initial=np.inf)))
    return tightest


def _unbounded(
    line: Array, limits: Sequence[LinearConstraint], joints: Sequence[str], derivatives: tuple[int, ...]
) -> list[str]:
    """Joints that move on a line without a limit on one of these derivatives."""
    bounded = spanned(limits, line.size, derivatives)
    return [name for name, d, ok in zip(joints, line, bounded, strict=True) if abs(d) > _SAME and not ok]


def check_pose(pose: Array, what: str, limits: Sequence[Constraint]) -> None:
    """Raise `InputError` where rest in a pose violates limits: which, and by how much."""  # pose (n,)
    rest = Rest(pose, 0.0).samples(np.zeros(1))
    broken: dict[str, tuple[float, str]] = {}  # of several functions with one label, the largest violation
    for limit in limits:
        value, lower, upper = limit.values(rest)[0], limit.lower, limit.upper
        if isinstance(limit, NonlinearConstraint):
            value, lower, upper = (limit.shown(x) for x in (value, lower, upper))
        excess = np.maximum(lower - value, value - upper)
        for k in np.flatnonzero(excess > _SAME):
            label, unit, much = limit.labels[k], limit.units[k], float(excess[k])
            message = f"{label} is {value[k]:.6g} {unit}, {much:.3g} {unit} outside [{lower[k]:.6g}, {upper[k]:.6g}]"
            broken[label] = max(broken.get(label, (0.0, "")), (much, message))
    if broken:
        raise InputError(f"{what}: {'; '.join(message for _, message in broken.values())}")
