"""Identification target of a task: the moving robot, its model, and the identifiable parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from excite.information.identifiability import visible_bases
from excite.registry import CONVENTIONS, name_of
from excite.tasks.model_choice import FURTHER_FRICTION, ModelChoice
from excite.tasks.model_options import DriveChoice, numbers_of
from excite.tasks.robot_of_task import moving_robot
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.models.base import Base, base_parameters, bases, enough_states, few_states, random_states
from regressors.models.independence import ROUNDING
from regressors.models.model import RegressorModel
from regressors.models.partial import PartialMotion, of_drives, of_joints
from regressors.numerical import numerical_work
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.load_share import drives_with_friction, moving_drive_numbers
from regressors.robot.robot import Robot
from regressors.samples import Array


def friction_of_moving(friction: FrictionCurves, robot: Robot, moving: Robot) -> FrictionCurves:
    """Friction curves without those of locked joints."""
    friction.check(robot)
    if moving.transmission is not None:
        return friction  # all its drives are kept, moving or not
    return friction.of(moving.joint_names)


def motion_of(robot: Robot, moving: Robot, task: Task) -> PartialMotion:
    """Partial motion of the moving robot that a task asks for."""
    if task.model.drives is not None:
        return of_drives(moving, task.model.drives)
    wanted = task.model.joints
    names = moving.joint_names if wanted is None else [robot.joint_names[robot.joint_index(name)] for name in wanted]
    return of_joints(moving, [moving.joint_names.index(name) for name in names])


def model_of(robot: Robot, task: Task, sign_width: float = 0.0) -> RegressorModel:
    """Model that a task asks for."""
    return task.model.built(robot).softened(sign_width)


@dataclass(frozen=True, eq=False)
class IdentificationTarget:
    """The model to identify, with its base columns.

    Parameters
    ----------
    robot : Robot
        The moving robot.
    motion : PartialMotion
    model : RegressorModel
        Model with exact friction, unless a sign width is given.
    base : Base
        Left-to-right base.
    transforms : dict of str to ndarray, shape (b, b)
        Matrix T per convention, from the base's columns to those of the convention, ``W_c = W_b T``; for
        ``orthonormal`` a factor with the singular values of the full regressor.
    """

    robot: Robot
    motion: PartialMotion
    model: RegressorModel
    base: Base
    transforms: dict[str, Array]


@numerical_work(
    "the search for base parameters",
    "lengths, masses or inertias of very different sizes are the likely cause: check the description of the robot",
)
def left_to_right_base(robot: Robot, task: Task) -> tuple[PartialMotion, Base]:
    """Moving coordinates and left-to-right base of a task, without the other conventions."""
    moving, motion, whole = _moving(robot, task, 0.0)
    model = _restricted(whole, motion, task)
    states = motion.states(random_states(moving, few_states(model)))
    with threadpool_limits(1):
        return motion, base_parameters(model, states=states, rounding=_rounding(task))


def _rounding(task: Task) -> float:
    """Part of a column that counts as born of rounding; what deviations decide upon is not decided here."""
    return ROUNDING if task.objective.nearly_unidentifiable == "drop-rounding" else 0.0


def _moving(robot: Robot, task: Task, sign_width: float) -> tuple[Robot, PartialMotion, RegressorModel]:
    moving = moving_robot(robot, task)
    return moving, motion_of(task.limits.applied(robot), moving, task), model_of(moving, task, sign_width)


def _restricted(model: RegressorModel, motion: PartialMotion, task: Task) -> RegressorModel:
    """The model of the moving coordinates, which must have columns."""
    model = model.restricted(motion, task.model.equations)
    if not model.columns:
        name = name_of(task.model.model)
        raise InputError(f"no parameter of the {name} model is identifiable from motions of {', '.join(motion.labels)}")
    return model


def target_of(
    robot: Robot, task: Task, sign_width: float = 0.0, *, instantaneous: bool = False
) -> IdentificationTarget:
    """Moving robot, model and base columns of a task."""
    moving, motion, whole = _moving(robot, task, sign_width)
    model = _restricted(whole.instantaneous() if instantaneous else whole, motion, task)
    states = motion.states(random_states(moving, enough_states(model)))
    with threadpool_limits(1):  # matrices of this size do not gain from more threads
        chosen = bases(model, states, _rounding(task))
        if task.objective.nearly_unidentifiable == "drop" and chosen[0].rank > 0:
            torques = whole.instantaneous().restricted(motion, task.model.equations)
            chosen = visible_bases(model, torques, chosen, states, task)
        base, pivoted = chosen
        if base.rank == 0:
            return IdentificationTarget(moving, motion, model, base, {})
        transforms = {
            "gautier": np.eye(base.rank),
            "pivoted": base.D[:, pivoted.index],
            "orthonormal": base.full_rank_factor,
        }
    return IdentificationTarget(moving, motion, model, base, {name: transforms[name] for name in CONVENTIONS})


_NOTHING = 1e-12  # of a drive's velocity along the motion


def turning_drives(target: IdentificationTarget) -> tuple[str, ...]:
    """Names of the drives that turn in a target's motions."""
    drives = drives_with_friction(target.robot)
    return tuple(name for name, row in drives if np.any(np.abs(row @ target.motion.matrix) > _NOTHING))


def left_out_notes(asked: ModelChoice, target: IdentificationTarget, curves: FrictionCurves) -> tuple[str, ...]:
    """Note on further friction parameters that were asked for, but only of turning drives whose friction is known."""
    numbers = moving_drive_numbers(target.robot)
    turning = {numbers[name] for name in turning_drives(target)}

    def some(chosen: DriveChoice, known: FrictionCurves | None) -> bool:
        left = numbers_of(chosen, target.robot, known)
        return left if isinstance(left, bool) else bool(turning.intersection(left))

    choices = {name.replace("_", " "): getattr(asked, name) for name in FURTHER_FRICTION}
    names = [name for name, chosen in choices.items() if some(chosen, None) and not some(chosen, curves)]
    return (f"{', '.join(names)} columns are left out: friction is known",) if names else ()
