"""Streams from named arrays, in files that hold nothing but arrays: NPZ, HDF5, MATLAB."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from excite.logs.recordings.column_name import is_clock
from excite.logs.recordings.recording import Contents, Numbers, Recording, Stream, StreamContents
from excite.logs.recordings.recording_size import LARGEST_ARRAY, check_table
from regressors.errors import ExciteError, InputError
from regressors.quoting import cut, listed_names, one_line

_SHORTEST = 2  # rows of a stream
_REASON = 120  # characters of what a library says


@dataclass(frozen=True, eq=False)
class NamedArray:
    """An array of a file, which is not loaded yet."""

    name: str  # flattened, such as ``robot.q``
    group: tuple[str, ...]  # groups or structs that it is in, the outermost first
    shape: tuple[int, ...]
    load: Callable[[], NDArray[Any]]  # loads it, in this shape
    unit: str = ""  # unit that the file states; empty if none

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
        """Contents of the file."""
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
        with foreign_reader(file.path, file.form):
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


def numbers_of(values: NDArray[Any]) -> Numbers:
    """Whole numbers as they are, since they may be clocks, and all others as floats."""
    if values.dtype.kind == "i" or (values.dtype.kind == "u" and values.dtype.itemsize < 8):
        return np.ascontiguousarray(values, dtype=np.int64)
    if values.dtype.kind == "u" and not np.any(values > np.iinfo(np.int64).max):
        return np.ascontiguousarray(values, dtype=np.int64)
    return np.ascontiguousarray(values, dtype=float)


@contextmanager
def foreign_reader(path: Path, form: str) -> Iterator[None]:
    """Turn whatever a library raises on a damaged file into one line."""
    try:
        yield
    except (ExciteError, MemoryError):
        raise
    except Exception as error:  # each library has its own, and damaged files meet those of Python too
        said = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        reason = cut(one_line(said), _REASON) or type(error).__name__
        raise InputError(
            f"{path} cannot be read as {form}; it is damaged or was not written to its end: {reason}"
        ) from error
