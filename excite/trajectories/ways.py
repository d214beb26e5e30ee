"""The way in from home to where a motion starts, and the way out from its end back home."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from constraints.certificate import LimitUse, limit_uses
from constraints.enclosure import enclosed
from constraints.linear import linear_limits
from constraints.nonlinear import NonlinearConstraint
from excite.task import Task
from excite.trajectories.played import APPROACH, EXCITE, RETURN, Motion, Piece, PlayedMotion, Rest, whole_pose
from excite.trajectories.transfer import BUILDING_UP, SPEEDING_UP, Transfer, check_pose, quickest_transfer
from regressors.errors import InputError
from regressors.robot import Robot
from regressors.samples import Array, Samples


@dataclass(frozen=True, eq=False)
class Ways:
    """Transfers from home to the motion and back, each a whole number of samples long.

    Parameters
    ----------
    approach, back : Transfer or None
        None where the motion starts, or ends, at home.
    settle : int
        Number of sampling periods of rest between them and the motion.
    rate : float
        [Hz]
    limits : dict of str to tuple of LimitUse
        Per segment: limits over continuous time.
    unseen : tuple of str
        Joints that move on the ways only, where there are limits of torques or of the tool, which do not see them.
    """

    approach: Transfer | None
    back: Transfer | None
    settle: int
    rate: float
    limits: dict[str, tuple[LimitUse, ...]]
    unseen: tuple[str, ...] = ()

    @property
    def transfers(self) -> dict[str, Transfer]:
        """Those that there are, per segment."""
        found = {APPROACH: self.approach, RETURN: self.back}
        return {segment: transfer for segment, transfer in found.items() if transfer is not None}

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed."""
        ways = self.transfers.values()
        if not ways:
            return ("home is where the motion starts and ends: there is no way in or out",)
        notes = []
        for quantity, known, seconds in (
            ("acceleration", "velocity", SPEEDING_UP),
            ("jerk", "acceleration", BUILDING_UP),
        ):
            if joints := list(dict.fromkeys(name for way in ways for name in way.assumed[quantity])):
                notes.append(
                    f"no {quantity} limit is known for {', '.join(joints)}: the ways from and to home reach the "
                    f"{known} limit in {seconds:g} s or later; --{quantity}-limit gives one"
                )
        if self.unseen:
            notes.append(
                "limits of torques and of the tool are not checked on the ways from and to home, where "
                f"{', '.join(self.unseen)} moves too, which the exciting motion holds"
            )
        return tuple(notes)

    def to_dict(self) -> dict[str, object]:
        """Each way with its limits, for JSON."""
        return {
            segment: {**transfer.to_dict(), "limits": [use.to_dict() for use in self.limits[segment]]}
            for segment, transfer in self.transfers.items()
        }

    def played(self, motion: Motion, steps: int) -> PlayedMotion:
        """The way in, a motion, and the way out.

        Parameters
        ----------
        motion : Motion
            Of every joint, from where the way in ends to where the way out starts.
        steps : int
            Number of its sampling periods.
        """
        pieces = [Piece(EXCITE, motion, steps)]
        if self.approach is not None:
            pieces = [*self._pieces(APPROACH, self.approach, self.approach.poses[-1]), *pieces]
        if self.back is not None:
            pieces += reversed(self._pieces(RETURN, self.back, self.back.poses[0]))
        return PlayedMotion(tuple(pieces))

    def _pieces(self, segment: str, transfer: Transfer, pose: Array) -> list[Piece]:
        """A transfer, then rest in a pose."""
        moving = Piece(segment, transfer, round(transfer.duration * self.rate))
        rest = Piece(segment, Rest(pose, self.settle / self.rate), self.settle)
        return [moving, rest] if self.settle else [moving]


def ways_of(
    robot: Robot,
    task: Task,
    joints: tuple[str, ...],
    ends: Array,
    nonlinear: Sequence[NonlinearConstraint] = (),
) -> Ways | None:
    """Quickest ways from a task's home to a motion and back, on straight lines in joint space through its poses.

    Each is stretched to a whole number of sampling periods; it becomes slower, never faster.

    Parameters
    ----------
    robot : Robot
        The whole robot.
    task : Task
    joints : tuple of str
        Names of the k joints that the motion moves.
    ends : ndarray, shape (2, k)
        Where the motion starts and ends [rad or m].
    nonlinear : sequence of NonlinearConstraint
        On those joints; the ways are judged by them, where no other joint moves, but not planned by them.

    Returns
    -------
    Ways or None
        None if the task has no home.

    Raises
    ------
    InputError
        A pose of another number of joints or outside the position limits (which, by how much), or a joint that no
        limit bounds.
    """
    if task.home is None:
        return None
    robot = task.limits.applied(robot)
    limits = linear_limits(robot)
    poses = [_pose(robot, task.home, "home"), *(_pose(robot, pose, f"via {k}") for k, pose in enumerate(task.via, 1))]
    start, end = whole_pose(robot, joints, ends)
    approach, back = (
        _on_samples(quickest_transfer(route, limits, robot.joint_names), task.rate)
        for route in ([*poses, start], [end, *reversed(poses)])
    )
    ways = Ways(approach, back, _periods(task.settle, task.rate), task.rate, {})
    others = {name for transfer in ways.transfers.values() for name in transfer.moving(robot.joint_names)} - {*joints}
    index = [robot.joint_names.index(name) for name in joints]
    limits_of = {
        segment: (
            *(use for limit in limits for use in limit_uses(limit, transfer.extrema(limit))),
            *(use for limit in (() if others else nonlinear) for use in _enclosed(transfer, limit, index)),
        )
        for segment, transfer in ways.transfers.items()
    }
    return replace(ways, limits=limits_of, unseen=tuple(sorted(others)) if nonlinear else ())


def _enclosed(transfer: Transfer, limit: NonlinearConstraint, index: list[int]) -> list[LimitUse]:
    """What a transfer makes of a limit on some of the joints."""

    def motion(time: Array) -> Samples:
        found = transfer.samples(time)
        return Samples(time, *(np.ascontiguousarray(x[:, index]) for x in (found.q, found.dq, found.ddq, found.dddq)))

    return enclosed(limit, motion, transfer.duration, transfer.jerk[index]).uses(limit)


def _periods(seconds: float, rate: float) -> int:
    """Fewest sampling periods that last so long."""
    return math.ceil(seconds * rate * (1.0 - 1e-12))


def _on_samples(transfer: Transfer | None, rate: float) -> Transfer | None:
    """A transfer that ends on a sample."""
    return None if transfer is None else transfer.stretched(_periods(transfer.duration, rate) / rate)


def _pose(robot: Robot, given: Sequence[float], name: str) -> Array:
    if len(given) != robot.n:
        raise InputError(
            f"{name} needs {robot.n} numbers, one for each of the joints {', '.join(robot.joint_names)}; "
            f"given {len(given)}"
        )
    pose = np.array(given, dtype=float)
    check_pose(pose, name, linear_limits(robot))
    return pose
