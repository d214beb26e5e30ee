"""What a cell's design depends on, so that a later run knows which cells are done."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from importlib.metadata import version
from typing import Any

from excite.campaigns.cell import Cell
from excite.design.own_code import NotComparable, plain_value, reference
from excite.design.problem_identity import PACKAGES, own_parts
from excite.registry import part
from excite.tasks.robot_of_task import installed_robot
from excite.tasks.task import PARTS, Task
from regressors.robot.robot import Robot

_NOWHERE = ("class", "executor", "workers", "starts")  # on which no start depends


class RobotLibrary:
    """Robots of tasks, each read once."""

    def __init__(self) -> None:
        self._known: dict[tuple[Any, ...], tuple[Robot, str]] = {}

    def of(self, task: Task) -> tuple[Robot, str]:
        """Robot of a task as installed, and the hash of its description."""
        named = task.robot if isinstance(task.robot, str) else id(task.robot)
        key = (named, task.base_link, task.tip, task.snap_angles, task.xacro, repr(task.installation))
        if key not in self._known:
            robot = installed_robot(task)
            self._known[key] = robot, _hash(robot.description())
        return self._known[key]


def cell_identities(cells: Iterable[Cell]) -> dict[str, str | None]:
    """Hashes of the problems of cells by their names: robot, task and versions, without the number of starts.

    None stands for a task with a part of the user's own of which a later process could not tell whether it is the same.
    """
    robots, versions = RobotLibrary(), {name: version(name) for name in PACKAGES}
    return {cell.name: _identity(cell.task, robots.of(cell.task)[1], versions) for cell in cells}


def _identity(task: Task, robot: str, versions: dict[str, str]) -> str | None:
    content: dict[str, Any] = {"robot": robot, "versions": versions}
    try:
        for name in PARTS:
            options = plain_value(getattr(task, name))
            content[name] = {key: value for key, value in options.items() if key not in _NOWHERE}
        content["own"] = {name: reference(_class_of(kind, name)) for kind, name in own_parts(task)}
    except NotComparable:
        return None
    return _hash(content)


def _class_of(kind: str, name: str) -> Any:
    named = part(kind, name)
    return named if hasattr(named, "__qualname__") else type(named)


def _hash(content: dict[str, Any]) -> str:
    kept = {key: value for key, value in content.items() if key != "source"}
    return hashlib.sha256(json.dumps(kept, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
