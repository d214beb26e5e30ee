"""What a start's result depends on: two problems of the same identity give the same starts."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import version
from typing import Any
from uuid import uuid4

from excite.design.blueprint import Blueprint
from excite.design.own_code import NotComparable, plain_value, reference
from excite.design.start_results import Origin
from excite.registry import is_own, part
from excite.tasks.task import Task

_SEARCH = 2  # to be raised where the same problem is searched in another manner
PACKAGES = ("excite-trajectories", "casadi", "daqp", "numpy", "scipy")
_ANYWHERE = ("starts", "rounds", "budget", "executor", "workers", "begin", "after")
# a start depends on the motion of `begin`, and on what `after` adds to the information
_SHOWN, _LONGEST = 3, 40  # differences that a message names; characters of names and values that it shows


@dataclass(frozen=True)
class ProblemIdentity:
    """A problem as plain values."""

    # robot, task, seed and versions; neither the number of starts, nor where they run, nor what is written
    content: dict[str, Any]
    doubt: str = ""  # why a later process could not tell whether its problem is the same; empty where it can
    # unique number of this run of the search, which its starts, its design and the manifest state
    run: str = field(default_factory=lambda: uuid4().hex, compare=False)

    @cached_property
    def sha256(self) -> str | None:
        """Hash of the content; None where there is a doubt."""
        text = json.dumps(self.content, sort_keys=True, separators=(",", ":"))
        return None if self.doubt else hashlib.sha256(text.encode()).hexdigest()

    @property
    def origin(self) -> Origin:
        """What the files of starts of this run say of where they come from."""
        return Origin(self.content, self.sha256, self.run)

    def differences(self, other: Mapping[str, Any]) -> str:
        """What another problem's content has otherwise, such as ``trajectory.harmonics 5 -> 7``; may be empty."""
        before, now = dict(_flat(other)), dict(_flat(self.content))
        names = [name for name in (*now, *(before.keys() - now.keys())) if before.get(name) != now.get(name)]
        told = [_difference(name, before.get(name), now.get(name)) for name in names[:_SHOWN]]
        return ", ".join(told) + ", ..." * (len(names) > _SHOWN)


def problem_identity(blueprint: Blueprint) -> ProblemIdentity:
    """Identity of a design problem."""
    task = blueprint.task
    content: dict[str, Any] = {
        "robot": {"name": task.robot_name, "sha256": _hash(blueprint.whole), "moving": _hash(blueprint.robot)},
        "output": {"rate": task.output.rate},  # at which the criterion is evaluated
        "search": {"schema": _SEARCH},
        "versions": {name: version(name) for name in PACKAGES},
    }
    try:
        for name in ("model", "trajectory", "objective", "limits", "search"):
            options = plain_value(getattr(task, name))
            kept = {key: value for key, value in options.items() if key not in ("class", *_ANYWHERE)}
            content[name] = {**content.get(name, {}), **kept}
        content["own"] = {name: reference(_class_of(kind, name)) for kind, name in own_parts(task)}
        content["begin"] = plain_value(blueprint.initial)
        if task.objective.after:
            content["after"] = plain_value(blueprint.precision)
    except NotComparable as error:
        return ProblemIdentity(content, str(error))
    return ProblemIdentity(content)


def own_parts(task: Task) -> Iterator[tuple[str, str]]:
    """Kinds and names of parts of the user's own that are given as ``module:Name``."""
    given = [
        ("model", task.model.model),
        ("trajectory", task.trajectory.trajectory),
        ("criterion", task.objective.criterion),
        ("solver", task.search.solver),
        *(("constraint", limit) for limit in task.limits.constraints),
    ]
    return ((kind, name) for kind, name in given if isinstance(name, str) and is_own(name))


def _class_of(kind: str, name: str) -> Any:
    named = part(kind, name)
    return named if hasattr(named, "__qualname__") else type(named)


def _hash(description: Mapping[str, object]) -> str:
    content = {key: value for key, value in description.items() if key != "source"}
    return hashlib.sha256(json.dumps(content, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def _flat(content: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    if not isinstance(content, Mapping):
        yield name, content
        return
    for key, value in content.items():
        yield from _flat(value, f"{name}.{key}" if name else str(key))


def _difference(name: str, before: Any, now: Any) -> str:
    told = [value if isinstance(value, str) else json.dumps(value) for value in (before, now)]
    if any(len(text) > _LONGEST or not text.isprintable() for text in (name, *told)):
        return f"another {name[:_LONGEST]}" if name.isprintable() else "another option"
    return f"{name} {told[0]} -> {told[1]}"
