"""The motion as a controller plays it: approach, exciting motion and return, on one uniform grid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

_SAME_INSTANT = 1e-9  # sampling periods
APPROACH, EXCITE, RETURN = SEGMENTS = ("approach", "excite", "return")


class Motion(Protocol):
    """A motion that can be evaluated at any instant, such as `excite.trajectories.Trajectory`."""

    @property
    def duration(self) -> float:
        """Duration from start to end [s]."""

    def samples(self, time: Array) -> Samples:
        """Motion at given instants between 0 and the duration [s]."""


@dataclass(frozen=True, eq=False)
class Rest:
    """Rest in a pose for some time."""

    pose: Array  # (n,) [rad or m]
    duration: float  # [s]

    def samples(self, time: Array) -> Samples:
        """The pose at given instants [s]."""
        still = np.zeros((time.size, self.pose.size))
        return Samples(time, still + self.pose, still, still.copy(), still.copy())


def whole_pose(robot: Robot, joints: tuple[str, ...], q: Array) -> Array:
    """Pose of every joint of a robot; those that are not given rest at zero or at the nearest position limit."""
    # q (..., k)
    rest = np.clip(np.zeros(robot.n), robot.limits.lower, robot.limits.upper)
    pose = np.empty((*np.shape(q)[:-1], robot.n))
    pose[...] = rest
    pose[..., [robot.joint_names.index(name) for name in joints]] = q
    return pose


@dataclass(frozen=True, eq=False)
class WholeRobotMotion:
    """A motion of some joints extended to all joints; the others rest."""

    motion: Motion  # motion of the moving joints
    robot: Robot  # the whole robot
    joints: tuple[str, ...]  # names of the moving joints

    @property
    def duration(self) -> float:
        """Duration from start to end [s]."""
        return self.motion.duration

    def samples(self, time: Array) -> Samples:
        """Motion at given instants [s]."""
        whole = self.motion.samples(time)
        rates = np.zeros((3, time.size, self.robot.n))
        index = [self.robot.joint_names.index(name) for name in self.joints]
        rates[:, :, index] = [whole.dq, whole.ddq, whole.dddq]
        return Samples(time, whole_pose(self.robot, self.joints, whole.q), *rates)


_PEAK = 1.875  # of the speed of ``10 u^3 - 15 u^4 + 6 u^5`` over its mean


@dataclass(frozen=True, eq=False)
class Retimed:
    """A motion along its path with another timing: ``q(s(t))`` with ``0 <= s' <= 1``, at rest at both ends.

    It moves for some time, holds, and so on; positions and distances are those of the motion, no velocity is higher.
    """

    motion: Motion
    speed: float  # largest s'
    move: float  # [s]
    hold: float  # [s]
    rate: float  # [Hz]

    @property
    def count(self) -> int:
        """Number of moves."""
        return int(np.ceil(self.motion.duration * _PEAK / (self.speed * self.move) - 1e-9))

    @property
    def duration(self) -> float:
        """Duration, a whole number of samples [s]."""
        return float(np.ceil(self.count * (self.move + self.hold) * self.rate - 1e-6)) / self.rate

    def samples(self, time: Array) -> Samples:
        """Motion at given instants [s]."""
        number = np.minimum(np.floor(time / (self.move + self.hold)), self.count - 1)
        u = np.minimum((time - number * (self.move + self.hold)) / self.move, 1.0)
        part, rest = self.motion.duration / self.count, 1.0 - u
        s = part * (number + u**3 * (10.0 - 15.0 * u + 6.0 * u**2))
        first = (part / self.move * 30.0 * (u * rest) ** 2)[:, None]
        second = (part / self.move**2 * 60.0 * u * rest * (1.0 - 2.0 * u))[:, None]
        third = (part / self.move**3 * 60.0 * (1.0 - 6.0 * u * rest))[:, None] * (u < 1.0)[:, None]
        along = self.motion.samples(s)
        ddq = along.ddq * first**2 + along.dq * second
        dddq = along.dddq * first**3 + 3.0 * along.ddq * first * second + along.dq * third
        return Samples(time, along.q, along.dq * first, ddq, dddq)


_SLOW = (0.75, 2.5)  # largest s', and how many times as long as the motion it lasts
_MOVE, _HOLD = 0.8, 0.6  # [s]
_GENTLER, _LEAST = 1.4, 0.05  # speed over the next one that is tried; the least
_DENSE = 0.005  # between the instants at which limits are looked at [s]


def again(motion: Motion, rate: float, kept: Callable[[Samples], bool]) -> tuple[Motion, ...]:
    """The motion slowly, and with stops, which show what holds a joint; gentler until limits are kept."""
    speed, longer = _SLOW
    slow, stops = (speed, longer * motion.duration, 0.0), (1.0, _MOVE, _HOLD)
    return tuple(_gentle(Retimed(motion, *each, rate), kept) for each in (slow, stops))


def _gentle(motion: Retimed, kept: Callable[[Samples], bool]) -> Retimed:
    while not kept(motion.samples(np.arange(0.0, motion.duration, _DENSE))) and motion.speed > _LEAST:
        motion = replace(motion, speed=motion.speed / _GENTLER, move=motion.move * _GENTLER)
    return motion


@dataclass(frozen=True, eq=False)
class Piece:
    """A part of the motion."""

    segment: str
    motion: Motion
    steps: int  # number of sampling periods that it lasts


@dataclass(frozen=True, eq=False)
class MotionSequence:
    """Pieces in sequence, each beginning on a sample."""

    pieces: tuple[Piece, ...]

    @property
    def steps(self) -> int:
        """Number of sampling periods."""
        return sum(piece.steps for piece in self.pieces)

    @property
    def duration(self) -> float:
        """Duration from start to end at full speed [s]."""
        return self._seconds(self.steps)

    def _seconds(self, steps: int) -> float:
        """Duration of a number of the exciting motion's sampling periods [s]."""
        motion = next(piece for piece in self.pieces if piece.segment == EXCITE)
        return motion.motion.duration * steps / motion.steps

    def spans(self) -> dict[str, tuple[float, float]]:
        """Start and end of each existing segment at full speed [s]."""
        times: dict[str, tuple[float, float]] = {}
        at = 0
        for piece in self.pieces:
            first = times.get(piece.segment, (self._seconds(at), 0.0))[0]
            at += piece.steps
            times[piece.segment] = (first, self._seconds(at))
        return times

    def speed(self, wanted: float) -> float:
        """Largest fraction of full speed, at most ``wanted``, at which the end falls on a sample."""
        return self.steps / self._count(wanted)

    def at(self, time: Array) -> tuple[Samples, list[str]]:
        """The motion at full speed at given instants, each piece by its own formula, and the segment of each instant.

        Beyond the end it rests in the end pose. Instants where segments meet belong to ``excite``.
        """  # time (N,), not negative, not decreasing [s]
        ends = np.array([self._seconds(steps) for steps in np.cumsum([piece.steps for piece in self.pieces])])
        near = _SAME_INSTANT * self._seconds(1)
        times = []
        first, begin = 0, 0.0
        for number, (piece, end) in enumerate(zip(self.pieces, ends, strict=True)):
            edge = end - near if piece.segment == APPROACH else end + near
            last = time.size if number == ends.size - 1 else int(np.searchsorted(time, edge))
            local = time[first:last] - begin
            local[local <= near] = 0.0
            local[local >= end - begin - near] = piece.motion.duration
            times.append(local)
            first, begin = last, end
        motion, segments = self._evaluated(times)
        return Samples(time, *motion), segments

    def _evaluated(self, times: list[Array]) -> tuple[list[Array], list[str]]:
        """Position and its derivatives, and the segment, at instants of each piece from its own start [s]."""
        parts = [piece.motion.samples(time) for piece, time in zip(self.pieces, times, strict=True)]
        segments = [piece.segment for piece, time in zip(self.pieces, times, strict=True) for _ in range(time.size)]
        return [np.concatenate([getattr(p, name) for p in parts]) for name in ("q", "dq", "ddq", "dddq")], segments

    def _count(self, speed: float) -> int:
        return int(np.ceil(self.steps / speed * (1.0 - 1e-12)))

    def sampled(self, wanted: float = 1.0) -> tuple[Samples, list[str]]:
        """The motion at every sample, and the segment that each one belongs to.

        At a fraction v of full speed the motion is ``q(v t)``: the same path with velocities times v, accelerations
        times v^2 and jerks times v^3, for a wanted v in (0, 1], see `speed`. Samples where segments meet belong to
        ``excite``.
        """
        count = self._count(wanted)
        at = np.arange(count + 1) * self.steps / count  # in sampling periods of full speed
        times, begin, before = [], 0, APPROACH
        for piece in self.pieces:
            end = begin + piece.steps
            first = np.searchsorted(at, begin, side="left" if before == APPROACH else "right")
            last = np.searchsorted(at, end, side="left" if piece.segment == APPROACH else "right")
            local = (at[first:last] - begin) * (piece.motion.duration / piece.steps)
            local[at[first:last] == end] = piece.motion.duration
            times.append(local)
            begin, before = end, piece.segment
        motion, segments = self._evaluated(times)
        speed = self.steps / count
        slowed = [orders * speed**order for order, orders in enumerate(motion)]
        return Samples(np.linspace(0.0, self.duration / speed, count + 1), *slowed), segments
