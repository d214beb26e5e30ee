"""Transfers: straight lines in joint space from rest to rest along time-optimal S-curves.

On the line ``q(t) = q0 + s(t) d`` with ``d = q1 - q0`` every limited function ``A q + a0`` is linear in s, so a bound b
on a derivative bounds that of s by ``b / |A d|``; the tightest of them bounds each derivative of s, and the S-curve
within these is the fastest motion on the line. Positions between two poses that keep the limits keep them too.

Of all laws s(t) with ``|ds| <= V``, ``|dds| <= A``, ``|ddds| <= J`` the one of least duration has seven phases of
constant jerk; Ruckig finds their durations [Berscheid, Kroeger 2021].
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from ruckig import InputParameter, Result, Ruckig, Trajectory

from constraints.certificate import Extrema
from constraints.enclosure import piecewise_extrema
from constraints.linear import Constraint, LinearConstraint, spanned
from constraints.nonlinear import NonlinearConstraint
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

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> Transfer:
        """One that `to_dict` has described."""
        legs = []
        for leg in content["legs"]:
            start, end = (np.array(leg[name], dtype=float) for name in ("start", "end"))
            legs.append(Leg(start, end, SCurve.of_jerks(leg["breaks"], leg["jerk"])))
        return cls(tuple(legs), float(content["shortest"]), {"acceleration": (), "jerk": ()})

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
    lines = itertools.pairwise(np.asarray(pose, dtype=float) for pose in poses)
    moves = ((start, end) for start, end in lines if np.abs(end - start).max() > _SAME)
    legs = tuple(Leg(start, end, _law(end - start, limits, joints, assumed)) for start, end in moves)
    if not legs:
        return None
    once = {quantity: tuple(name for name in joints if name in joints_of) for quantity, joints_of in assumed.items()}
    return Transfer(legs, sum(leg.law.duration for leg in legs), once)


def _law(
    line: Array, limits: Sequence[LinearConstraint], joints: Sequence[str], assumed: dict[str, list[str]]
) -> SCurve:
    """S-curve within the tightest bounds along a line; joints for which a bound is assumed are recorded."""

    def unbounded(*derivatives: int) -> list[str]:
        bounded = spanned(limits, line.size, derivatives)
        return [name for name, d, ok in zip(joints, line, bounded, strict=True) if abs(d) > _SAME and not ok]

    velocity, acceleration, jerk = (_tightest(line, limits, derivative) for derivative in (1, 2, 3))
    free = [unbounded(derivative) for derivative in (2, 3)]
    if unlimited := unbounded(1, 2):
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


_RESERVE = 1e-5  # of the duration of a phase: what a controller's clock takes from a jerk that ends between its ticks
_LOOSE = 1.0  # with J = 1 neither velocity nor acceleration ever reaches 1 between 0 and 1, so this bound is inactive


@dataclass(frozen=True, eq=False)
class SCurve:
    """A law s(t) from s(0) = 0 to s(T) = 1, piecewise cubic, at rest at both ends."""

    breaks: Array  # (m + 1,) ends of the pieces, from 0 to T [s]
    coefficients: Array  # (4, m) ``s = sum_p coefficients[p, i] (t - breaks[i])^(3 - p)`` on piece i

    @classmethod
    def of_jerks(cls, breaks: Sequence[float] | Array, jerks: Sequence[float] | Array) -> SCurve:
        """The law from rest at 0 whose jerk is constant between breaks."""
        pieces, s, ds, dds = [], 0.0, 0.0, 0.0
        for h, j in zip(np.diff(breaks), jerks, strict=True):
            pieces.append([j / 6, dds / 2, ds, s])
            s, ds, dds = s + h * (ds + h * (dds / 2 + h * j / 6)), ds + h * (dds + h * j / 2), dds + h * j
        return cls(np.array(breaks, dtype=float), np.array(pieces).T)

    @property
    def duration(self) -> float:
        """T [s]."""
        return float(self.breaks[-1])

    def derivative(self, order: int) -> Array:
        """Coefficients of a derivative on each piece, shape (4 - order, m)."""
        c = self.coefficients
        for _ in range(order):
            c = c[:-1] * np.arange(c.shape[0] - 1, 0, -1.0)[:, None]
        return c

    def values(self, time: Array) -> Array:
        """Values of s and its three derivatives; 0 before the start and 1 after the end, exactly at rest."""
        # time (N,)
        i = np.clip(np.searchsorted(self.breaks, time, side="right") - 1, 0, self.breaks.size - 2)
        local = time - self.breaks[i]
        orders = np.stack([np.polyval(self.derivative(order)[:, i], local) for order in range(4)])
        orders[:, time <= 0.0] = 0.0
        orders[:, time >= self.duration] = [[1.0], [0.0], [0.0], [0.0]]
        return orders

    def stretched(self, duration: float) -> SCurve:
        """The same law over another duration, ``s(t T / duration)``."""
        factor = duration / self.duration
        powers = factor ** -np.arange(3.0, -1.0, -1.0)
        breaks = self.breaks * factor
        breaks[-1] = duration
        return replace(self, breaks=breaks, coefficients=self.coefficients * powers[:, None])

    def on_grid(self, period: float) -> SCurve:
        """The same kind of law with phases of whole sampling periods, never faster: what interpolates it is exact.

        From rest to rest, the velocity is one over T1, averaged over T2 and then over T3, where the largest velocity,
        acceleration and jerk are ``1 / T1``, ``1 / (T1 T2)`` and ``1 / (T1 T2 T3)``; all three are rounded up.
        """
        jerk = np.abs(self.derivative(3)).max()
        acceleration = np.abs(self.derivative(2)[-1]).max()
        velocity = self.values(np.array([self.duration / 2]))[1, 0]
        phases = np.array([acceleration / jerk, velocity / acceleration, 1.0 / velocity])
        n3, n2, n1 = (int(n) for n in np.ceil(phases / period * (1.0 + _RESERVE)))
        n2 = max(n2, n3)
        n1 = max(n1, n2 + n3)
        ticks = np.unique([0, n3, n2, n2 + n3, n1, n1 + n3, n1 + n2, n1 + n2 + n3])
        signs = np.zeros(ticks.size - 1)
        for sign, begin in ((1, 0), (-1, n2), (-1, n1), (1, n1 + n2)):
            signs += sign * ((ticks[:-1] >= begin) & (ticks[:-1] < begin + n3))
        return SCurve.of_jerks(ticks * period, signs / (n1 * n2 * n3 * period**3))


def time_optimal(velocity: float, acceleration: float, jerk: float) -> SCurve:
    """Time-optimal law from 0 to 1, from rest to rest."""
    unit = jerk ** (-1.0 / 3.0)  # unit of time in which J = 1: Ruckig's tolerances are absolute
    given, trajectory = InputParameter(1), Trajectory(1)
    given.current_position, given.target_position = [0.0], [1.0]
    given.max_velocity = [min(velocity * unit, _LOOSE)]
    given.max_acceleration = [min(acceleration * unit**2, _LOOSE)]
    given.max_jerk = [1.0]
    result = Ruckig(1).calculate(given, trajectory)
    if result is not Result.Working:
        raise RuntimeError(f"Ruckig ends with {result} for limits {velocity:g}, {acceleration:g}, {jerk:g}")
    profile = trajectory.profiles[0][0]
    kept = np.flatnonzero(np.array(profile.t) > 0.0)
    t, j = np.array(profile.t)[kept], np.array(profile.j)[kept]
    p, v, a = (np.array(values)[kept] for values in (profile.p, profile.v, profile.a))
    end = profile.p[-1]  # 1 up to rounding
    law = SCurve(np.concatenate([[0.0], np.cumsum(t)]), np.stack([j / 6.0, a / 2.0, v, p]) / end)
    return law.stretched(law.duration * unit)
