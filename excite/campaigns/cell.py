"""A cell of a campaign: one design task, under a name that its options give it."""

from __future__ import annotations

import hashlib
import json
import string
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from excite.tasks.task import Task

_LONGEST_VALUE, _LONGEST_NAME = 32, 160  # characters
_SAFE = frozenset(string.ascii_letters + string.digits + "_.+-")
_DIGITS = 8  # of a hash in a name


@dataclass(frozen=True)
class Cell:
    """One design of a campaign.

    Parameters
    ----------
    name : str
        Of its folder; unique in the campaign, whatever the other cells are.
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
