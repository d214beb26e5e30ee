"""What a task identifies: the moving robot, the model of it, and the parameters that its motion can show."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from excite.registry import CONVENTIONS
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.friction.curves import FrictionCurves
from regressors.models.base import COUNT, Base, base_parameters, random_states
from regressors.models.differential import DifferentialModel
from regressors.models.energy import EnergyModel
from regressors.models.load import EQUATIONS, LoadIntegralModel, LoadModel, Sensor
from regressors.models.model import RegressorModel
from regressors.models.partial import PartialMotion, of_drives, of_joints
from regressors.models.windows import Window
from regressors.robot.inertia import rotation_from_rpy
from regressors.robot.joint_rotors import with_joint_rotors
from regressors.robot.locked_joints import with_resting_joints
from regressors.robot.robot import Robot
from regressors.samples import Array


def _differential(robot: Robot, task: Task, sign_width: float) -> RegressorModel:
    return DifferentialModel(robot, task.terms, sign_width=sign_width)


def _energy(robot: Robot, task: Task, sign_width: float) -> RegressorModel:
    return EnergyModel(robot, task.terms, _window(task), sign_width=sign_width)


def _load(robot: Robot, task: Task, sign_width: float) -> RegressorModel:
    return LoadModel(robot, _sensor(task))


def _load_integral(robot: Robot, task: Task, sign_width: float) -> RegressorModel:
    return LoadIntegralModel(robot, _sensor(task), _window(task))


_MODELS: dict[str, Callable[[Robot, Task, float], RegressorModel]] = {
    "differential": _differential,
    "energy": _energy,
    "load": _load,
    "load-integral": _load_integral,
}
_CLASSES: dict[str, type[RegressorModel]] = {
    "differential": DifferentialModel,
    "energy": EnergyModel,
    "load": LoadModel,
    "load-integral": LoadIntegralModel,
}


def _window(task: Task) -> Window:
    return Window("long" if task.window == "long" else "short", task.window_length)


def _sensor(task: Task) -> Sensor:
    rotation = rotation_from_rpy(task.sensor_rpy)
    return Sensor(task.sensor, rotation, np.array(task.sensor_xyz), task.equations or EQUATIONS)


def moving_robot(robot: Robot, task: Task) -> Robot:
    """The robot that the task's model is written for: its limits, and links behind resting joints merged.

    Where the robot's description names its parameters for a set of joints that includes those asked for, that form is
    kept, and the other joints of it are held (see `motion_of`).

    Parameters
    ----------
    robot : Robot
        The whole robot.
    task : Task

    Raises
    ------
    InputError
        Unknown joints, limits that cannot be, or a friction curve of a drive that the robot does not have.
    """
    robot = task.limits.applied(robot)
    if task.known_friction is not None:
        task.known_friction.check(robot)
    if task.joint_rotors:
        robot = with_joint_rotors(robot)
    if _CLASSES[task.model].keeps_all_links:
        return robot
    forms = [form.joints for form in robot.structure.aggregates]
    if task.joints is None:
        return with_resting_joints(robot, [robot.joint_index(name) for name in (*forms, robot.joint_names)[0]])
    wanted = [robot.joint_index(name) for name in task.joints]
    names = {robot.joint_names[k] for k in wanted}
    form = next((form for form in forms if names <= set(form)), None)
    return with_resting_joints(robot, wanted if form is None else [robot.joint_index(name) for name in form])


def friction_of_moving(friction: FrictionCurves, robot: Robot, moving: Robot) -> FrictionCurves:
    """Friction curves without those of joints that rest.

    Parameters
    ----------
    friction : FrictionCurves
        Of drives of the whole robot.
    robot : Robot
        The whole robot.
    moving : Robot
        See `moving_robot`.

    Raises
    ------
    UnknownName
        A curve of a drive that the robot does not have.
    """
    friction.check(robot)
    if moving.transmission is not None:
        return friction  # its drives are there, at rest or not
    return friction.of(moving.joint_names)


def motion_of(robot: Robot, moving: Robot, task: Task) -> PartialMotion:
    """Which coordinates of the moving robot a task moves.

    Parameters
    ----------
    robot : Robot
        The whole robot, whose joints the task numbers.
    moving : Robot
        See `moving_robot`.
    task : Task
    """
    if task.drives is not None:
        return of_drives(moving, task.drives)
    names = (
        moving.joint_names if task.joints is None else [robot.joint_names[robot.joint_index(n)] for n in task.joints]
    )
    return of_joints(moving, [moving.joint_names.index(name) for name in names])


def model_of(robot: Robot, task: Task, sign_width: float = 0.0) -> RegressorModel:
    """Model that a task asks for.

    Parameters
    ----------
    robot : Robot
        See `moving_robot`.
    task : Task
    sign_width : float
        Velocity over which the sign of Coulomb friction turns [rad/s]; zero for the exact sign.
    """
    return _MODELS[task.model](robot, task, sign_width)


@dataclass(frozen=True, eq=False)
class Subject:
    """What is to be identified, and in which columns.

    Parameters
    ----------
    robot : Robot
        The moving robot.
    motion : PartialMotion
    model : RegressorModel
        With exact friction, unless a sign width is given.
    base : Base
        Left-to-right base.
    transforms : dict of str to ndarray, shape (b, b)
        Per convention the matrix T that takes the base's columns to its own, ``W_c = W_b T``; for ``orthonormal`` a
        factor with the singular values of the full regressor.
    """

    robot: Robot
    motion: PartialMotion
    model: RegressorModel
    base: Base
    transforms: dict[str, Array]


def subject_of(robot: Robot, task: Task, sign_width: float = 0.0) -> Subject:
    """Moving robot, model and base columns of a task.

    Parameters
    ----------
    robot : Robot
        The whole robot.
    task : Task
    sign_width : float
        See `model_of`.

    Raises
    ------
    InputError
        Unknown joints, drives, links, or limits that cannot be.
    """
    moving = moving_robot(robot, task)
    motion = motion_of(task.limits.applied(robot), moving, task)
    model = model_of(moving, task, sign_width).restricted(motion, task.equations)
    if not model.columns:
        raise InputError(f"no motion of {', '.join(motion.labels)} shows any parameter of the {task.model} model")
    states = motion.states(random_states(moving, COUNT))
    with threadpool_limits(1):  # on matrices of this size more threads only wait for each other
        base, pivoted = (base_parameters(model, choice, states=states) for choice in ("gautier", "pivoted"))
    if base.rank == 0:
        return Subject(moving, motion, model, base, {})
    transforms = {
        "gautier": np.eye(base.rank),
        "pivoted": base.D[:, pivoted.index],
        "orthonormal": base.full_rank_factor,
    }
    return Subject(moving, motion, model, base, {name: transforms[name] for name in CONVENTIONS})
