"""Messages of ROS as they are serialised: their definitions, where their numbers are, and what these are called.

The place of every number is found once, by walking one message, and used for all messages like it. CDR of ROS 2 (Object
Management Group, Common Data Representation, version 1, plain encapsulation) aligns every number to its own size,
counted from behind the four bytes of the encapsulation; ROS 1 packs without alignment, in little endian. Definitions
are those of the bag where it has them, else those that the type had in the releases of ROS, both parsed by rosbags: a
mapping of the names of types to their fields, each a name and a descriptor. No code is made from them, as the
deserialisers of rosbags would do. Names of columns follow PlotJuggler's.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from excite.logs.recordings.recording import LARGEST_ARRAY, Meaning, optional_package
from regressors.errors import cut

Fields: TypeAlias = list[tuple[str, Any]]
Definitions: TypeAlias = Mapping[str, Fields]
MESSAGE_TIME, STAMP = "message_time", "header/stamp"
TEMPERATURE = "sensor_msgs/msg/Temperature"
_COUNTER = "header/seq"  # of ROS 1
_LONGEST_TEXT = 200_000  # characters of a definition with all that it refers to
_DEEPEST, _MOST_STEPS = 16, 5000

_JOINT_STATE = "sensor_msgs/msg/JointState"
_CONTROLLER_STATE = "control_msgs/msg/JointTrajectoryControllerState"
_NAMES = ("name", "joint_names", "names")  # fields of strings that name the elements of arrays
_SINGULAR = {"positions": "position", "velocities": "velocity", "accelerations": "acceleration"}
_UNITS = {"position": "rad", "velocity": "rad/s", "effort": "Nm"}
_MEASURED = {_JOINT_STATE: ("",), _CONTROLLER_STATE: ("feedback", "actual")}  # parts of a message that were measured
_WRENCHES = {"geometry_msgs/msg/WrenchStamped": "wrench/", "geometry_msgs/msg/Wrench": ""}
# control_msgs is not among the types that rosbags knows. Its releases, newest first: 5 (Jazzy), 4 (Humble), 3 (Foxy).
_STATES = (
    (("reference", "feedback", "error", "output"), True),
    (("reference", "feedback", "error", "output", "desired", "actual"), True),
    (("desired", "actual", "error"), False),
)

_STAMPS = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
_BASE, _NAME, _ARRAY = 1, 2, 3  # of elements whose number is fixed; rosbags.interfaces.Nodetype
_SIZES = {
    "bool": "u1", "byte": "u1", "char": "u1", "uint8": "u1", "int8": "i1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip


class UnreadableMessage(Exception):
    """A message that does not follow its definition, or one of a kind that is not read; the text says why."""


def definitions_of(source: Path, name: str, form: str, text: str, ros1: bool = False) -> Iterator[Definitions]:
    """Definitions that a type may have, the most probable first; of a bag's own, the form is ``msg`` or ``idl``."""
    typesys = optional_package("rosbags.typesys", "ros", source)
    known = _known(ros1)
    if form:
        yield {**known, **_parsed(typesys, name, form, text)}
    elif name in known:
        yield known
    elif name == _CONTROLLER_STATE:
        for points, multi in _STATES:
            yield {**known, **_fields(typesys.get_types_from_msg(_state_text(points, multi), name))}


@cache
def _known(ros1: bool) -> dict[str, Fields]:
    """Types that rosbags knows of the last ROS 1 or of ROS 2, in whose releases those read here are the same."""
    from rosbags.typesys import Stores, get_typestore

    return _fields(get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.LATEST).fielddefs)


def _parsed(typesys: Any, name: str, form: str, text: str) -> dict[str, Fields]:
    if len(text) > _LONGEST_TEXT:
        raise UnreadableMessage(f"the definition of {cut(name)} has {len(text)} characters")
    try:
        own = typesys.get_types_from_msg(text, name) if form == "msg" else typesys.get_types_from_idl(text)
    except (typesys.TypesysError, ValueError, KeyError, IndexError, AssertionError, RecursionError, TypeError) as error:
        raise UnreadableMessage(f"the definition of {cut(name)} cannot be parsed") from error
    return _fields(own)


def _fields(definitions: Mapping[str, tuple[Any, Fields]]) -> dict[str, Fields]:
    return {name: fields for name, (_, fields) in definitions.items()}


def _state_text(points: tuple[str, ...], multi: bool) -> str:
    """Definition of the controller state of a release."""
    kind = "trajectory_msgs/{}JointTrajectoryPoint {}"
    lines = ["std_msgs/Header header", "string[] joint_names", *(kind.format("", name) for name in points)]
    if multi:
        lines += ["string[] multi_dof_joint_names", *(kind.format("MultiDOF", f"multi_dof_{name}") for name in points)]
    return "\n".join(lines)


@dataclass(frozen=True)
class NumberPlace:
    """Where some equal numbers are in a message."""

    at: int  # first byte
    kind: str  # NumPy's, with its byte order; "stamp" for seconds and nanoseconds
    count: int = 1
    array: bool = False  # whether it is an array, not one number


@dataclass(eq=False)
class MessageLayout:
    """Layout of all messages whose structural bytes are those of one."""

    order: str  # of the bytes, < or >
    places: dict[str, NumberPlace] = field(default_factory=dict)  # of its numbers, by paths such as wrench/force/x
    names: tuple[str, ...] = ()  # that the message gives to the elements of its arrays
    # First byte and end of what must be equal: lengths of arrays and texts, and the names.
    structure: list[tuple[int, int]] = field(default_factory=list)

    @property
    def fixed(self) -> NDArray[np.intp]:
        """Positions of the structural bytes."""
        return np.array([k for first, end in self.structure for k in range(first, end)], dtype=np.intp)


def message_layout(raw: bytes, name: str, definitions: Definitions, ros1: bool = False) -> MessageLayout:
    """Layout of a message of a type; one that does not follow the definition is an `UnreadableMessage`."""
    walk = _Walk(raw, definitions, ros1)
    walk.message(name, "", 0)
    if walk.at + (0 if ros1 else 3) < len(raw):  # the end may be padded
        raise UnreadableMessage("it is longer than its definition")
    return walk.layout


class _Walk:
    """A walk through one message."""

    def __init__(self, raw: bytes, definitions: Definitions, ros1: bool) -> None:
        self.raw, self.definitions, self.ros1 = raw, definitions, ros1
        self.origin = 0 if ros1 else 4
        self.at, self.steps = self.origin, 0
        self.layout = MessageLayout("<" if ros1 else _order(raw))
        if not ros1:
            self.layout.structure.append((0, 2))

    def message(self, name: str, path: str, depth: int) -> None:
        if depth > _DEEPEST:
            raise UnreadableMessage("its definition is nested too deeply")
        if name not in self.definitions:
            raise UnreadableMessage(f"type {name} is not defined")
        if name in _STAMPS:
            self.layout.places[path] = NumberPlace(self._skip(4, 8), "stamp")
            return
        for key, (node, args) in self.definitions[name]:
            self._field(f"{path}/{key}" if path else key, int(node), args, depth)

    def _field(self, path: str, node: int, args: Any, depth: int) -> None:
        self._step()
        if node == _NAME:
            self.message(str(args), path, depth + 1)
        elif node != _BASE:
            self._elements(path, args[0], args[1] if node == _ARRAY else self._length(), depth)
        elif args[0] == "string":
            self._text(False)
        elif args[0] in _SIZES:
            self._numbers(path, args[0], 1, array=False)
        else:
            raise UnreadableMessage(f"values of kind {args[0]} are not read")

    def _elements(self, path: str, element: tuple[Any, Any], count: int, depth: int) -> None:
        node, kind = element
        if node == _BASE and kind[0] in _SIZES:
            self._numbers(path, kind[0], count, array=True)
            return
        names = []
        for number in range(count):
            self._step()
            if node == _BASE and kind[0] == "string":
                names.append(self._text(path in _NAMES))
            else:
                self._field(f"{path}[{number}]", int(node), kind, depth)
        if path in _NAMES and names:
            self.layout.names = tuple(names)

    def _step(self) -> None:
        self.steps += 1
        if self.steps > _MOST_STEPS:
            raise UnreadableMessage("it has too many parts")

    def _numbers(self, path: str, kind: str, count: int, *, array: bool) -> None:
        size = int(_SIZES[kind][1])
        at = self._skip(size, size * count) if count else self.at
        if 0 < count <= LARGEST_ARRAY:
            self.layout.places[path] = NumberPlace(at, self.layout.order + _SIZES[kind], count, array)

    def _length(self) -> int:
        at = self._skip(4, 4)
        self.layout.structure.append((at, at + 4))
        return int(struct.unpack_from(self.layout.order + "I", self.raw, at)[0])

    def _text(self, kept: bool) -> str:
        length = self._length()
        at = self._skip(1, length)
        if not kept:
            return ""
        self.layout.structure.append((at, at + length))
        return self.raw[at : at + length].decode("utf-8", "replace").rstrip("\0")

    def _skip(self, alignment: int, size: int) -> int:
        """Position of the next ``size`` bytes, which are passed."""
        if not self.ros1:
            self.at += -(self.at - self.origin) % alignment
        at, self.at = self.at, self.at + size
        if self.at > len(self.raw):
            raise UnreadableMessage("it ends early")
        return at


def _order(raw: bytes) -> str:
    if raw[:2] not in (b"\0\0", b"\0\1") or len(raw) < 4:
        raise UnreadableMessage("it is not in plain CDR")
    return "<" if raw[1] else ">"


RosColumn: TypeAlias = tuple[NumberPlace, int, Meaning | None]  # place of some numbers, which of them, what it is


def layout_columns(topic: str, kind: str, layout: MessageLayout) -> dict[str, RosColumn]:
    """Columns of the messages of one layout and type, without the time at which they were recorded."""
    columns: dict[str, RosColumn] = {}
    names = layout.names if len(set(layout.names)) == len(layout.names) else ()
    for path, place in layout.places.items():
        if path == _COUNTER:
            continue
        if not place.array:
            columns[_joined(topic, path)] = place, 0, _wrench(kind, path)
        elif place.count == len(names) and "[" not in path:
            part, _, last = path.rpartition("/")
            last = _SINGULAR.get(last, last)
            for k, name in enumerate(names):
                columns[_joined(topic, name, part, last)] = place, k, _joint(kind, part, last, name)
        else:
            columns |= {f"{_joined(topic, path)}[{k}]": (place, k, None) for k in range(place.count)}
    return columns


def _joined(*parts: str) -> str:
    return "/".join(part for part in parts if part)


def _joint(kind: str, part: str, quantity: str, name: str) -> Meaning | None:
    if quantity not in _UNITS or part not in _MEASURED.get(kind, ()):
        return None
    return Meaning(quantity, name, _UNITS[quantity], kind.replace("/msg/", "/"))


def _wrench(kind: str, path: str) -> Meaning | None:
    prefix = _WRENCHES.get(kind)
    if prefix is None or not path.startswith((f"{prefix}force/", f"{prefix}torque/")):
        return None
    of = path.removeprefix(prefix).replace("/", ".")
    return Meaning("wrench", of, "N", kind.replace("/msg/", "/"))
