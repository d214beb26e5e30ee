"""Limits that hold by default: of torques and of self-collision, where the description allows it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from constraints.collision.collision_limits import Clearance, SelfCollisions
from constraints.collision.geometry import World
from constraints.nonlinear import NonlinearConstraint
from excite.design.unchecked import Unchecked
from excite.registry import built_in, name_of, part
from excite.tasks.limit_choice import TORQUE_MARGIN
from excite.tasks.stored_files import StoredRobot
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.models.partial import PartialMotion, of_joints
from regressors.robot.plausibility import implausible_inertias
from regressors.robot.robot import Robot

_NAMED = 3
_CONTACT = 0.001  # m: less is contact


@dataclass(frozen=True, eq=False)
class StatedLimits:
    """Limits that hold by default.

    Parameters
    ----------
    constraints : tuple of NonlinearConstraint
        Empty where they are not checked, or where the task asks for them itself.
    unchecked : tuple of Unchecked
        Those that are not checked, and why.
    notes : tuple of str
        What is assumed.
    """

    constraints: tuple[NonlinearConstraint, ...] = ()
    unchecked: tuple[Unchecked, ...] = ()
    notes: tuple[str, ...] = ()


def stated_limits(
    robot: Robot, joints: tuple[str, ...], task: Task, shape: World | Unchecked | None = None
) -> StatedLimits:
    """Limits of torques and of self-collision, where the task leaves them to the description.

    Parameters
    ----------
    robot : Robot
        The whole robot.
    joints : tuple of str
        Names of the joints that move, which the constraints are functions of.
    task : Task
    shape : World or Unchecked, optional
        See `shape_of`; looked up if not given.
    """
    parts = [_torques(robot, joints, task)]
    if task.limits.world is None:
        parts.append(_self_collision(robot, joints, task, shape_of(task) if shape is None else shape))
    return StatedLimits(
        tuple(limit for part in parts for limit in part.constraints),
        tuple(each for part in parts for each in part.unchecked),
        tuple(note for part in parts for note in part.notes),
    )


def remedy(label: str, stated: tuple[NonlinearConstraint, ...], task: Task) -> str:
    """End of a message on a motion that breaks a limit, where the solver was never told of it; empty otherwise.

    Parameters
    ----------
    label : str
        Of the limit.
    stated : tuple of NonlinearConstraint
        Those that hold by default.
    task : Task
    """
    limit = next((limit for limit in stated if label in limit.labels), None)
    if limit is None or part("solver", task.search.solver).takes_nonlinear_limits:
        return ""
    left_out = "`self_collision=False`" if isinstance(limit, Clearance) else "`torque_margin='none'`"
    return (
        f"; the solver {name_of(task.search.solver)} does not take this limit, which holds by default: "
        f"`solver='sqp'` keeps it, {left_out} leaves it out"
    )


def _torques(robot: Robot, joints: tuple[str, ...], task: Task) -> StatedLimits:
    if task.limits.torque_margin is None:
        return StatedLimits(unchecked=(Unchecked("torque", "left out on request"),))
    limit = task.limits.stated_torque(task.known_friction)
    if limit is None:
        return StatedLimits()
    reason = why_no_torques(robot)
    if reason is None:
        try:
            constraints = limit.imposed(task.limits.applied(robot), _motion(robot, joints))
        except InputError as error:
            reason = str(error)
    if reason is not None:
        return StatedLimits(unchecked=(Unchecked("torque", reason),))
    note = (
        f"the design keeps {100 * TORQUE_MARGIN:g} % of the torque limits in reserve, computed from the known "
        "masses and friction; `torque_margin` changes the reserve"
    )
    return StatedLimits(tuple(constraints), (), (note,))


def _motion(robot: Robot, joints: tuple[str, ...]) -> PartialMotion:
    return of_joints(robot, [robot.joint_names.index(name) for name in joints])


def why_no_torques(robot: Robot) -> str | None:
    """Why limits of torques cannot be checked; None if they can.

    Parameters
    ----------
    robot : Robot
        The whole robot.
    """
    drives = robot.transmission
    of_drives = drives is not None and bool(np.any(np.isfinite(drives.limits.torque)))
    if not of_drives and not np.any(np.isfinite(robot.limits.torque)):
        return "no limit is stated"
    doubts = implausible_inertias(robot)
    if not doubts:
        return None
    shown = [f"{name}: {reason}" for name, reason in list(doubts.items())[:_NAMED]]
    more = f", and {len(doubts) - _NAMED} more" if len(doubts) > _NAMED else ""
    return f"inertial parameters are not plausible: {'; '.join(shown)}{more}"


def shape_of(task: Task) -> World | Unchecked:
    """Shape of the robot that a task names, for the check of self-collision; why it is not checked if it is not.

    Parameters
    ----------
    task : Task
        Its robot is the name of a file, or there is no shape.
    """
    if not task.limits.self_collision:
        return Unchecked("self-collision", "left out on request")
    if isinstance(task.robot, StoredRobot) and task.robot.shape is not None:
        return task.robot.shape
    if not isinstance(task.robot, str) or not task.robot.lower().endswith((".urdf", ".xml")):
        return Unchecked("self-collision", f"shapes are taken from URDF files only, and {_given(task.robot)}")
    try:
        read = built_in("reader", "shape")
        parts, left_out = read(task.robot, task.base_link, task.tip, snap_angles=task.snap_angles)
    except InputError as error:
        return Unchecked("self-collision", str(error))
    return Unchecked("self-collision", left_out[0]) if left_out else World(parts, clearance=_CONTACT)


def _given(robot: Robot | StoredRobot | str) -> str:
    """How a robot is given that is not the file of a URDF."""
    if isinstance(robot, StoredRobot):
        return "the robot is that of a stored design, which holds none"
    if not isinstance(robot, str):
        return "the robot is given as an object; name its URDF in a world file"
    return f"{robot} is not one" if "." in robot else f"{robot} is built in"


def _self_collision(robot: Robot, joints: tuple[str, ...], task: Task, shape: World | Unchecked) -> StatedLimits:
    obstacles = Unchecked("obstacles", "no world file is given")
    if isinstance(shape, Unchecked):
        return StatedLimits(unchecked=(shape, obstacles))
    try:
        constraints = SelfCollisions(shape).imposed(task.limits.applied(robot), _motion(robot, joints))
    except InputError as error:
        return StatedLimits(unchecked=(Unchecked("self-collision", str(error)), obstacles))
    return StatedLimits(tuple(constraints), (obstacles,))
