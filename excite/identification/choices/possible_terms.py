"""Optional parameters that a model can have."""

from __future__ import annotations

from excite.identification.choices.free_settings import TERM_SETTINGS
from excite.information.target import model_of, moving_robot
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.robot.robot import Robot


def possible_terms(robot: Robot, task: Task, free: frozenset[str]) -> frozenset[str]:
    """The settings without parameters that a task's model refuses, such as load shares of the energy model."""
    return free - {name for name in free & TERM_SETTINGS if not _is_possible(robot, task, name)}


def _is_possible(robot: Robot, task: Task, name: str) -> bool:
    try:
        wide = task.changed(**{name: True})
        model_of(moving_robot(robot, wide), wide)
    except InputError:
        return False
    return True
