"""A cell of a sweep: one design task, the name that its options give it, and what its design depends on."""

from __future__ import annotations

import hashlib
import json
import string
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

from excite.design.problem_identity import PACKAGES, NotComparable, own_parts, plain_value, reference
from excite.registry import part
from excite.tasks.robot_of_task import installed_robot
from excite.tasks.task import PARTS, Task

_NOWHERE = ("class", "executor", "workers", "starts")  # on which no start depends
_LONGEST_VALUE, _LONGEST_NAME = 32, 160  # characters
_SAFE = frozenset(string.ascii_letters + string.digits + "_.+-")
_DIGITS = 8  # of a hash in a name


@dataclass(frozen=True)
class Cell:
    """One design of a sweep.

    Parameters
    ----------
    name : str
        Of its folder; unique in the sweep, whatever the other cells are.
    task : Task
    options : mapping of str to str
        Options of the grid and what they are in this cell, as text.
    """

    name: str
    task: Task
    options: Mapping[str, str] = field(default_factory=dict)


def cell_name(options: Mapping[str, str]) -> str:
    """Name of a cell by its options, such as ``robot=irp6,seed=0``; it depends on nothing else."""
    name = ",".join(f"{option}={value}" for option, value in options.items())
    return name if len(name) <= _LONGEST_NAME else f"{name[:_LONGEST_NAME]}-{_hash(name)}"


def value_name(value: Any) -> str:
    """Short name of a value in names of folders: letters, digits, and ``+ - . _`` only."""
    if isinstance(value, list) and value and not any(isinstance(each, list | dict) for each in value):
        text = "+".join(map(_plain, value))
    else:
        text = _plain(value)
    safe = "".join(letter if letter in _SAFE else "-" for letter in text).strip("-.")[:_LONGEST_VALUE]
    return safe if safe == text else f"{safe}-{_hash(text)}".strip("-")


def is_cell_name(name: str) -> bool:
    """True for a name that folders of any system may have, and that is no option and not hidden."""
    parts = name.split(",")
    return 0 < len(name) <= _LONGEST_NAME and all(
        value_name(each) == each for part in parts for each in part.split("=")
    )


def _plain(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, sort_keys=True)


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:_DIGITS]


def cell_identities(cells: Iterable[Cell]) -> dict[str, str | None]:
    """Hashes of the problems of cells by their names: robot, task and versions, without the number of starts.

    None stands for a task with a part of the user's own of which a later process could not tell whether it is the same.
    """
    robots: dict[tuple[Any, ...], str] = {}  # each read once
    versions = {name: version(name) for name in PACKAGES}
    identities = {}
    for cell in cells:
        task = cell.task
        named = task.robot if isinstance(task.robot, str) else id(task.robot)
        key = (named, task.base_link, task.tip, task.snap_angles, task.xacro, repr(task.installation))
        if key not in robots:
            robots[key] = _sha256(installed_robot(task).description())
        identities[cell.name] = _identity(task, robots[key], versions)
    return identities


def _identity(task: Task, robot: str, versions: dict[str, str]) -> str | None:
    content: dict[str, Any] = {"robot": robot, "versions": versions}
    try:
        for name in PARTS:
            options = plain_value(getattr(task, name))
            content[name] = {key: value for key, value in options.items() if key not in _NOWHERE}
        own = {name: part(kind, name) for kind, name in own_parts(task)}
        content["own"] = {name: reference(x if hasattr(x, "__qualname__") else type(x)) for name, x in own.items()}
    except NotComparable:
        return None
    return _sha256(content)


def _sha256(content: dict[str, Any]) -> str:
    kept = {key: value for key, value in content.items() if key != "source"}
    return hashlib.sha256(json.dumps(kept, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
