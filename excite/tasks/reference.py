"""Reference motions, from a design or a file: anything that can be sampled at any time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import scipy

from constraints.certificate import Extrema, LimitUse, limit_uses, worst_of_each
from constraints.closed_loops import dependent_limits, free_limits
from constraints.interpolation import Curve, curve_pieces
from constraints.linear import Constraint, linear_limits
from constraints.torque import TorqueLimit, why_no_torques
from excite.errors import BrokenLimitError
from excite.tasks.robot_of_task import moving_robot
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from excite.trajectories.sequence import Motion
from regressors.errors import InputError
from regressors.models.partial import of_joints
from regressors.robot.robot import Robot
from regressors.samples import Array, Index, Samples

_CLOSED = 1e-6  # rad or m
Reference = Motion  # which a controller follows


@dataclass(frozen=True, eq=False)
class Repeated:
    """A motion repeated several times in sequence, preceded by rest at its start."""

    motion: Reference  # at rest at its start, if it waits there
    periods: int
    wait: float = 0.0  # [s]

    def __post_init__(self) -> None:
        ends = self.motion.samples(np.array([0.0, self.motion.duration])).q
        gap = float(np.abs(ends[1] - ends[0]).max())
        if self.periods > 1 and gap > _CLOSED:
            raise InputError(
                f"a motion that ends {gap:.3g} rad (m) from where it starts cannot be repeated; play it once"
            )

    @property
    def duration(self) -> float:
        """Duration of rest and all periods together [s]."""
        return self.wait + self.periods * self.motion.duration

    def samples(self, time: Array) -> Samples:
        """Rest, then the motion, at given instants [s]; the last of its poses afterwards."""
        period, since = self.motion.duration, np.maximum(time - self.wait, 0.0)
        whole = np.clip(np.floor(since / period), 0, self.periods - 1)
        samples = self.motion.samples(np.clip(since - whole * period, 0.0, period))
        moving = (time >= self.wait)[:, None]
        return Samples(time, samples.q, *(np.where(moving, x, 0.0) for x in (samples.dq, samples.ddq, samples.dddq)))


@dataclass(frozen=True, eq=False)
class SampledMotion:
    """Motion interpolated between samples by quintics with their positions, velocities and accelerations."""

    given: Samples  # two or more, at increasing times; their jerk is not used

    def __post_init__(self) -> None:
        if self.given.time.size < 2 or not np.all(np.diff(self.given.time) > 0):
            raise InputError("a sampled motion needs two samples or more at increasing times")

    @property
    def duration(self) -> float:
        """Duration from the first sample to the last [s]."""
        return float(self.given.time[-1] - self.given.time[0])

    def samples(self, time: Array) -> Samples:
        """Motion at given instants [s], counted from the first sample."""
        instants = np.asarray(time, dtype=float)
        return Samples(instants, *(self._curve(instants, nu=order) for order in range(4)))

    @cached_property
    def _curve(self) -> scipy.interpolate.PPoly:
        """Positions over time from the first sample."""
        return scipy.interpolate.PPoly(curve_pieces(self.given, Curve.QUINTICS), self.given.time - self.given.time[0])


@dataclass(frozen=True, eq=False)
class MotionSource:
    """A motion and its origin."""

    robot: Robot  # the whole robot
    task: Task  # gives the moving joints
    motion: Reference
    ramps: GivenTorque | None
    file: Path | None  # of the motion, where it is not the design's own
    origin: Mapping[str, Any]  # design or friction plan, for the sidecar of a log

    @property
    def planned(self) -> bool:
        """True if the motion is from a friction plan."""
        return self.origin["friction_plan"] is not None


_INSTANTS = 4000  # at which torques are looked at, whose extrema have no formula
_BETWEEN = 4  # parts of the step between two samples of a file
_AT_ONCE = 20_000
_ROUNDING = 1e-9  # of a limit that a motion may touch, and s by which an instant may precede its sample
_INTERPOLATED = 1e-3  # the same of samples


def broken_limits(source: MotionSource) -> tuple[LimitUse, ...]:
    """Limits of positions, velocities, accelerations, jerks and torques that a motion breaks, the worst first."""
    return played_uses(source)[1]


def played_uses(source: MotionSource) -> tuple[tuple[LimitUse, ...], tuple[LimitUse, ...]]:
    """Use of each limit of a motion, and those of them that it breaks, the worst first."""
    # Of a motion with coefficients the extrema over continuous time are exact, but for torques. One from a file is
    # looked at in its samples, positions and velocities also between them, and may pass a limit by 0.1 %: accelerations
    # between samples depend on what interpolates them, and its jerk is not known.
    moving, motion = moving_robot(source.robot, source.task), source.motion
    if isinstance(motion, Trajectory):
        exact = [use for limit in free_limits(moving) for use in limit_uses(limit, motion.extrema(limit))]
        others = [*dependent_limits(moving), *_torque_limits(source)]
        uses, allowed = [*exact, *_uses_at(source, others)], _ROUNDING
    else:
        linear = linear_limits(moving)
        slow, fast = ([limit for limit in linear if limit.derivative in orders] for orders in ((0, 1), (2,)))
        between = _uses_at(source, slow, _BETWEEN)
        uses, allowed = [*between, *_uses_at(source, [*fast, *_torque_limits(source)])], _INTERPOLATED
    worst = tuple(worst_of_each(uses))
    broken = [use for use in worst if use.margin < -allowed * abs(use.bound)]
    return worst, tuple(sorted(broken, key=lambda use: -use.use))


def check_played(source: MotionSource) -> None:
    """Refuse a motion that breaks a limit."""
    if broken := broken_limits(source):
        refuse_broken(broken, "`beyond_limits=True` plays it nevertheless")


def refuse_broken(broken: Sequence[LimitUse], remedy: str) -> NoReturn:
    """Raise `BrokenLimitError` for limits that a motion breaks, the worst first."""
    worst, more = broken[0], len(broken) - 1
    others = f"; {more} more limits are broken" if more else ""
    raise BrokenLimitError(
        f"the motion breaks a limit: {worst.label} is {worst.extreme:.6g} {worst.unit} at {worst.time:.3f} s, beyond "
        f"{worst.bound:.6g} {worst.unit} ({100 * worst.use:.6g} % of what is allowed){others}; {remedy}"
    )


def _torque_limits(source: MotionSource) -> Sequence[Constraint]:
    """Limits of torques as functions of the moving joints; none where they are not checked."""
    robot, task = source.robot, source.task
    if source.planned or task.limits.torque_margin is None or why_no_torques(robot) is not None:
        return ()
    joints = moving_robot(robot, task).joint_names
    motion = of_joints(robot, [robot.joint_index(name) for name in joints])
    try:
        return TorqueLimit(0.0, task.known_friction).imposed(task.limits.applied(robot), motion)
    except InputError:  # the description does not state what they need; the design says so
        return ()


def _extended(before: Extrema | None, values: Array, time: Array) -> Extrema:
    """Extrema of functions, shape (N, k), at further instants too."""
    times = np.broadcast_to(time[:, None], values.shape)
    if before is not None:
        values = np.vstack([before.low, before.high, values])
        times = np.vstack([before.low_time, before.high_time, times])
    return Extrema.among(values.T, times.T)


def _uses_at(source: MotionSource, limits: Sequence[Constraint], parts: int = 1) -> list[LimitUse]:
    """Use of limits at instants of a motion; of a file, at its samples, with each step in so many parts."""
    extrema: list[Extrema | None] = [None] * len(limits)
    for time in _instants(source, parts) if limits else ():
        samples = source.motion.samples(time)
        for k, limit in enumerate(limits):
            extrema[k] = _extended(extrema[k], limit.values(samples), samples.time)
    reached = zip(limits, extrema, strict=True)
    return [use for limit, found in reached if found is not None for use in limit_uses(limit, found)]


def _instants(source: MotionSource, parts: int) -> Iterator[Array]:
    """Instants to look at, some at a time."""
    if isinstance(source.motion, SampledMotion):
        given = source.motion.given.time
        steps = (given.size - 1) * parts
        instants = np.interp(np.arange(steps + 1) / parts, np.arange(given.size), given - given[0])
    else:
        instants = np.linspace(0.0, source.motion.duration, _INSTANTS + 1)
    for first in range(0, instants.size, _AT_ONCE):
        yield instants[first : first + _AT_ONCE]


@dataclass(frozen=True, eq=False)
class GivenTorque:
    """Prescribed torque of one drive over time; outside the ramps its position is controlled."""

    drive: str  # name of the drive, or of the joint where the robot has no transmission
    time: Array  # (N,) increasing [s]
    torque: Array  # (N,) torque in addition to the compensation of gravity [Nm or N]; linear in between
    number: Index  # (N,) 1, 2, ... in the ramps, 0 between them

    @property
    def count(self) -> int:
        """Number of ramps."""
        return int(self.number.max(initial=0))

    def delayed(self, wait: float) -> GivenTorque:
        """The same ramps after some time of rest [s]."""
        return replace(self, time=self.time - self.time[0] + wait)

    def at(self, time: Array) -> Array:
        """Torques and numbers of ramps at given instants [s], shape (N, 2); zero before and after."""
        k = np.searchsorted(self.time, time + _ROUNDING, side="right") - 1
        here = (k >= 0) & (time <= self.time[-1] + _ROUNDING)
        torques = np.column_stack([np.interp(time, self.time, self.torque), self.number[k]])
        return np.asarray(np.where(here[:, None], torques, 0.0))
