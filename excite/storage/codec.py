"""The one codec of records: a frozen dataclass to the content of a JSON file and the arrays beside it, and back.

A record's fields are the file's entries, under their own names. Numbers keep every bit, also ``inf``, ``-inf`` and
``nan``, which are written as these words; an array becomes ``{"array": NAME}`` and stands under NAME in the file of
arrays; a robot is its whole description with its hash; an enumeration is the name of its member.

An entry whose arrays are not there when the record is read is its field's default. A record may state six things
more:

- ``metadata=INLINE`` of a field: the fields of that part stand beside those of the record;
- ``metadata=OBJECT`` of a field: an object that only the room of the record can write and read, such as a task. It is
  not written here; who reads the record gives it, under the name of the field;
- ``metadata=named(NAME)`` of a field: the entry has another name than the field; ``PART.NAME`` is one of the object
  that is the entry PART;
- ``listed = True``, a class attribute: its arrays are small, and are lists in the JSON file;
- ``beside``, a class attribute: functions of the record by name, for readers of the file. They follow from the other
  entries, and are not read;
- ``stored()``: the record that is written in its place, such as one with fewer instants.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from types import MappingProxyType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

import cattrs
import numpy as np
from cattrs.cols import homogenous_tuple_structure_factory
from cattrs.gen import make_dict_structure_fn, make_dict_unstructure_fn, override

from constraints.geometry import World
from constraints.world_file import world_of
from regressors.arguments import unaliased
from regressors.errors import InputError
from regressors.robot.archive import robot_from_description
from regressors.robot.robot import Robot

INLINE: Mapping[str, bool] = MappingProxyType({"inline": True})
OBJECT: Mapping[str, bool] = MappingProxyType({"object": True})


def named(entry: str) -> Mapping[str, str]:
    """Metadata of a field whose entry has a name of its own."""
    return {"entry": entry}


_ARRAY = "array"
_WORDS = {"inf": np.inf, "-inf": -np.inf, "nan": np.nan}
Arrays = dict[str, Any]
Beside = Mapping[str, Callable[[Any], Any]]
Record = TypeVar("Record")


def content_of(record: object) -> tuple[dict[str, Any], Arrays]:
    """Content of the JSON file of a record, and its arrays by name."""
    arrays: Arrays = {}
    return _without_arrays(_converter().unstructure(record), "", arrays), arrays


def record_of(kind: type[Record], content: Mapping[str, Any], arrays: Mapping[str, Any]) -> Record:
    """The record that a content and its arrays hold; entries that the record does not have are not looked at."""
    whole: dict[str, Any] = {}
    try:
        for name, each in content.items():
            with suppress(KeyError):  # of an array that is not there
                whole[name] = _with_arrays(each, arrays)
        return _converter().structure(whole, kind)
    except cattrs.BaseValidationError as error:
        raise InputError(_first(error)) from error


def _without_arrays(value: Any, place: str, arrays: Arrays) -> Any:
    """The same with references in the place of arrays, which are collected."""
    if isinstance(value, np.ndarray):
        arrays[place] = value
        return {_ARRAY: place}
    if isinstance(value, dict):
        return {name: _without_arrays(each, f"{place}.{name}".lstrip("."), arrays) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_without_arrays(each, f"{place}.{k}", arrays) for k, each in enumerate(value)]
    return value


def _with_arrays(value: Any, arrays: Mapping[str, Any]) -> Any:
    """The same with arrays in the place of references."""
    if isinstance(value, dict):
        if value.keys() == {_ARRAY}:
            return arrays[str(value[_ARRAY])]
        return {name: _with_arrays(each, arrays) for name, each in value.items()}
    return [_with_arrays(each, arrays) for each in value] if isinstance(value, list) else value


@cache
def _converter() -> cattrs.Converter:
    made = cattrs.Converter()
    for kind in (int, bool, str):
        made.register_structure_hook(kind, _exactly)
    made.register_unstructure_hook(float, lambda value: float(value) if np.isfinite(value) else str(float(value)))
    made.register_structure_hook(float, _number)
    made.register_structure_hook_factory(_is_tuple, lambda kind: _tuple(homogenous_tuple_structure_factory(kind, made)))
    made.register_unstructure_hook_func(lambda kind: _is(kind, np.ndarray), lambda array: array)
    made.register_structure_hook_func(lambda kind: _is(kind, np.ndarray), _numbers)
    made.register_unstructure_hook_func(lambda kind: _is(kind, Enum), lambda member: member.name)
    made.register_structure_hook_func(lambda kind: _is(kind, Enum), lambda name, kind: kind[_exactly(name, str)])
    made.register_unstructure_hook(Robot, _described)
    made.register_structure_hook(Robot, _robot)
    made.register_unstructure_hook(World, World.to_dict)
    made.register_structure_hook(World, lambda content, _: world_of(content))
    made.register_unstructure_hook_func(_has_own_form, lambda value: value.to_dict())
    made.register_structure_hook_func(_has_own_form, lambda content, kind: kind.from_dict(content))
    made.register_unstructure_hook_factory(_is_record, lambda kind: _writer(kind, made))
    made.register_structure_hook_factory(_is_record, lambda kind: _reader(kind, made))
    return made


def _is(kind: Any, base: type) -> bool:
    kind = unaliased(kind)
    kind = get_origin(kind) or kind
    return isinstance(kind, type) and issubclass(kind, base)


def _is_record(kind: Any) -> bool:
    return isinstance(kind, type) and is_dataclass(kind) and kind not in (Robot, World) and not _has_own_form(kind)


def _has_own_form(kind: Any) -> bool:
    """Whether a class says itself what a file has of it."""
    return hasattr(kind, "to_dict") and hasattr(kind, "from_dict")


def _is_tuple(kind: Any) -> bool:
    return get_origin(kind) is tuple and get_args(kind)[-1] is Ellipsis


def _tuple(read: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Reader of tuples from lists alone: a text is no list of letters."""

    def checked(value: Any, kind: Any) -> Any:
        if not isinstance(value, list | tuple):
            raise TypeError(f"expected a list, given {value!r:.40}")
        return read(value, kind)

    return checked


def _exactly(value: Any, kind: type) -> Any:
    """A value of the very type: ``true`` is no number, and a number no text."""
    if type(value) is not kind:
        raise TypeError(f"expected {kind.__name__}, given {value!r:.40}")
    return value


def _number(value: Any, _: type) -> float:
    if isinstance(value, str) and value in _WORDS:
        return float(_WORDS[value])
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"expected a number, given {value!r:.40}")
    return float(value)


def _numbers(value: Any, _: type) -> Any:
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiub":
        raise TypeError("expected an array of numbers")
    return value.astype(float) if value.dtype == np.float32 else value


def _described(robot: Robot) -> dict[str, Any]:
    return {"name": robot.name, "sha256": robot.sha256(), "description": robot.description()}


def _robot(content: Any, _: type) -> Robot:
    if isinstance(content, Robot):  # who reads the record has made it already
        return content
    robot = robot_from_description(content["description"])
    if robot.sha256() != content["sha256"]:
        raise ValueError("the robot's description does not have the hash that the file states")
    return robot


def _inline(kind: type) -> dict[str, type]:
    """Types of the parts whose fields stand beside those of the record."""
    hints = get_type_hints(kind)
    types = {each.name: hints[each.name] for each in fields(kind) if each.metadata.get("inline")}
    return {name: next((part for part in get_args(hint) if _is_record(part)), hint) for name, hint in types.items()}


def _entries(part: type) -> dict[str, str]:
    """Names of the entries by field, where they are not the same."""
    return {each.name: each.metadata.get("entry", each.name) for each in fields(part)}


def _overrides(kind: type, *, omit: bool) -> Any:
    """What cattrs is told of fields that are objects of the reader's, or have other names in the file."""
    made: dict[str, Any] = {name: override(rename=entry) for name, entry in _entries(kind).items() if entry != name}
    objects = [each.name for each in fields(kind) if each.metadata.get("object")]
    return made | {name: override(omit=omit, struct_hook=lambda value, _: value) for name in objects}


def _writer(kind: type, converter: cattrs.Converter) -> Callable[[Any], dict[str, Any]]:
    plain: Callable[[Any], dict[str, Any]] = make_dict_unstructure_fn(kind, converter, **_overrides(kind, omit=True))
    inline, listed = _inline(kind), getattr(kind, "listed", False)
    beside: Beside = getattr(kind, "beside", {})

    def write(record: Any) -> dict[str, Any]:
        record = record.stored() if hasattr(record, "stored") else record
        content = plain(record)
        for name in inline:
            content |= content.pop(name)
        if listed:
            lists = {name: each.tolist() for name, each in content.items() if isinstance(each, np.ndarray)}
            content |= converter.unstructure(lists)
        follow = {name: converter.unstructure(follows(record)) for name, follows in beside.items()}
        return _nested({**follow, **content})

    return write


def _nested(content: dict[str, Any]) -> dict[str, Any]:
    """Entries ``PART.NAME`` in the objects that they are of."""
    whole: dict[str, Any] = {}
    for entry, value in content.items():
        part, _, name = entry.rpartition(".")
        place = whole.setdefault(part, {}) if part else whole
        both = isinstance(value, dict) and isinstance(place.get(name), dict)
        place[name] = {**place[name], **value} if both else value
    return whole


def _flat(content: Mapping[str, Any], entries: Iterable[str]) -> dict[str, Any]:
    """The content with the entries ``PART.NAME`` beside the others."""
    flat = dict(content)
    for entry in entries:
        part, _, name = entry.rpartition(".")
        if part and isinstance(content.get(part), Mapping) and name in content[part]:
            flat[entry] = content[part][name]
    return flat


def _array(value: Any) -> Any:
    """The array of numbers in lists."""
    if not isinstance(value, list):
        return value if isinstance(value, bool | int) else _number(value, float)
    return np.array([_array(each) for each in value])


def _reader(kind: type, converter: cattrs.Converter) -> Callable[[Any, Any], Any]:
    plain: Callable[[Any, Any], Any] = make_dict_structure_fn(kind, converter, **_overrides(kind, omit=False))
    inline, hints = _inline(kind), get_type_hints(kind)
    listed = getattr(kind, "listed", False)
    arrays = [entry for name, entry in _entries(kind).items() if listed and _may_be_array(hints[name])]
    entries = [entry for part in (kind, *inline.values()) for entry in _entries(part).values()]

    def read(content: Any, _: Any) -> Any:
        if not isinstance(content, Mapping):
            raise TypeError(f"expected an object, given {content!r:.40}")
        content = _flat(content, entries)
        for name in arrays:
            if isinstance(content.get(name), list):
                content[name] = _array(content[name])
        for name, part in inline.items():
            content[name] = {entry: content[entry] for entry in _entries(part).values() if entry in content}
        return plain(content, kind)

    return read


def _may_be_array(hint: Any) -> bool:
    """Whether a field is an array, or one or None; not a tuple of arrays."""
    return any(_is(part, np.ndarray) for part in (hint, *(get_args(hint) if not _is(hint, tuple) else ())))


def _first(error: BaseException, place: str = "") -> str:
    """Place and reason of the first entry that is wrong."""
    if isinstance(error, cattrs.BaseValidationError):
        part, kind = error.exceptions[0], getattr(error, "cl", object)
        step = _step(part)
        if _is_record(kind) and step.startswith("."):
            inline = step[1:] in _inline(kind)
            step = "" if inline else f".{_entries(kind).get(step[1:], step[1:])}"
        return _first(part, place + step)
    if isinstance(error, KeyError):
        inside = place.removesuffix(f".{error.args[0]}").lstrip(".")
        return f"{inside}: {error} is missing" if inside else f"{error} is missing"
    return f"{place.lstrip('.')}: {error}" if place else str(error)


def _step(error: BaseException) -> str:
    """The entry that an error is about, as cattrs notes it: ``.name``, or ``[2]``."""
    for note in getattr(error, "__notes__", ()):
        if isinstance(note, cattrs.AttributeValidationNote):
            return f".{note.name}"
        if isinstance(note, cattrs.IterableValidationNote):
            return f"[{note.index}]"
    return ""
