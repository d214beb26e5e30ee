"""Nonlinear limits that a task asks for, and a pose that keeps them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from constraints.feasibility.diagnosis import ContradictionError, smallest_relaxation
from constraints.linear import LinearConstraint
from constraints.nonlinear import NonlinearConstraint
from excite.tasks.task import Task
from regressors.models.partial import PartialMotion, of_joints
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

_POSES = 4000
_STARTS = 5
_ROOM = 0.02  # of a limit's scale, distance of an initial pose from the bounds
_AMPLE = 0.25  # the same, with which the centre of the linear limits is accepted


def nonlinear_limits(robot: Robot, joints: tuple[str, ...], task: Task) -> tuple[NonlinearConstraint, ...]:
    """Torque limits, the tool's box and its speed, and distances from obstacles, where a task asks for them."""
    robot = task.limits.applied(robot)
    motion = of_joints(robot, [robot.joint_names.index(name) for name in joints])
    limits = task.limits.imposed(task.known_friction)
    return tuple(constraint for limit in limits for constraint in limit.imposed(robot, motion))


def roomy_pose(
    nonlinear: Sequence[NonlinearConstraint], linear: Sequence[LinearConstraint], motion: PartialMotion, centre: Array
) -> Array:
    """Pose of the moving coordinates with ample margin in every limit, also nonlinear ones; the centre where it has."""
    # centre (k,)
    if not nonlinear:
        return centre
    poses = _poses(linear, centre)
    room = _linear_room(linear, poses)
    least = np.concatenate([*_nonlinear_room(nonlinear, poses, motion), room[:, None]], axis=1).min(axis=1)
    if least[0] >= _AMPLE:
        return centre
    best = np.argsort(-least)[:_STARTS]
    if least[best[0]] >= _ROOM:
        return np.asarray(poses[best[0]])
    pose, needed = smallest_relaxation(nonlinear, linear, motion, poses[best], _ROOM)
    if needed:
        cure = " and ".join(map(str, needed))
        raise ContradictionError(f"no pose keeps all limits; the smallest relaxation found that leaves one: {cure}")
    return pose


def has_room(limits: Sequence[NonlinearConstraint], motion: PartialMotion, pose: Array) -> bool:
    """True if a motion can start from a pose: every nonlinear limit keeps some of its scale there."""  # pose (k,)
    q = motion.matrix @ pose + motion.offset
    return all(_room(limit, limit.at_rest(q)).min() >= _ROOM for limit in limits)


def _nonlinear_room(limits: Sequence[NonlinearConstraint], poses: Array, motion: PartialMotion) -> list[Array]:
    """Distance from the nearer bound as part of the scale, per limit, shape (poses, k)."""
    q = poses @ motion.matrix.T + motion.offset
    zero = np.zeros_like(q)
    return [_room(limit, limit.values(Samples(np.zeros(len(q)), q, zero, zero, zero))) for limit in limits]


def _room(limit: NonlinearConstraint, values: Array) -> Array:
    return np.asarray(np.minimum(limit.upper - values, values - limit.lower) / limit.scale)


def _poses(linear: Sequence[LinearConstraint], centre: Array) -> Array:
    """The centre, and random poses in the ranges of the coordinates that are bounded on their own."""
    low, high = np.full(centre.size, -np.inf), np.full(centre.size, np.inf)
    for limit in linear:
        if limit.derivative == 0:
            for row, offset, lower, upper in zip(limit.matrix, limit.offset, limit.lower, limit.upper, strict=True):
                (moved,) = np.nonzero(row)
                if moved.size == 1:
                    ends = np.sort((np.array([lower, upper]) - offset) / row[moved[0]])
                    low[moved[0]], high[moved[0]] = max(low[moved[0]], ends[0]), min(high[moved[0]], ends[1])
    least = np.maximum(low, np.minimum(-np.pi, high - 2 * np.pi))  # within half a turn of zero, where that is allowed
    most = np.minimum(high, np.maximum(np.pi, low + 2 * np.pi))
    poses = np.random.default_rng(0).uniform(least, most, (_POSES, centre.size))
    return np.vstack([centre, poses])


def _linear_room(linear: Sequence[LinearConstraint], poses: Array) -> Array:
    """Least margin to a position limit, relative to half its range, for each pose."""
    room = np.ones(len(poses))
    for limit in linear:
        if limit.derivative == 0:
            values = poses @ limit.matrix.T + limit.offset
            half = 0.5 * (limit.upper - limit.lower)
            room = np.minimum(room, (np.minimum(limit.upper - values, values - limit.lower) / half).min(axis=1))
    return room
