"""Data elements of MAT-files of MATLAB 5 to 7.2.

Source: MathWorks, MAT-File Format (matfile_format.pdf), chapter 1: an element is a tag of type and size, and its
content; a matrix consists of elements for its class, dimensions, name and numbers. SciPy reads the same files, but its
reader may end the process on damaged ones.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from excite.logs.recordings.recording_size import check_bytes
from regressors.errors import InputError
from regressors.memory_cap import memory_cap

HEADER = 128  # bytes before the first element
CELL, STRUCT, OBJECT, CHAR, SPARSE, FUNCTION, OPAQUE = 1, 2, 3, 4, 5, 16, 17
NUMBERS = range(6, 16)  # classes double to uint64
_MATRIX, _COMPRESSED = 14, 15
_KINDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_COMPLEX = 0x08  # bit of the flags


class BrokenElement(Exception):
    """Bytes that are no element."""


@dataclass(frozen=True, eq=False)
class Matrix:
    """A variable, a field or an element of a cell, whose content is looked at when it is asked for."""

    kind: int  # its class
    shape: tuple[int, ...]
    name: str  # empty for fields and elements
    is_complex: bool
    content: memoryview  # elements behind those of class, dimensions and name
    order: str  # ``<`` or ``>``, of the bytes

    @property
    def number_kind(self) -> np.dtype[np.generic]:
        """Kind of the stored numbers; MATLAB stores whole doubles as small integers."""
        return np.dtype(self._stored()[0])

    def numbers(self) -> NDArray[np.generic]:
        """Its numbers, in the order of columns."""
        kind, content = self._stored()
        return np.frombuffer(content, kind).reshape(self.shape, order="F")

    def fields(self) -> Iterator[tuple[int, str, Matrix]]:
        """Fields of a struct or of an array of structs: the number of the struct, name and content."""
        _, lengths, at = _element(self.content, 0, self.order)
        _, text, at = _element(self.content, at, self.order)
        length = int(np.frombuffer(lengths[:4], f"{self.order}i4")[0]) if len(lengths) >= 4 else 0
        if length <= 0 or len(text) % length:
            raise BrokenElement("names of fields")
        raws = [bytes(text[k : k + length]) for k in range(0, len(text), length)]
        names = [raw.partition(b"\0")[0].decode("utf-8", "replace") for raw in raws]
        matrices = self._matrices(at)
        for number, inner in enumerate(matrices if names else ()):
            yield number // len(names), names[number % len(names)], inner

    def elements(self) -> Iterator[Matrix]:
        """Elements of a cell."""
        return self._matrices(0)

    def _matrices(self, at: int) -> Iterator[Matrix]:
        while at < len(self.content):
            kind, content, at = _element(self.content, at, self.order)
            if kind != _MATRIX:
                raise BrokenElement("a matrix was expected")
            if len(content):  # an empty element is an empty matrix
                yield _matrix(content, self.order)

    def _stored(self) -> tuple[str, memoryview]:
        kind, content, _ = _element(self.content, 0, self.order)
        if kind not in _KINDS:
            raise BrokenElement("numbers of an unknown kind")
        name = self.order + _KINDS[kind]
        if len(content) != np.dtype(name).itemsize * _product(self.shape):
            raise BrokenElement("fewer numbers than its dimensions")
        return name, content


def matrices_of(path: Path, stream: BinaryIO) -> Iterator[Matrix]:
    """Variables of a file."""
    head = stream.read(HEADER)
    if len(head) < HEADER:
        raise InputError(f"{path} ends within its header")
    order = "<" if head[126:128] == b"IM" else ">"
    end, total, at = stream.seek(0, 2), 0, HEADER
    while at + 8 <= end:
        stream.seek(at)
        kind, size = struct.unpack(f"{order}II", stream.read(8))
        if size > end - at - 8:
            raise InputError(f"{path} ends early: its variable at byte {at} is cut off; save it again")
        check_bytes(path, total + size)
        content = memoryview(stream.read(size))
        if kind == _COMPRESSED:
            kind, content, _ = _element(memoryview(_unpacked(path, content, total)), 0, order)
        total += len(content)
        if kind == _MATRIX and len(content):
            yield _matrix(content, order)
        at += 8 + size


def _unpacked(path: Path, content: memoryview, before: int) -> bytes:
    unpacker = zlib.decompressobj()
    most = int(memory_cap())
    raw = unpacker.decompress(content, most)
    if unpacker.unconsumed_tail and not unpacker.eof:
        check_bytes(path, before + most + 1)
    check_bytes(path, before + len(raw))
    return raw


def _matrix(content: memoryview, order: str) -> Matrix:
    _, flags, at = _element(content, 0, order)
    if len(flags) < 4:
        raise BrokenElement("flags of a matrix")
    word = struct.unpack_from(f"{order}I", flags)[0]
    kind, bits = word & 0xFF, word >> 8
    if kind == OPAQUE:
        return Matrix(kind, (), _opaque_name(content, at, order), False, content[at:], order)
    _, sides, at = _element(content, at, order)
    _, name, at = _element(content, at, order)
    shape = tuple(np.frombuffer(sides, f"{order}i4").tolist()) if len(sides) % 4 == 0 else (-1,)
    if not shape or min(shape) < 0:
        raise BrokenElement("dimensions of a matrix")
    return Matrix(kind, shape, bytes(name).decode("utf-8", "replace"), bool(bits & _COMPLEX), content[at:], order)


def _opaque_name(content: memoryview, at: int, order: str) -> str:
    _, name, _ = _element(content, at, order)
    return bytes(name).decode("utf-8", "replace")


def _element(content: memoryview, at: int, order: str) -> tuple[int, memoryview, int]:
    """Type and content of an element, and where the next begins."""
    if at + 8 > len(content):
        raise BrokenElement("an element ends early")
    kind, size = struct.unpack_from(f"{order}II", content, at)
    if kind >> 16:  # a small one, with its content in the tag
        size, kind, start, following = kind >> 16, kind & 0xFFFF, at + 4, at + 8
        if size > 4:
            raise BrokenElement("a small element is too large")
    else:
        start = at + 8
        following = start + size + (0 if kind == _COMPRESSED else -size % 8)
    if start + size > len(content):
        raise BrokenElement("an element ends early")
    return kind, content[start : start + size], following


def _product(shape: tuple[int, ...]) -> int:
    product = 1
    for size in shape:
        product *= size
    return product
