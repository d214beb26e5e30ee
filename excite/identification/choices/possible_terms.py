"""Optional parameters that a model can have."""

from __future__ import annotations

from excite.identification.choices.free_settings import TERM_SETTINGS
from excite.information.target import model_of, moving_robot
from excite.tasks.model_choice import FURTHER_FRICTION
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.robot.robot import Robot


def possible_terms(robot: Robot, task: Task, free: frozenset[str], *, known: bool) -> frozenset[str]:
    """The settings without parameters that a task's model refuses, such as load shares of the energy model.

    Parameters
    ----------
    robot : Robot
        The whole robot.
    task : Task
    free : frozenset of str
        Settings.
    known : bool
        Whether friction is known, and has no parameters.
    """
    terms = free & (TERM_SETTINGS - frozenset(FURTHER_FRICTION) if known else TERM_SETTINGS)
    return free - TERM_SETTINGS | {name for name in terms if _is_possible(robot, task, name)}


def _is_possible(robot: Robot, task: Task, name: str) -> bool:
    try:
        wide = task.changed(**{name: True})
        model_of(moving_robot(robot, wide), wide)
    except InputError:
        return False
    return True
