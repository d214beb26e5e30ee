"""Which robot a task is for, and the task of a robot or a model alone."""

from __future__ import annotations

from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.models.model import RegressorModel
from regressors.readers.library import built_in_names, load_robot
from regressors.robot.robot import Robot


def robot_and_task(
    model: RegressorModel | Robot | Task | str,
    base_link: str | None = None,
    tip: str | None = None,
    snap_angles: bool = True,
) -> tuple[Robot, Task]:
    """Robot and task of what an experiment is to show.

    Parameters
    ----------
    model : RegressorModel, Robot, Task or str
        A robot or its name stands for the differential model of it.
    base_link, tip : str, optional
        Ends of the chain where the file of a robot is named.
    snap_angles : bool
        Take rounded right angles in that file for right angles.

    Raises
    ------
    InputError
        Not a robot, a model, a task, or the name or file of a robot; ends of what is not a file.
    """
    if isinstance(model, str):
        described = load_robot(model, base_link, tip, snap_angles=snap_angles)
        return described, Task(model, base_link=base_link, tip=tip, snap_angles=snap_angles)
    if base_link is not None or tip is not None:
        raise InputError("`base_link` and `tip` are the ends of the chain where the file of a robot is named")
    if not snap_angles:
        raise InputError("`snap_angles=False` says how to read the file of a robot, but no file is named")
    if isinstance(model, Task):
        robot = model.robot
        if isinstance(robot, str):
            robot = load_robot(robot, model.base_link, model.tip, snap_angles=model.snap_angles)
        return robot, model
    if isinstance(model, RegressorModel):
        return model.robot, Task(model.robot, model=model)
    if isinstance(model, Robot):
        return model, Task(model)
    raise InputError(f"expected a model, a robot, the name of one, or a task; given {type(model).__name__}")


def check_robot(robot: Robot, task: Task) -> None:
    """Raise `InputError` where a task is for another robot."""
    other = task.robot
    if isinstance(other, str):
        if other not in built_in_names():
            return  # a file, which may have been read with other ends of the chain
        other = load_robot(other)
    if other.sha256() != robot.sha256():
        raise InputError(f"the task is for {other.name}, not for {robot.name} as given here")
