"""What a start's result depends on: two problems of the same identity give the same starts."""

from __future__ import annotations

import hashlib
import inspect
import json
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any
from uuid import uuid4

import numpy as np

from excite.design.blueprint import Blueprint
from excite.design.start_results import Origin
from excite.registry import is_own, part
from excite.tasks.task import Task

_SEARCH = 2  # to be raised where the same problem is searched in another manner
_PACKAGES = ("excite-trajectories", "casadi", "daqp", "numpy", "scipy")
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
        return None if self.doubt else content_sha256(self.content)

    @property
    def origin(self) -> Origin:
        """What the files of starts of this run say of where they come from."""
        return {"problem": self.content, "sha256": self.sha256, "run": self.run}

    def differences(self, other: Mapping[str, Any]) -> str:
        """What another problem's content has otherwise, such as ``trajectory.harmonics 5 -> 7``; may be empty."""
        before, now = dict(_flat(other)), dict(_flat(self.content))
        names = [name for name in (*now, *(before.keys() - now.keys())) if before.get(name) != now.get(name)]
        told = [_difference(name, before.get(name), now.get(name)) for name in names[:_SHOWN]]
        return ", ".join(told) + ", ..." * (len(names) > _SHOWN)


def problem_identity(blueprint: Blueprint) -> ProblemIdentity:
    """Identity of a design problem."""
    task = blueprint.task
    whole, moving = content_sha256(blueprint.whole), content_sha256(blueprint.robot)
    content: dict[str, Any] = {
        "robot": {"name": task.robot_name, "sha256": whole, "moving": moving},
        "output": {"rate": task.output.rate},  # at which the criterion is evaluated
        "search": {"schema": _SEARCH},
        "versions": package_versions(),
    }
    try:
        parts = ("model", "trajectory", "objective", "limits", "search")
        for name, options in plain_options(task, parts, ("class", *_ANYWHERE)):
            content[name] = {**content.get(name, {}), **options}
        content["own"] = references_of_own(task)
        content["begin"] = plain_value(blueprint.initial)
        if task.objective.after:
            content["after"] = plain_value(blueprint.precision)
    except NotComparable as error:
        return ProblemIdentity(content, str(error))
    return ProblemIdentity(content)


def package_versions() -> dict[str, str]:
    """Versions of the packages on which results depend."""
    return {name: version(name) for name in _PACKAGES}


def plain_options(task: Task, parts: Iterable[str], left_out: Collection[str]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Parts of a task as plain values, see `plain_value`, without some options."""
    for name in parts:
        options = plain_value(getattr(task, name))
        yield name, {key: value for key, value in options.items() if key not in left_out}


def references_of_own(task: Task) -> dict[str, Any]:
    """References to the classes of parts of the user's own that are given as ``module:Name``, by these names."""
    given = [
        ("model", task.model.model),
        ("trajectory", task.trajectory.trajectory),
        ("criterion", task.objective.criterion),
        ("solver", task.search.solver),
        *(("constraint", limit) for limit in task.limits.constraints),
    ]
    own = {name: part(kind, name) for kind, name in given if isinstance(name, str) and is_own(name)}
    return {name: reference(each if hasattr(each, "__qualname__") else type(each)) for name, each in own.items()}


def content_sha256(content: Mapping[str, object]) -> str:
    """Hash of plain values, whatever source they name."""
    content = {key: value for key, value in content.items() if key != "source"}
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


_OURS = ("excite", "regressors", "constraints")
_FEW = 16  # numbers of an array up to which it is written as they are
_PLAIN = (type(None), bool, int, str)


class NotComparable(Exception):
    """A part of which a later process could not tell whether it is the same."""


def plain_value(value: Any, within: tuple[int, ...] = ()) -> Any:
    """Value as lists, dictionaries, strings and numbers that are the same in every process.

    Objects are described as they are pickled, by their class and state; classes and functions by their name and, where
    they are not part of an installed package, their source.
    """
    if isinstance(value, _PLAIN):
        return value
    if isinstance(value, float | np.generic):
        number = value.item() if isinstance(value, np.generic) else value
        return number if np.isfinite(number) else repr(number)
    if id(value) in within:
        raise NotComparable(f"{type(value).__name__} contains itself")
    within = (*within, id(value))
    if isinstance(value, np.ndarray):
        return _array(value, within)
    if isinstance(value, bytes):
        return hashlib.sha256(value).hexdigest()
    if isinstance(value, Mapping):
        return {str(name): plain_value(each, within) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [plain_value(each, within) for each in value]
    if isinstance(value, set | frozenset):
        return sorted((plain_value(each, within) for each in value), key=repr)
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, type | FunctionType):
        return reference(value)
    if is_dataclass(value):
        return {"class": reference(type(value))} | {
            field.name: plain_value(getattr(value, field.name), within) for field in fields(value)
        }
    return _pickled(value, within)


def _array(value: np.ndarray[Any, Any], within: tuple[int, ...]) -> Any:
    if value.size <= _FEW or value.dtype.hasobject:
        return [plain_value(each, within) for each in value.tolist()] if value.ndim else plain_value(value.item())
    content = f"{value.dtype.str}{value.shape}".encode() + np.ascontiguousarray(value).tobytes()
    return f"{'x'.join(map(str, value.shape))} numbers {hashlib.sha256(content).hexdigest()}"


def _pickled(value: Any, within: tuple[int, ...]) -> Any:
    """Class and state of an object, as pickle takes them."""
    try:
        reduced = value.__reduce_ex__(4)
    except Exception as error:
        raise NotComparable(f"{type(value).__name__}: {error}") from error
    if isinstance(reduced, str):
        return f"{type(value).__module__}:{reduced}"
    make, arguments, *further = reduced
    parts = [list(part) if isinstance(part, Iterator) else _state(part, type(value)) for part in further]
    return {"class": reference(type(value)), "state": plain_value([make, list(arguments), *parts], within)}


def _state(state: Any, kind: type) -> Any:
    """State without what is computed from the rest."""
    if not isinstance(state, dict):
        return state
    return {name: each for name, each in state.items() if not isinstance(getattr(kind, name, None), cached_property)}


def reference(named: Any) -> Any:
    """Name of a class or function, with its source where it is the user's own."""
    name = f"{named.__module__}:{named.__qualname__}"
    if not _is_own(named):
        return name
    code = "".join(sorted(_sources(named, set())))
    return {"name": named.__qualname__, "source": hashlib.sha256(code.encode()).hexdigest()}


def _is_own(named: Any) -> bool:
    """Whether code is neither part of this package nor installed."""
    module: str = named.__module__
    if module != "__main__" and module.partition(".")[0] in (*_OURS, *sys.stdlib_module_names):
        return False
    file = getattr(sys.modules.get(named.__module__), "__file__", None)
    return file is None or (file.endswith(".py") and not ("site-packages" in file or "dist-packages" in file))


def _sources(named: Any, seen: set[str]) -> Iterator[str]:
    """Source of a class or function, and of what it uses of its module and of other modules of the user's own."""
    name = f"{named.__module__}:{named.__qualname__}"
    if name in seen or not _is_own(named):
        return
    seen.add(name)
    try:
        yield inspect.getsource(named)
    except (OSError, TypeError) as error:
        raise NotComparable(f"the source of {named.__qualname__} is not accessible") from error
    for base in getattr(named, "__bases__", ()):
        yield from _sources(base, seen)
    for function in _functions(named):
        known = function.__globals__
        for used in sorted(_names(function.__code__) & known.keys()):
            value = known[used]
            if isinstance(value, type | FunctionType):
                yield from _sources(value, seen)
            elif not isinstance(value, ModuleType):
                yield f"{used} = {plain_value(value)!r}"


def _functions(named: Any) -> list[FunctionType]:
    if isinstance(named, FunctionType):
        return [named]
    members = (getattr(member, "__func__", getattr(member, "fget", member)) for member in vars(named).values())
    return [member for member in members if isinstance(member, FunctionType)]


def _names(code: CodeType) -> set[str]:
    inner = (constant for constant in code.co_consts if isinstance(constant, CodeType))
    return set(code.co_names).union(*map(_names, inner))
