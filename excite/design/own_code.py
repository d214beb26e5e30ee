"""What identifies a part of a task from one process to the next: plain values, and the source of code of one's own."""

from __future__ import annotations

import hashlib
import inspect
import sys
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import cached_property
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

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
    installed = file is not None and ("site-packages" in file or "dist-packages" in file)
    return not (installed or _is_compiled(file))


def _is_compiled(file: str | None) -> bool:
    return file is not None and not file.endswith(".py")


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
        for used, value in _globals_of(function):
            if isinstance(value, type | FunctionType):
                yield from _sources(value, seen)
            elif not isinstance(value, ModuleType):
                yield f"{used} = {plain_value(value)!r}"


def _functions(named: Any) -> list[FunctionType]:
    if isinstance(named, FunctionType):
        return [named]
    members = (getattr(member, "__func__", getattr(member, "fget", member)) for member in vars(named).values())
    return [member for member in members if isinstance(member, FunctionType)]


def _globals_of(function: FunctionType) -> Iterator[tuple[str, Any]]:
    for name in sorted(_names(function.__code__)):
        if name in function.__globals__:
            yield name, function.__globals__[name]


def _names(code: CodeType) -> set[str]:
    inner = (constant for constant in code.co_consts if isinstance(constant, CodeType))
    return set(code.co_names).union(*map(_names, inner))
