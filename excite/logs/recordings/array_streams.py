"""Streams from named arrays, in files that hold nothing but arrays (NPZ, HDF5, MATLAB), and the formats of NumPy.

Arrays of Python objects are not read: they would need pickle.
"""

from __future__ import annotations

import math
import re
import zipfile
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import IO, Any, ClassVar, TypeAlias

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from excite.logs.recordings.column_name import is_clock
from excite.logs.recordings.recording import (
    LARGEST_ARRAY,
    Contents,
    Numbers,
    Recording,
    RecordingFormat,
    Stream,
    StreamContents,
    check_table,
    foreign_reader,
    numbers_of,
)
from regressors.errors import InputError
from regressors.input_files import LOG, opened
from regressors.quoting import cut, listed_names

_SHORTEST = 2  # rows of a stream
_MOST_MEMBERS = 1000
_ENCRYPTED = 1  # bit of the flags of a member of a ZIP archive
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
_Opener: TypeAlias = Callable[[], AbstractContextManager[IO[bytes]]]


@dataclass(frozen=True, eq=False)
class NamedArray:
    """An array of a file, which is not loaded yet."""

    name: str  # flattened, such as robot.q
    group: tuple[str, ...]  # groups or structs that it is in, the outermost first
    shape: tuple[int, ...]
    load: Callable[[], NDArray[Any]]  # in this shape
    unit: str = ""  # that the file states; empty if none

    @property
    def sides(self) -> tuple[int, ...]:
        """Shape without sides of one element."""
        return tuple(size for size in self.shape if size != 1)

    @property
    def is_clock(self) -> bool:
        """Whether its name is that of a time."""
        return len(self.sides) == 1 and is_clock(re.split(r"[./]", self.name)[-1], self.unit)


@dataclass(eq=False)
class ArrayFile:
    """Arrays of a file, and what was found beside them."""

    path: Path
    form: str  # name of the format
    arrays: list[NamedArray] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)  # why others are not read, by their names

    def add(self, array: NamedArray, kind: np.dtype[Any]) -> None:
        """Add an array if it holds real numbers, at many instants; else note why it is left out."""
        if kind.kind not in "biuf":
            kinds = {"c": "complex numbers", "O": "objects, which only code could read", "V": "records"}
            self.left_out[array.name] = f"holds {kinds.get(kind.kind, 'text')}"
        elif len(array.sides) > 2:
            self.left_out[array.name] = f"has {len(array.sides)} dimensions"
        elif array.sides and 0 not in array.shape:
            self.arrays.append(array)

    def streams(self) -> dict[str, list[_Placed]]:
        """Arrays by stream: of equal length, and of the group that has their clock.

        An array belongs to the nearest group around it in which a time of its length is named, else to the file.
        """
        clocks = {(array.group, array.sides[0]) for array in self.arrays if array.is_clock}
        lengths = {array.sides[0] for array in self.arrays if len(array.sides) == 1}
        found: dict[tuple[tuple[str, ...], int], list[_Placed]] = {}
        for array in self.arrays:
            anchor, rows = _place(array, clocks, lengths)
            columns = math.prod(array.sides) // rows
            if columns > LARGEST_ARRAY:
                self.left_out[array.name] = f"has {columns} columns"
            elif rows >= _SHORTEST:
                found.setdefault((anchor, rows), []).append(_Placed(array, rows))
        taken: dict[tuple[str, ...], int] = {}
        streams = {}
        for (anchor, rows), several in found.items():
            name = several[0].joined(anchor) or "arrays"
            taken[anchor] = taken.get(anchor, 0) + 1
            streams[name if taken[anchor] == 1 else f"{name} of {rows} rows"] = several
        return streams

    def contents(self) -> Contents:
        """Contents of the file, which must have an array of numbers at many instants."""
        streams = self.streams()
        if not streams:
            why = "; ".join(f"{cut(name)} {why}" for name, why in list(self.left_out.items())[:5])
            raise InputError(f"{self.path} has no array of numbers" + (f": {why}" if why else ""))
        contents = tuple(
            StreamContents(
                name,
                tuple(column for one in placed for column in one.columns),
                placed[0].rows,
                units={column: one.array.unit for one in placed if one.array.unit for column in one.columns},
            )
            for name, placed in streams.items()
        )
        return Contents(str(self.path), self.form, contents, self._notes())

    def read(self, wanted: Mapping[str, Sequence[str]]) -> Recording:
        """Columns of the file; see `RecordingFormat.read`."""
        streams = self.streams()
        if missing := [name for name in wanted if name not in streams]:
            raise InputError(f"{self.path} has no {cut(missing[0])}; it has {listed_names(streams)}")
        read = {}
        for name, columns in wanted.items():
            needed = [one for one in streams[name] if not set(columns).isdisjoint(one.columns)]
            check_table(self.path, streams[name][0].rows, sum(len(one.columns) for one in needed))
            values = {column: numbers for one in needed for column, numbers in one.load(set(columns), self)}
            if absent := [column for column in columns if column not in values]:
                raise InputError(f"{self.path} has no column {cut(absent[0])}; it has {listed_names(values)}")
            read[name] = Stream(name, {column: values[column] for column in columns})
        return Recording(str(self.path), self.form, read, self._notes())

    def _notes(self) -> tuple[str, ...]:
        if not self.left_out:
            return ()
        names, more = list(self.left_out.items())[:5], len(self.left_out) - 5
        listed = "; ".join(f"{cut(name)} {why}" for name, why in names)
        return (f"left out: {listed}" + (f"; and {more} more" if more > 0 else ""),)


@dataclass(frozen=True, eq=False)
class _Placed:
    """An array whose rows are known."""

    array: NamedArray
    rows: int

    @property
    def transposed(self) -> bool:
        """Whether it has a column for each instant."""
        return len(self.array.sides) == 2 and self.array.sides[0] != self.rows

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of its columns."""
        name, sides = self.array.name, self.array.sides
        if len(sides) == 1:
            return (name,)
        return tuple(f"{name}[{k}]" for k in range(sides[0] if self.transposed else sides[1]))

    def joined(self, group: tuple[str, ...]) -> str:
        """Name of a group, written as in the name of the array."""
        return ("/" if "/" in self.array.name else ".").join(group)

    def load(self, wanted: set[str], file: ArrayFile) -> Iterator[tuple[str, Numbers]]:
        """Columns that are wanted."""
        table = np.asarray(self.array.load()).reshape(self.array.sides)
        if self.transposed:
            table = table.T
        for k, column in enumerate(self.columns):
            if column in wanted:
                yield column, numbers_of(table if table.ndim == 1 else table[:, k])


def _place(
    array: NamedArray, clocks: set[tuple[tuple[str, ...], int]], lengths: set[int]
) -> tuple[tuple[str, ...], int]:
    """Group whose clock an array has, and its rows."""
    sides = array.sides
    for depth in range(len(array.group), -1, -1):
        for rows in sides:
            if (array.group[:depth], rows) in clocks:
                return array.group[:depth], rows
    return (), next((rows for rows in sides if rows in lengths), max(sides))


class ArrayFormat(RecordingFormat):
    """A format that holds nothing but arrays."""

    @abstractmethod
    def arrays(self, path: Path) -> AbstractContextManager[ArrayFile]:
        """Arrays of a file, which can be loaded within the context."""

    def contents(self, path: Path) -> Contents:
        """See `RecordingFormat.contents`."""
        with foreign_reader(path, self.name), self.arrays(path) as file:
            return file.contents()

    def read(self, path: Path, wanted: Mapping[str, Sequence[str]]) -> Recording:
        """See `RecordingFormat.read`."""
        with foreign_reader(path, self.name), self.arrays(path) as file:
            return file.read(wanted)


class NpyFile(ArrayFormat):
    """One array in a file."""

    name: ClassVar[str] = "NPY"

    def recognises(self, head: bytes, path: Path) -> bool:
        """See `RecordingFormat.recognises`."""
        return head.startswith(npy.MAGIC_PREFIX)

    @contextmanager
    def arrays(self, path: Path) -> Iterator[ArrayFile]:
        """See `ArrayFormat.arrays`."""
        file = ArrayFile(path, self.name)
        _add(file, path.stem, partial(opened, path, LOG))
        yield file


class NpzFile(ArrayFormat):
    """Several arrays in an archive."""

    name: ClassVar[str] = "NPZ"

    def recognises(self, head: bytes, path: Path) -> bool:
        """See `RecordingFormat.recognises`."""
        if not head.startswith(b"PK\x03\x04"):
            return False
        end = 30 + int.from_bytes(head[26:28], "little")  # of the first member's name
        return head[30:end].endswith(b".npy")

    @contextmanager
    def arrays(self, path: Path) -> Iterator[ArrayFile]:
        """See `ArrayFormat.arrays`."""
        file = ArrayFile(path, self.name)
        with opened(path, LOG) as content, zipfile.ZipFile(content) as archive:
            members = [member for member in archive.infolist() if member.filename.endswith(".npy")]
            if len(members) > _MOST_MEMBERS:
                raise InputError(f"{path} has {len(members)} arrays, more than the {_MOST_MEMBERS} that are read")
            for member in members:
                if member.flag_bits & _ENCRYPTED:
                    raise InputError(f"{path} is encrypted: {cut(member.filename)}; save it without a password")
                _add(file, member.filename.removesuffix(".npy"), partial(_member, path, member.filename))
        yield file


@contextmanager
def _member(path: Path, name: str) -> Iterator[IO[bytes]]:
    with opened(path, LOG) as content, zipfile.ZipFile(content) as archive, archive.open(name) as member:
        yield member


def _add(file: ArrayFile, name: str, stream: _Opener) -> None:
    """Add an array, or the fields of an array of records."""
    with stream() as content:
        shape, kind = _header(content)
    group = tuple(name.split("/")[:-1])
    if kind.names is None or kind.hasobject:
        file.add(
            NamedArray(name, group, shape, partial(_loaded, file.path, stream)),
            np.dtype("O") if kind.hasobject else kind,
        )
        return
    for key in kind.names:
        part = kind[key]
        load = partial(_loaded, file.path, stream, key)
        file.add(NamedArray(f"{name}.{key}", (*group, name), (*shape, *part.shape), load), part.base)


def _header(content: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = npy.read_magic(content)
    if version not in _HEADERS:
        raise ValueError(f"version {version} of NPY is not read")
    shape, _, kind = _HEADERS[version](content)
    return shape, kind


def _loaded(path: Path, stream: _Opener, key: str = "") -> NDArray[Any]:
    """An array, or a field of its records."""
    with stream() as content:
        shape, kind = _header(content)
    check_table(path, float(np.prod(shape, dtype=float)) * kind.itemsize / 8, 1.0)
    with stream() as content:
        array = npy.read_array(content, allow_pickle=False)
    return np.asarray(array[key] if key else array)
