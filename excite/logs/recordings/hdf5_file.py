"""Arrays in HDF5; what refers to other files is not followed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from excite.logs.recordings.array_streams import ArrayFile, NamedArray, foreign_reader
from excite.logs.recordings.optional_package import optional_package
from excite.logs.recordings.recording import Contents, Recording
from excite.logs.recordings.recording_format import RecordingFormat
from regressors.errors import InputError
from regressors.input_files import LOG, in_bytes, opened

SIGNATURE = b"\x89HDF\r\n\x1a\n"
MOST_OBJECTS, DEEPEST = 10_000, 32
_LARGEST_CHUNK = 2**28  # bytes, which are held beside the numbers
_STARTS = (0, 512, 1024, 2048)  # of the signature, behind a user block
_UNITS = ("units", "unit", "Units", "Unit")


class Hdf5File(RecordingFormat):
    """A file in HDF5."""

    name: ClassVar[str] = "HDF5"

    def recognises(self, head: bytes, path: Path) -> bool:
        """See `RecordingFormat.recognises`."""
        return any(head[start : start + len(SIGNATURE)] == SIGNATURE for start in _STARTS)

    def contents(self, path: Path) -> Contents:
        """See `RecordingFormat.contents`."""
        with foreign_reader(path, self.name), hdf5_opened(path, "hdf5") as base:
            return self._arrays(path, base).contents()

    def read(self, path: Path, wanted: Mapping[str, Sequence[str]]) -> Recording:
        """See `RecordingFormat.read`."""
        with foreign_reader(path, self.name), hdf5_opened(path, "hdf5") as base:
            return self._arrays(path, base).read(wanted)

    def _arrays(self, path: Path, base: Any) -> ArrayFile:
        file = ArrayFile(path, self.name)
        walk(file, base, ())
        return file


def hdf5_opened(path: Path, extra: str) -> Any:
    """An HDF5 file, opened by h5py."""
    h5py = optional_package("h5py", extra, path)
    try:
        with opened(path, LOG) as stream:  # not a device or a pipe
            stream.read(1)
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
    return h5py.File(path, "r", locking=False)


def walk(file: ArrayFile, group: Any, above: tuple[str, ...], met: set[Any] | None = None) -> None:
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
        if isinstance(one, h5py.Dataset):
            _add(file, one, name, above)
        elif isinstance(one, h5py.Group):
            walk(file, one, (*above, key), met)


def _add(file: ArrayFile, data: Any, name: str, above: tuple[str, ...]) -> None:
    if why := unread_dataset(data):
        file.left_out[name] = why
        return
    kind, shape = data.dtype, data.shape or ()
    if kind.names is None:
        file.add(NamedArray(name, above, shape, _Load(data), unit_of(data)), kind)
        return
    for field in kind.names:
        inner = kind[field]
        array = NamedArray(f"{name}.{field}", (*above, name), (*shape, *inner.shape), _Load(data, field))
        file.add(array, inner.base)


def unread_dataset(data: Any) -> str:
    """Why a dataset is not read, since it is not in this file or in pieces that are too large; empty if it is read."""
    if data.external:
        return "is stored in another file"
    if data.is_virtual:
        return "is put together from others"
    chunk = math.prod(data.chunks or (0,)) * data.dtype.itemsize
    return f"is stored in pieces of {in_bytes(chunk)}" if chunk > _LARGEST_CHUNK else ""


def unit_of(data: Any) -> str:
    """Unit that an attribute of a dataset states; empty if none does."""
    for key in _UNITS:
        if key in data.attrs:
            value = data.attrs[key]
            value = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
            return str(value) if isinstance(value, str) else ""
    return ""


class _Load:
    """Loads a dataset, or a field of it, while its file is open."""

    def __init__(self, data: Any, field: str = "") -> None:
        self.data, self.field = data, field

    def __call__(self) -> NDArray[Any]:
        return np.asarray(self.data[self.field] if self.field else self.data[()])
