"""Runs at constant speed: there and back on a line, each from rest to rest with ramps of limited jerk.

A ramp to speed v takes ``v / A + A / J`` seconds, or ``2 sqrt(v / J)`` where A is not reached, and covers half of v
times that; the rest of the stroke is passed at exactly v.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from constraints.certificate import Extrema, LimitUse, limit_uses, worst_of_each
from constraints.enclosure import enclose, piecewise_extrema
from constraints.linear import LinearConstraint
from constraints.torque import torque_limits
from excite.trajectories.transfer import BUILDING_UP, SPEEDING_UP, SCurve, time_optimal
from regressors.errors import InputError
from regressors.models.nominal import standard_values
from regressors.models.partial import PartialMotion
from regressors.robot.robot import Robot
from regressors.samples import Array, Index, Samples

REST = "rest"
LEAST_RUN = 1e-9  # rad or m: a shorter way is none


@dataclass(frozen=True)
class Pace:
    """Largest velocity, acceleration and jerk of a coordinate s along its line."""

    velocity: float  # V, A, J [rad/s, rad/s^2, rad/s^3, or with m]
    acceleration: float
    jerk: float
    # ``acceleration``, ``jerk`` where no limit is known: V is then reached in 0.5 s, A in 0.1 s
    assumed: tuple[str, ...]

    def ramp(self, speed: float) -> float:
        """Length of the ramp from rest to a speed [rad or m]."""
        A, J = self.acceleration, self.jerk
        seconds = speed / A + A / J if speed >= A**2 / J else 2 * np.sqrt(speed / J)
        return float(0.5 * speed * seconds)

    def law(self, start: float, end: float, speed: float) -> SCurve:
        """Fastest motion law from one position to another with a limited speed."""
        d = abs(end - start)
        return time_optimal(speed / d, self.acceleration / d, self.jerk / d)


def pace_of(motion: PartialMotion, limits: Sequence[LinearConstraint]) -> Pace:
    """Tightest limits on the derivatives of one coordinate."""
    line = motion.matrix[:, 0]
    pace = [np.inf] * 4
    for limit in limits:
        slope = np.abs(limit.matrix @ line)
        moves = slope > 1e-12
        bound = np.minimum(limit.upper, -limit.lower)[moves] / slope[moves]
        pace[limit.derivative] = min(pace[limit.derivative], float(bound.min(initial=np.inf)))
    V, A, J = pace[1:]
    if np.isinf(V):
        raise InputError(
            f"{motion.labels[0]}: no velocity limit bounds it, and speeds are parts of the largest one; give "
            "`velocity`, or limits in the robot's file"
        )
    assumed = [name for name, value in (("acceleration", A), ("jerk", J)) if np.isinf(value)]
    A = V / SPEEDING_UP if np.isinf(A) else A
    return Pace(V, A, A / BUILDING_UP if np.isinf(J) else J, tuple(assumed))


@dataclass(frozen=True, eq=False)
class Part:
    """A stretch of the motion that begins on a sample."""

    segment: str  # its name in files
    begin: float  # time when it begins [s]
    start: float  # positions s [rad or m]
    end: float
    law: SCurve | None = None  # from 0 to 1; none while the coordinate rests

    def values(self, time: Array) -> Array:
        """Position s and its three derivatives at given instants [s], shape (4, N)."""
        if self.law is None:
            return np.outer([self.start, 0.0, 0.0, 0.0], np.ones(time.size))
        values = self.law.values(time - self.begin) * (self.end - self.start)
        values[0] += self.start
        return values

    def samples(self, time: Array) -> Samples:
        """The position alone as a motion, from the beginning of the part."""
        return Samples(time, *(row[:, None] for row in self.values(time + self.begin)))

    def steady(self) -> tuple[float, float]:
        """When the speed is constant: the longest piece of the law without acceleration and jerk [s]."""
        assert self.law is not None
        bend = np.abs(self.law.derivative(2)).max(axis=0)
        lengths = np.where(bend <= 1e-9 * bend.max(), np.diff(self.law.breaks), 0.0)
        k = int(np.argmax(lengths))
        return self.begin + float(self.law.breaks[k]), self.begin + float(self.law.breaks[k + 1])


@dataclass(eq=False)
class Runs:
    """Motion of one coordinate, part after part."""

    pace: Pace
    rate: float  # samples per second; every part begins on a sample [Hz]
    parts: list[Part] = field(default_factory=list)  # filled by `go` and `wait`
    steps: int = 0
    at: float = 0.0
    breakaways: list[Part] = field(default_factory=list)  # creeping parts out of the pose and back
    # parts with a window of constant speed, and the speed in percent of the largest one, in the order of execution
    windowed: list[tuple[Part, float]] = field(default_factory=list)
    strokes: dict[float, float] = field(default_factory=dict)  # to both sides of the pose for each speed [%, rad or m]
    left_out: dict[float, str] = field(default_factory=dict)  # speeds that are left out [%], and why

    @property
    def duration(self) -> float:
        """From start to end [s]."""
        return self.steps / self.rate

    def go(self, segment: str, end: float, speed: float) -> Part | None:
        """Append a run to a position with a limited speed; None where it is there already."""
        if abs(end - self.at) <= LEAST_RUN:
            return None
        law = self.pace.law(self.at, end, speed)
        part = Part(segment, self.duration, self.at, end, law)
        self.parts.append(part)
        self.steps += int(np.ceil(law.duration * self.rate))
        self.at = end
        return part

    def wait(self, seconds: float) -> None:
        """Append a rest."""
        self.parts.append(Part(REST, self.duration, self.at, self.at))
        self.steps += int(np.ceil(seconds * self.rate))

    def values(self, time: Array) -> tuple[Array, Index]:
        """Position s and its derivatives at given instants, shape (4, N), and the number of the part of each."""
        begins = np.array([part.begin for part in self.parts])
        number = np.clip(np.searchsorted(begins, time, side="right") - 1, 0, begins.size - 1)
        orders, by_part = np.empty((4, time.size)), np.argsort(number, kind="stable")
        ends = np.cumsum(np.bincount(number, minlength=begins.size))
        for part, here in zip(self.parts, np.split(by_part, ends[:-1]), strict=True):
            orders[:, here] = part.values(time[here])
        return orders, number

    def first_at(self, position: float) -> float:
        """Time at which a position is first passed, or the nearest one if it is not passed at all [rad or m, s]."""

        def beyond(part: Part) -> float:
            low, high = sorted((part.start, part.end))
            return max(low - position, position - high, 0.0)

        part = min(self.parts, key=beyond)
        if part.law is None:
            return part.begin
        early, late = 0.0, part.law.duration
        for _ in range(60):
            middle = 0.5 * (early + late)
            short = abs(part.values(np.array([part.begin + middle]))[0, 0] - part.start) < abs(position - part.start)
            early, late = (middle, late) if short else (early, middle)
        return part.begin + late

    def extrema(self) -> list[Extrema]:
        """Exact extrema of s and its three derivatives over continuous time."""
        extremes = []
        for order in range(4):
            each = [_part_extrema(part, order) for part in self.parts if part.law is not None]
            low, high = (min(each, key=lambda e: e.low[0]), max(each, key=lambda e: e.high[0]))
            extremes.append(Extrema(low.low, high.high, low.low_time, high.high_time))
        return extremes


def _part_extrema(part: Part, order: int) -> Extrema:
    assert part.law is not None
    pieces = part.law.derivative(order)[:, :, None] * (part.end - part.start)
    if order == 0:
        pieces[-1] += part.start
    return piecewise_extrema(part.begin + part.law.breaks, pieces)


def certificates(runs: Runs, pose: Array, motion: PartialMotion, limits: Sequence[LinearConstraint]) -> list[LimitUse]:
    """Use that the motion makes of every limit of joints and drives, exact over continuous time."""
    extrema = runs.extrema()
    line = motion.matrix[:, 0]
    uses = []
    for limit in limits:
        slope, e = limit.matrix @ line, extrema[limit.derivative]
        shift = limit.matrix @ pose + limit.offset if limit.derivative == 0 else np.zeros(len(slope))
        ends = np.stack([slope * e.low[0], slope * e.high[0]]) + shift
        up = slope >= 0.0
        low_time = np.where(up, e.low_time[0], e.high_time[0])
        high_time = np.where(up, e.high_time[0], e.low_time[0])
        uses += limit_uses(limit, Extrema(ends.min(axis=0), ends.max(axis=0), low_time, high_time))
    return uses


_SAME = 9  # digits in which two parts are the same motion


def torque_uses(robot: Robot, runs: Runs, pose: Array, motion: PartialMotion) -> tuple[list[LimitUse], str]:
    """Certificates of all torque limits over continuous time, with the friction of the robot's file; or why not."""
    try:
        limits = torque_limits(robot, standard_values(robot), 0.0, replace(motion, offset=pose))
    except InputError as error:
        return [], str(error)
    torques_used = []
    for part in _different(runs):
        assert part.law is not None
        jerk = np.abs(part.law.derivative(3)).max() * abs(part.end - part.start)
        for limit in limits:
            uses = enclose(limit, part.samples, part.law.duration, np.array([jerk])).uses(limit)
            torques_used += [replace(use, time=use.time + part.begin) for use in uses]
    return worst_of_each(torques_used), ""


def _different(runs: Runs) -> list[Part]:
    """Each motion once, where it is first played."""
    different: dict[tuple[float, ...], Part] = {}
    for part in runs.parts:
        if part.law is not None:
            key = tuple(round(value, _SAME) for value in (part.start, part.end, part.law.duration))
            different.setdefault(key, part)
    return list(different.values())
