"""Robot and task from a model, a robot, a task, or the name of a robot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from excite.tasks.installation import Installation
from excite.tasks.stored_files import StoredRobot
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.models.model import RegressorModel
from regressors.quantities import Tips
from regressors.readers.library import load_robot
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.locked_joints import with_joint_rotors, with_locked_joints
from regressors.robot.robot import Robot

_OF_NAMED = (
    "`gravity`, `mount` and `payload` are for a robot given by name or file; of a robot object, give "
    "Installation(...).applied(robot)"
)


def robot_and_task(
    model: RegressorModel | Robot | Task | str,
    base_link: str | None = None,
    tip: Tips = None,
    installation: Installation | None = None,
    snap_angles: bool = True,
    xacro: bool = False,
) -> tuple[Robot, Task]:
    """Robot and task of an experiment."""
    if isinstance(model, str):
        installation = installation if installation is not None else Installation()
        read = {"snap_angles": snap_angles, "xacro": xacro}
        task = Task(model, base_link=base_link, tip=tip, installation=installation, **read)
        return installed_robot(task), task
    if installation is not None and not installation.described:
        raise InputError(_OF_NAMED)
    if base_link is not None or tip is not None:
        raise InputError("`base_link` and `tip` are the ends of what moves where the file of a robot is named")
    for asked, option in ((not snap_angles, "`snap_angles=False`"), (xacro, "`xacro=True`")):
        if asked:
            raise InputError(f"{option} says how to read the file of a robot, but no file is named")
    task = task_of(model)
    return installed_robot(task), task


def task_of(model: RegressorModel | Robot | Task | str) -> Task:
    """Task of an experiment, whose options may still change, and with them its robot: see `installed_robot`."""
    if isinstance(model, Task):
        return model
    if isinstance(model, RegressorModel):
        return Task(model.robot, model=model)
    if isinstance(model, Robot | str):
        return Task(model)
    raise InputError(f"expected a model, a robot, the name of one, or a task; given {type(model).__name__}")


def one_model(robot_or_model: RegressorModel | Robot | Task | str, options: Mapping[str, Any]) -> None:
    """Refuse the option ``model`` beside a model."""
    if isinstance(robot_or_model, RegressorModel) and "model" in options:
        raise InputError("`model` chooses the model of a robot, but a model is given already; give one of them")


def installed_robot(task: Task) -> Robot:
    """The robot of a task, as mounted and as equipped."""
    if isinstance(task.robot, StoredRobot):
        return task.robot.robot
    if isinstance(task.robot, str):
        read = {"snap_angles": task.snap_angles, "xacro": task.xacro}
        return task.installation.applied(load_robot(task.robot, task.base_link, task.tip, **read))
    if not task.installation.described:
        raise InputError(_OF_NAMED)
    return task.robot


def moving_robot(robot: Robot, task: Task) -> Robot:
    """The robot that the task's model is written for: its limits, and links behind locked joints merged."""
    robot = task.limits.applied(robot)
    if isinstance(task.model.friction_curves, FrictionCurves):
        task.model.friction_curves.check(robot)
    task.model.check_drives(robot)
    if task.model.joint_rotors:
        robot = with_joint_rotors(robot)
    if task.model.keeps_all_links:
        return robot
    forms = [form.joints for form in robot.structure.aggregates]
    if task.model.joints is None:
        return with_locked_joints(robot, [robot.joint_index(name) for name in (*forms, robot.joint_names)[0]])
    wanted = [robot.joint_index(name) for name in task.model.joints]
    # the form is kept that names the parameters of these joints and others, which are then held (see `motion_of`)
    names = {robot.joint_names[k] for k in wanted}
    form = next((form for form in forms if names <= set(form)), None)
    return with_locked_joints(robot, wanted if form is None else [robot.joint_index(name) for name in form])
