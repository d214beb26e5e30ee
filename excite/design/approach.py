"""Approach from home to the start of a motion, and return from its end to home."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from constraints.certificate import LimitUse
from constraints.enclosure import uses_of
from constraints.linear import linear_limits
from constraints.nonlinear import NonlinearConstraint
from excite.storage.codec import record_of
from excite.tasks.task import Task
from excite.trajectories.detours import detour
from excite.trajectories.sequence import APPROACH, RETURN, MotionSequence, Piece, Rest, whole_pose
from excite.trajectories.transfer import BUILDING_UP, SPEEDING_UP, Transfer, check_pose, quickest_transfer
from regressors.errors import InputError
from regressors.robot.robot import Robot, finite_ranges
from regressors.samples import Array

_SAME = 1e-6  # rad or m: poses that are written and read again
_SLOWEST = 30.0  # times the shortest duration: if that does not help, slower transfers do not either


@dataclass(frozen=True, eq=False)
class ApproachAndReturn:
    """Transfers from home to the motion and back, each a whole number of samples long."""

    transfers: dict[str, Transfer]  # per segment; none where the motion starts, or ends, at home
    settle: int  # number of sampling periods of rest between them and the motion
    rate: float  # [Hz]
    limits: dict[str, tuple[LimitUse, ...]]  # per segment: limits over continuous time

    @classmethod
    def of(cls, played: Mapping[str, Any]) -> ApproachAndReturn | None:
        """Those that the entry ``played`` of a ``design.json`` describes; None where it has none."""
        rate = float(played["rate"])
        transfers = {name: Transfer.of(played[name]) for name in (APPROACH, RETURN) if name in played}
        if not transfers:
            return None
        spans = {each["name"]: float(each["end"]) - float(each["start"]) for each in played["segments"]}
        settle = max(round((spans[name] - transfer.duration) * rate) for name, transfer in transfers.items())
        return cls(transfers, settle, rate, stated_on_transfers(played))

    def check_joined(self, ends: Array) -> None:
        """Raise `InputError` where they do not meet the motion."""  # ends (2, n)
        meets = {APPROACH: (-1, ends[0]), RETURN: (0, ends[1])}
        for name, transfer in self.transfers.items():
            place, pose = meets[name]
            gap = float(np.abs(transfer.poses[place] - pose).max())
            if not gap <= _SAME:
                raise InputError(
                    f"the {name} does not meet the motion, by {gap:.3g} rad (m): the entry 'trajectory' or 'played' "
                    "was changed after the design was written; restore the file, or design the motion again"
                )

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on assumptions."""
        transfers = self.transfers.values()
        if not transfers:
            return ("the motion starts and ends at home: no approach and no return are needed",)
        notes, kinds = [], (("acceleration", "velocity", SPEEDING_UP), ("jerk", "acceleration", BUILDING_UP))
        for quantity, known, seconds in kinds:
            if joints := list(dict.fromkeys(name for way in transfers for name in way.assumed[quantity])):
                notes.append(
                    f"no {quantity} limit is known for {', '.join(joints)}: approach and return reach the "
                    f"{known} limit in {seconds:g} s or later; give one with `{quantity}`"
                )
        return tuple(notes)

    def to_dict(self) -> dict[str, object]:
        """Approach and return with their limits, for JSON."""
        return {
            segment: {**transfer.to_dict(), "limits": [use.to_dict() for use in self.limits[segment]]}
            for segment, transfer in self.transfers.items()
        }

    def sequence(self, between: Sequence[Piece]) -> MotionSequence:
        """The approach, motions of every joint, and the return."""
        before, after = self._pieces(APPROACH, -1), self._pieces(RETURN, 0)
        return MotionSequence((*before, *between, *reversed(after)))

    def _pieces(self, segment: str, end: int) -> list[Piece]:
        """A transfer, if there is one, then rest at one of its ends."""
        if (transfer := self.transfers.get(segment)) is None:
            return []
        moving = Piece(segment, transfer, round(transfer.duration * self.rate))
        rest = Piece(segment, Rest(transfer.poses[end], self.settle / self.rate), self.settle)
        return [moving, rest] if self.settle else [moving]


def stated_on_transfers(played: Mapping[str, Any]) -> dict[str, tuple[LimitUse, ...]]:
    """Limits on approach and return that a ``design.json`` states, per segment."""
    there = [name for name in (APPROACH, RETURN) if name in played]
    return {name: tuple(record_of(LimitUse, use, {}) for use in played[name]["limits"]) for name in there}


def approach_and_return(
    robot: Robot, task: Task, joints: tuple[str, ...], ends: Array, nonlinear: Sequence[NonlinearConstraint]
) -> ApproachAndReturn | None:
    """Quickest approach from a task's home to a motion, and return, on straight lines in joint space through its poses.

    Where an obstacle blocks a line, poses around it are found. Transfers are slowed down as limits of torques and of
    the tool require, if that helps; their certificate states whether all limits are kept. Every phase of constant jerk
    is made longer, never shorter, until it is a whole number of sampling periods.
    """  # ends (2, k)
    if task.output.home is None:
        return None
    limited = task.limits.applied(robot)
    linear = linear_limits(limited)
    poses = _waypoints(limited, task, nonlinear)
    start, end = whole_pose(limited, joints, ends)
    routes = [_around([*poses, target], limited, nonlinear, task.search.seed) for target in (start, end)]
    rate = task.output.rate
    transfers = {}
    for segment, route in ((APPROACH, routes[0]), (RETURN, routes[1][::-1])):
        if (quickest := quickest_transfer(route, linear, robot.joint_names)) is not None:
            transfers[segment] = _on_samples(quickest, nonlinear, rate)
    settle = math.ceil(task.output.settle * rate * (1.0 - 1e-12))  # the fewest periods that last as long
    limits = {name: uses_of(transfer, linear, nonlinear) for name, transfer in transfers.items()}
    return ApproachAndReturn(transfers, settle, rate, limits)


def _around(route: list[Array], robot: Robot, nonlinear: Sequence[NonlinearConstraint], seed: int) -> list[Array]:
    """The route with poses added where a straight line is blocked."""
    if not nonlinear:
        return route
    linear, ranges = linear_limits(robot), finite_ranges(robot)
    route_poses = [route[0]]
    for pose in route[1:]:
        route_poses += [*(detour(route_poses[-1], pose, linear, nonlinear, *ranges, seed) or ()), pose]
    return route_poses


def check_home(
    robot: Robot, task: Task, joints: tuple[str, ...], q: Array, nonlinear: Sequence[NonlinearConstraint]
) -> None:
    """Raise `InputError` where no approach can lead from a task's home to a motion, before the motion is known."""
    # q (k,)
    if task.output.home is None:
        return
    limited = task.limits.applied(robot)
    poses = _waypoints(limited, task, nonlinear)
    quickest_transfer([*poses, whole_pose(limited, joints, q)], linear_limits(limited), robot.joint_names)


def _waypoints(robot: Robot, task: Task, nonlinear: Sequence[NonlinearConstraint]) -> list[Array]:
    """Home, then the via poses, all within the limits."""
    home = robot.home if isinstance(task.output.home, str) else task.output.home
    if home is None:
        raise InputError(f"home: the description of robot {robot.name!r} has no home pose; give a pose")
    named = [("home", home), *((f"via {k}", pose) for k, pose in enumerate(task.output.via, 1))]
    poses = []
    for name, given in named:
        if len(given) != robot.n:
            raise InputError(
                f"{name} needs {robot.n} numbers, one for each of the joints {', '.join(robot.joint_names)}; "
                f"given {len(given)}"
            )
        pose = np.array(given, dtype=float)
        check_pose(pose, name, [*linear_limits(robot), *nonlinear])
        poses.append(pose)
    return poses


def _on_samples(transfer: Transfer, limits: Sequence[NonlinearConstraint], rate: float) -> Transfer:
    """The transfer as slow as the limits require; its jerk changes on samples, so that interpolation keeps limits."""
    transfer = _slow_enough(transfer, limits)
    return replace(transfer, legs=tuple(replace(leg, law=leg.law.on_grid(1.0 / rate)) for leg in transfer.legs))


def _slow_enough(transfer: Transfer, limits: Sequence[NonlinearConstraint]) -> Transfer:
    """A transfer slowed down as the limits require, to within 1 %; unchanged where slowing down does not help."""
    if _keeps(transfer, limits) or not _keeps(transfer.stretched(_SLOWEST * transfer.duration), limits):
        return transfer
    fast, slow = 1.0, _SLOWEST
    while slow > 1.01 * fast:
        middle = math.sqrt(fast * slow)
        enough = _keeps(transfer.stretched(middle * transfer.duration), limits)
        fast, slow = (fast, middle) if enough else (middle, slow)
    return transfer.stretched(slow * transfer.duration)


def _keeps(transfer: Transfer, limits: Sequence[NonlinearConstraint]) -> bool:
    return all(use.holds for use in uses_of(transfer, (), limits))
