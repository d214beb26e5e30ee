"""Where the numbers of a serialised ROS message are: found once by walking one message, then used for all like it.

CDR of ROS 2 (Object Management Group, Common Data Representation, version 1, plain encapsulation) aligns every number
to its own size, counted from behind the four bytes of the encapsulation; ROS 1 packs without alignment, in little
endian.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from excite.logs.recordings.recording_size import LARGEST_ARRAY
from excite.logs.recordings.ros_definitions import Definitions, UnreadableMessage

NAMES = ("name", "joint_names", "names")  # fields of strings that name the elements of arrays
_STAMPS = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
_DEEPEST, _MOST_STEPS = 16, 5000
_BASE, _NAME, _ARRAY, _SEQUENCE = 1, 2, 3, 4  # rosbags.interfaces.Nodetype
_SIZES = {
    "bool": "u1", "byte": "u1", "char": "u1", "uint8": "u1", "int8": "i1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip


@dataclass(frozen=True)
class NumberPlace:
    """Where some equal numbers are."""

    at: int  # first byte
    kind: str  # NumPy's, with its byte order; ``stamp`` for seconds and nanoseconds
    count: int = 1
    array: bool = False  # whether it is an array, not one number


@dataclass(eq=False)
class MessageLayout:
    """Layout of all messages whose structural bytes are those of one."""

    length: int  # of the message [bytes]
    order: str  # ``<`` or ``>``, of the bytes
    # of its numbers, by their path, such as ``wrench/force/x``
    places: dict[str, NumberPlace] = field(default_factory=dict)
    names: tuple[str, ...] = ()  # that the message gives to the elements of its arrays
    # first byte and end of what must be equal: lengths of arrays and texts, and the names
    structure: list[tuple[int, int]] = field(default_factory=list)

    @property
    def fixed(self) -> NDArray[np.intp]:
        """Positions of the structural bytes."""
        spans = [np.arange(first, end) for first, end in self.structure]
        return np.concatenate(spans) if spans else np.zeros(0, dtype=np.intp)


class _Walk:
    """A walk through one message."""

    def __init__(self, raw: bytes, definitions: Definitions, ros1: bool) -> None:
        self.raw, self.definitions, self.ros1 = raw, definitions, ros1
        self.origin = 0 if ros1 else 4
        self.at, self.steps = self.origin, 0
        self.layout = MessageLayout(len(raw), "<" if ros1 else _order(raw))
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
        self.steps += 1
        if self.steps > _MOST_STEPS:
            raise UnreadableMessage("it has too many parts")
        if node == _NAME:
            self.message(str(args), path, depth + 1)
        elif node == _BASE:
            self._base(path, args[0])
        else:
            self._elements(path, args[0], args[1] if node == _ARRAY else self._length(), depth)

    def _elements(self, path: str, element: tuple[Any, Any], count: int, depth: int) -> None:
        node, kind = element
        if node == _BASE and kind[0] in _SIZES:
            self._numbers(path, kind[0], count)
            return
        names = []
        for number in range(count):
            self.steps += 1
            if node == _BASE and kind[0] == "string":
                names.append(self._text(path in NAMES))
            else:
                self._field(f"{path}[{number}]", int(node), kind, depth)
            if self.steps > _MOST_STEPS:
                raise UnreadableMessage("it has too many parts")
        if path in NAMES and names:
            self.layout.names = tuple(names)

    def _base(self, path: str, kind: str) -> None:
        if kind == "string":
            self._text(False)
        elif kind in _SIZES:
            size = int(_SIZES[kind][1])
            self.layout.places[path] = NumberPlace(self._skip(size, size), self._kind(kind))
        else:
            raise UnreadableMessage(f"values of kind {kind} are not read")

    def _numbers(self, path: str, kind: str, count: int) -> None:
        size = int(_SIZES[kind][1])
        at = self._skip(size, size * count) if count else self.at
        if 0 < count <= LARGEST_ARRAY:
            self.layout.places[path] = NumberPlace(at, self._kind(kind), count, array=True)

    def _kind(self, kind: str) -> str:
        return self.layout.order + _SIZES[kind]

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


def message_layout(raw: bytes, name: str, definitions: Definitions, ros1: bool = False) -> MessageLayout:
    """Layout of a message."""
    walk = _Walk(raw, definitions, ros1)
    walk.message(name, "", 0)
    if walk.at + (0 if ros1 else 3) < len(raw):  # the end may be padded
        raise UnreadableMessage("it is longer than its definition")
    return walk.layout
