"""Streams from named arrays, in files that hold nothing but arrays, and the formats NPY, NPZ, JSON and HDF5.

Arrays of Python objects are not read: they would need pickle. What refers to other files is not followed.
"""

from __future__ import annotations

import json
import math
import re
import zipfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import IO, Any, TypeAlias

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from excite.logs.recordings.recording import (
    LARGEST_ARRAY,
    Contents,
    Recording,
    RecordingFormat,
    Stream,
    StreamContents,
    Wanted,
    check_bytes,
    check_table,
    check_wanted,
    foreign_reader,
    is_clock,
    left_out_note,
    numbers_of,
    optional_package,
)
from excite.logs.text import log_opened
from regressors.errors import InputError, cut
from regressors.input_files import LOG, in_bytes, opened

_SHORTEST = 2  # rows of a stream
_Group: TypeAlias = tuple[str, ...]  # groups or structs that something is in, the outermost first


@dataclass(frozen=True, eq=False)
class NamedArray:
    """An array of a file, which is not loaded yet."""

    name: str  # flattened, such as robot.q
    group: _Group
    shape: tuple[int, ...]
    load: Callable[..., NDArray[Any]]  # in this shape; a field of one of records by its name
    unit: str = ""  # that the file states; empty if none

    @property
    def sides(self) -> tuple[int, ...]:
        """Shape without sides of one element."""
        return tuple(size for size in self.shape if size != 1)

    @property
    def is_clock(self) -> bool:
        """Whether its name is that of a time."""
        return len(self.sides) == 1 and is_clock(re.split(r"[./]", self.name)[-1], self.unit)

    def columns(self, rows: int) -> tuple[str, ...]:
        """Names of its columns of so many rows."""
        count = math.prod(self.sides) // rows
        return (self.name,) if len(self.sides) == 1 else tuple(f"{self.name}[{k}]" for k in range(count))

    def table(self, rows: int) -> NDArray[Any]:
        """Its numbers, with a row for each instant; it may hold a column for each."""
        table = np.asarray(self.load()).reshape(self.sides)
        return (table if self.sides[0] == rows else table.T).reshape(rows, -1)


@dataclass(eq=False)
class ArrayFile:
    """Arrays of a file, and what was found beside them."""

    path: Path
    form: str  # name of the format
    arrays: list[NamedArray] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)  # why others are not read, by their names
    # array of names of joints and the names, by the group and the number of columns that they are of
    joints: dict[tuple[_Group, int], tuple[str, list[str]]] = field(default_factory=dict)

    def add(self, array: NamedArray, kind: np.dtype[Any]) -> None:
        """Add an array, or the fields of one of records, which are loaded by their names."""
        if kind.names is None:
            self._add(array, kind)
        for key in kind.names or ():
            part, own = kind[key], (*array.group, array.name)
            shape, load = (*array.shape, *part.shape), partial(array.load, key)
            self._add(NamedArray(f"{array.name}.{key}", own, shape, load), part.base)

    def _add(self, array: NamedArray, kind: np.dtype[Any]) -> None:
        """Add an array if it holds real numbers, at many instants; else note why it is left out."""
        if kind.kind not in "biuf":
            if names := _names_in(array, kind):
                self.joints[array.group, len(names)] = array.name, names
            kinds = {"c": "complex numbers", "O": "objects, which only code could read", "V": "records"}
            self.left_out[array.name] = f"holds {kinds.get(kind.kind, 'text')}"
        elif len(array.sides) > 2:
            self.left_out[array.name] = f"has {len(array.sides)} dimensions"
        elif array.sides and 0 not in array.shape:
            self.arrays.append(array)

    def streams(self) -> dict[str, tuple[int, list[NamedArray]]]:
        """Rows and arrays of each stream: of equal length, of the nearest group around them with their clock."""
        clocks = {(array.group, array.sides[0]) for array in self.arrays if array.is_clock}
        lengths = {array.sides[0] for array in self.arrays if len(array.sides) == 1}
        found: dict[tuple[_Group, int], list[NamedArray]] = {}
        for array in self.arrays:
            anchor, rows = _place(array, clocks, lengths)
            columns = math.prod(array.sides) // rows
            if columns > LARGEST_ARRAY:
                self.left_out[array.name] = f"has {columns} columns"
            elif rows >= _SHORTEST:
                found.setdefault((anchor, rows), []).append(array)
        streams: dict[str, tuple[int, list[NamedArray]]] = {}
        taken: set[_Group] = set()
        for (anchor, rows), several in found.items():
            name = ("/" if "/" in several[0].name else ".").join(anchor) or "arrays"
            streams[f"{name} of {rows} rows" if anchor in taken else name] = rows, several
            taken.add(anchor)
        return streams

    def contents(self) -> Contents:
        """Contents of the file, which must have an array of numbers at many instants."""
        contents = []
        for name, (rows, arrays) in self.streams().items():
            units = {column: array.unit for array in arrays if array.unit for column in array.columns(rows)}
            columns = tuple(column for array in arrays for column in array.columns(rows))
            titles = {column: title for array in arrays for column, title in self._titles(array, rows)}
            contents.append(StreamContents(name, columns, rows, units=units, titles=titles))
        if not contents:
            why = "; ".join(f"{cut(name)} {why}" for name, why in list(self.left_out.items())[:5])
            raise InputError(f"{self.path} has no array of numbers" + (f": {why}" if why else ""))
        return Contents(str(self.path), self.form, tuple(contents), left_out_note(self.left_out))

    def _titles(self, array: NamedArray, rows: int) -> Iterator[tuple[str, str]]:
        """Columns of an array, and their titles by the names of joints in the file, if it has as many."""
        columns = array.columns(rows)
        keys = [(array.group[:depth], len(columns)) for depth in range(len(array.group), -1, -1)]
        for of, names in [self.joints[key] for key in keys if key in self.joints][:1]:
            self.left_out.pop(of, None)
            yield from ((column, f"{array.name}/{name}") for column, name in zip(columns, names, strict=True))

    def read(self, wanted: Wanted) -> Recording:
        """Columns of the file."""
        notes, streams, read = self.contents().notes, self.streams(), {}
        known = {name: [c for array in arrays for c in array.columns(rows)] for name, (rows, arrays) in streams.items()}
        check_wanted(self.path, wanted, known)
        for name, columns in wanted.items():
            rows, arrays = streams[name]
            asked = set(columns)
            needed = [array for array in arrays if not asked.isdisjoint(array.columns(rows))]
            check_table(self.path, rows, sum(len(array.columns(rows)) for array in needed))
            values = {}
            for array in needed:
                table = array.table(rows)
                named = enumerate(array.columns(rows))
                values.update({column: numbers_of(table[:, k]) for k, column in named if column in asked})
            read[name] = Stream(name, {column: values[column] for column in columns})
        return Recording(str(self.path), self.form, read, notes)


_OF_JOINTS = re.compile(r"(?:^|[./_])(?:joint_?)?names?$", re.IGNORECASE)


def _names_in(array: NamedArray, kind: np.dtype[Any]) -> list[str]:
    """Different names of joints in an array of text, which may repeat them in each row; none where it holds none."""
    variable: Any = dict(kind.metadata or {}).get("vlen")  # type of the texts of HDF5 in an array of objects
    is_text, sides = kind.kind in "US" or variable in (str, bytes), array.sides
    if not (is_text and _OF_JOINTS.search(array.name) and 0 < len(sides) <= 2 and sides[-1] <= LARGEST_ARRAY):
        return []
    rows = np.asarray(array.load()).reshape(array.sides)
    first = rows if rows.ndim == 1 else rows[0]
    names = [name.decode("utf-8", "replace") if isinstance(name, bytes) else str(name) for name in first.tolist()]
    return names if np.all(rows == first) and len(set(names)) == len(names) > 1 else []


def _place(array: NamedArray, clocks: set[tuple[_Group, int]], lengths: set[int]) -> tuple[_Group, int]:
    """Group whose clock an array has, and its rows."""
    for depth in range(len(array.group), -1, -1):
        for rows in array.sides:
            if (array.group[:depth], rows) in clocks:
                return array.group[:depth], rows
    return (), next((rows for rows in array.sides if rows in lengths), max(array.sides))


Filler: TypeAlias = Callable[[ArrayFile], AbstractContextManager[Any]]  # adds arrays, to be loaded within its context


@contextmanager
def arrays_of(path: Path, form: str, fill: Filler) -> Iterator[ArrayFile]:
    """Arrays of a file, which can be loaded within the context."""
    file = ArrayFile(path, form)
    with foreign_reader(path, form), fill(file):
        yield file


def array_format(name: str, recognises: Callable[[bytes], bool], fill: Filler) -> RecordingFormat:
    """A format that holds nothing but arrays, which is recognised by its first bytes."""

    def contents(path: Path) -> Contents:
        with arrays_of(path, name, fill) as file:
            return file.contents()

    def read(path: Path, wanted: Wanted) -> Recording:
        with arrays_of(path, name, fill) as file:
            return file.read(wanted)

    return RecordingFormat(name, lambda head, _: recognises(head), contents, read)


_MOST_MEMBERS = 1000
_ENCRYPTED = 1  # bit of the flags of a member of a ZIP archive
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
_Opener: TypeAlias = Callable[[], AbstractContextManager[IO[bytes]]]


def fill_from_npy(file: ArrayFile) -> AbstractContextManager[Any]:
    """Add the array of an NPY."""
    _add_npy(file, file.path.stem, partial(opened, file.path, LOG))
    return nullcontext()


def _fill_from_npz(file: ArrayFile) -> AbstractContextManager[Any]:
    path = file.path
    with opened(path, LOG) as content, zipfile.ZipFile(content) as archive:
        members = [member for member in archive.infolist() if member.filename.endswith(".npy")]
        if len(members) > _MOST_MEMBERS:
            raise InputError(f"{path} has {len(members)} arrays, more than the {_MOST_MEMBERS} that are read")
        for member in members:
            if member.flag_bits & _ENCRYPTED:
                raise InputError(f"{path} is encrypted: {cut(member.filename)}; save it without a password")
            _add_npy(file, member.filename.removesuffix(".npy"), partial(_member, path, member.filename))
    return nullcontext()


@contextmanager
def _member(path: Path, name: str) -> Iterator[IO[bytes]]:
    with opened(path, LOG) as content, zipfile.ZipFile(content) as archive, archive.open(name) as member:
        yield member


def _add_npy(file: ArrayFile, name: str, stream: _Opener) -> None:
    shape, kind = _header(stream)
    whole = np.dtype("O") if kind.hasobject else kind
    file.add(NamedArray(name, tuple(name.split("/")[:-1]), shape, partial(_loaded_npy, file.path, stream)), whole)


def _header(stream: _Opener) -> tuple[tuple[int, ...], np.dtype[Any]]:
    with stream() as content:
        version = npy.read_magic(content)
        if version not in _HEADERS:
            raise ValueError(f"version {version} of NPY is not read")
        shape, _, kind = _HEADERS[version](content)
        return shape, kind


def _loaded_npy(path: Path, stream: _Opener, key: str = "") -> NDArray[Any]:
    """An array, or a field of its records."""
    shape, kind = _header(stream)
    check_table(path, float(np.prod(shape, dtype=float)) * kind.itemsize / 8, 1.0)
    with stream() as content:
        array = npy.read_array(content, allow_pickle=False)
    return np.asarray(array[key] if key else array)


def _is_npz(head: bytes) -> bool:
    end = 30 + int.from_bytes(head[26:28], "little")  # of the first member's name
    return head.startswith(b"PK\x03\x04") and head[30:end].endswith(b".npy")


NPY = array_format("NPY", lambda head: head.startswith(npy.MAGIC_PREFIX), fill_from_npy)
NPZ = array_format("NPZ", _is_npz, _fill_from_npz)

_JSON_BYTES = 12.0  # of memory for each byte of its text
_ROWS = "rows"  # what an array without a name is called


def _fill_from_json(file: ArrayFile) -> AbstractContextManager[Any]:
    """Add the lists of numbers of an object, or of a list or lines of them, one a row."""
    check_bytes(file.path, _JSON_BYTES * file.path.stat().st_size)
    with opened(file.path, LOG) as stream:
        text = stream.read().decode("utf-8-sig")
    try:
        content = json.loads(text)
    except json.JSONDecodeError:  # an object a line, of which the last one may have been cut off
        *lines, last = text.strip().split("\n")
        content = [json.loads(line) for line in lines if line.strip()]
        try:
            content.append(json.loads(last))
        except json.JSONDecodeError:
            if not content:
                raise
            file.left_out["its last line"] = "was not written to its end"
    _add_json(file, (), content)
    return nullcontext()


def _add_json(file: ArrayFile, above: _Group, content: Any) -> None:
    if isinstance(content, list) and content and all(isinstance(row, dict) for row in content):
        content = {key: [row.get(key) for row in content] for key in content[0]}
    if isinstance(content, dict):
        for key, each in content.items():
            _add_json(file, (*above, key), each)
        return
    name = "/".join(above) or _ROWS
    try:
        array = np.array(content)
        array = array.astype(float) if array.dtype.kind == "O" else array  # None is NaN
    except (ValueError, TypeError):
        file.left_out[name] = "holds rows of different lengths, or words"
        return
    file.add(NamedArray(name, above[:-1], array.shape, lambda: array), array.dtype)


_STARTS_JSON = re.compile(rb"(?:\xef\xbb\xbf)?\s*(?:\{|\[\s*[-\d\[{])")
JSON = array_format("JSON", lambda head: _STARTS_JSON.match(head) is not None, _fill_from_json)

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
MOST_OBJECTS, DEEPEST = 10_000, 32
_LARGEST_CHUNK = 2**28  # bytes, which are held beside the numbers
_STARTS = (0, 512, 1024, 2048)  # of the signature, behind a user block
_UNITS = ("units", "unit", "Units", "Unit")


@contextmanager
def _fill_from_hdf5(file: ArrayFile) -> Iterator[None]:
    with hdf5_opened(file.path, "hdf5") as base:
        _walk(file, base, ())
        yield


def hdf5_opened(path: Path, extra: str) -> Any:
    """An HDF5 file, opened by h5py."""
    h5py = optional_package("h5py", extra, path)
    with log_opened(path) as stream:  # not a device or a pipe
        stream.read(1)
    return h5py.File(path, "r", locking=False)


def _walk(file: ArrayFile, group: Any, above: _Group, met: set[Any] | None = None) -> None:
    """Add all datasets of a group and of those in it."""
    import h5py

    met = {h5py.h5o.get_info(group.id).addr} if met is None else met
    for key in group:
        name = "/".join((*above, key))
        if not isinstance(group.get(key, getlink=True), h5py.HardLink):
            file.left_out[name] = "is a link"
            continue
        one = group[key]
        address = h5py.h5o.get_info(one.id).addr
        if address in met:  # a group may contain itself
            continue
        met.add(address)
        if len(met) > MOST_OBJECTS or len(above) > DEEPEST:
            raise InputError(f"{file.path} has more than {MOST_OBJECTS} objects, or groups nested too deeply")
        if isinstance(one, h5py.Group):
            _walk(file, one, (*above, key), met)
        elif isinstance(one, h5py.Dataset) and not left_unread(file, one, name):
            file.add(NamedArray(name, above, one.shape or (), partial(_loaded_hdf5, one), _unit_of(one)), one.dtype)


def left_unread(file: ArrayFile, data: Any, name: str) -> bool:
    """Whether a dataset is left out, since it is not in this file or in pieces that are too large."""
    chunk = math.prod(data.chunks or (0,)) * data.dtype.itemsize
    if data.external:
        file.left_out[name] = "is stored in another file"
    elif data.is_virtual:
        file.left_out[name] = "is put together from others"
    elif chunk > _LARGEST_CHUNK:
        file.left_out[name] = f"is stored in pieces of {in_bytes(chunk)}"
    return name in file.left_out


def _unit_of(data: Any) -> str:
    """Unit that an attribute of a dataset states; empty if none does."""
    value = next((data.attrs[key] for key in _UNITS if key in data.attrs), "")
    value = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
    return str(value) if isinstance(value, str) else ""


def _loaded_hdf5(data: Any, field: str = "") -> NDArray[Any]:
    """A dataset, or a field of it, while its file is open."""
    return np.asarray(data[field] if field else data[()])


HDF5 = array_format(
    "HDF5", lambda head: any(head[start : start + len(_SIGNATURE)] == _SIGNATURE for start in _STARTS), _fill_from_hdf5
)
