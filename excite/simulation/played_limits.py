"""Limits that a motion would break if it were played: checked before it is, whatever its file says of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from constraints.bounds.certificate import LimitUse, limit_uses, worst_of_each
from constraints.bounds.extrema import Extrema
from constraints.constraint import Constraint
from constraints.limits.torque import TorqueLimit
from constraints.linear import linear_limits
from excite.design.stated_limits import why_no_torques
from excite.errors import BrokenLimitError
from excite.information.target import moving_robot
from excite.simulation.reference import MotionSource, SampledMotion
from excite.trajectories import Trajectory
from regressors.errors import InputError
from regressors.models.partial import of_joints
from regressors.samples import Array, Samples

_INSTANTS = 4000  # at which torques are looked at, whose extrema have no formula
_BETWEEN = 4  # parts of the step between two samples of a file
_AT_ONCE = 20_000
_ROUNDING = 1e-9  # of a limit that a motion may touch
_INTERPOLATED = 1e-3  # the same of samples


def broken_limits(source: MotionSource) -> tuple[LimitUse, ...]:
    """Limits of positions, velocities, accelerations, jerks and torques that a motion breaks, the worst first.

    Of a motion with coefficients the extrema over continuous time are exact, but for torques, which are looked at at
    4000 instants. A motion from a file is looked at in its samples, positions and velocities also at three instants
    between each two, and may pass a limit by 0.1 %; accelerations between samples depend on what interpolates them, and
    its jerk is not known. Torques count, without a reserve, where the task keeps to their limits and the description
    states what they need; not those of a friction plan.
    """
    return played_uses(source)[1]


def played_uses(source: MotionSource) -> tuple[tuple[LimitUse, ...], tuple[LimitUse, ...]]:
    """Use of each limit of a motion, and those of them that it breaks, the worst first, see `broken_limits`."""
    linear, motion = linear_limits(moving_robot(source.robot, source.task)), source.motion
    if isinstance(motion, Trajectory):
        exact = [use for limit in linear for use in limit_uses(limit, motion.extrema(limit))]
        uses, allowed = [*exact, *_uses_at(source, _torque_limits(source))], _ROUNDING
    else:
        slow, fast = ([limit for limit in linear if limit.derivative in orders] for orders in ((0, 1), (2,)))
        between = _uses_at(source, slow, _BETWEEN)
        uses, allowed = [*between, *_uses_at(source, [*fast, *_torque_limits(source)])], _INTERPOLATED
    worst = tuple(worst_of_each(uses))
    broken = [use for use in worst if use.margin < -allowed * abs(use.bound)]
    return worst, tuple(sorted(broken, key=lambda use: -use.use))


def check_played(source: MotionSource) -> None:
    """Refuse a motion that breaks a limit."""
    broken = broken_limits(source)
    if broken:
        worst, more = broken[0], len(broken) - 1
        others = f"; {more} more limits are broken" if more else ""
        raise BrokenLimitError(
            f"the motion breaks a limit: {worst.label} is {worst.extreme:.4g} {worst.unit} at {worst.time:.3f} s, "
            f"beyond {worst.bound:.4g} {worst.unit} ({100 * worst.use:.4g} % of what is allowed){others}; "
            "`beyond_limits=True` plays it nevertheless"
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


@dataclass
class _Reached:
    """Extrema of a limit's functions at the instants so far."""

    limit: Constraint
    extrema: Extrema | None = None

    def see(self, samples: Samples) -> None:
        """Count further instants."""
        values, columns = self.limit.values(samples), np.arange(len(self.limit.labels))
        lowest, highest = values.argmin(axis=0), values.argmax(axis=0)
        seen = Extrema(values[lowest, columns], values[highest, columns], samples.time[lowest], samples.time[highest])
        self.extrema = seen if self.extrema is None else _joined(self.extrema, seen)


def _joined(one: Extrema, other: Extrema) -> Extrema:
    lower, higher = other.low < one.low, other.high > one.high
    return Extrema(
        np.where(lower, other.low, one.low),
        np.where(higher, other.high, one.high),
        np.where(lower, other.low_time, one.low_time),
        np.where(higher, other.high_time, one.high_time),
    )


def _uses_at(source: MotionSource, limits: Sequence[Constraint], parts: int = 1) -> list[LimitUse]:
    """Use of limits at instants of a motion; of a file, at its samples, with each step in so many parts."""
    reached = [_Reached(limit) for limit in limits]
    for time in _instants(source, parts) if limits else ():
        samples = source.motion.samples(time)
        for each in reached:
            each.see(samples)
    return [use for each in reached if each.extrema is not None for use in limit_uses(each.limit, each.extrema)]


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
