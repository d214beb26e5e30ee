"""Arrays in HDF5; what refers to other files is not followed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from excite.logs.recordings.array_streams import ArrayFile, ArrayFormat, NamedArray
from excite.logs.recordings.recording import optional_package
from regressors.errors import InputError
from regressors.input_files import LOG, in_bytes, opened

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
MOST_OBJECTS, DEEPEST = 10_000, 32
_LARGEST_CHUNK = 2**28  # bytes, which are held beside the numbers
_STARTS = (0, 512, 1024, 2048)  # of the signature, behind a user block
_UNITS = ("units", "unit", "Units", "Unit")


class Hdf5File(ArrayFormat):
    """A file in HDF5."""

    name: ClassVar[str] = "HDF5"

    def recognises(self, head: bytes, path: Path) -> bool:
        """See `RecordingFormat.recognises`."""
        return any(head[start : start + len(_SIGNATURE)] == _SIGNATURE for start in _STARTS)

    @contextmanager
    def arrays(self, path: Path) -> Iterator[ArrayFile]:
        """See `ArrayFormat.arrays`."""
        file = ArrayFile(path, self.name)
        with hdf5_opened(path, "hdf5") as base:
            _walk(file, base, ())
            yield file


def hdf5_opened(path: Path, extra: str) -> Any:
    """An HDF5 file, opened by h5py."""
    h5py = optional_package("h5py", extra, path)
    try:
        with opened(path, LOG) as stream:  # not a device or a pipe
            stream.read(1)
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
    return h5py.File(path, "r", locking=False)


def _walk(file: ArrayFile, group: Any, above: tuple[str, ...], met: set[Any] | None = None) -> None:
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
            _walk(file, one, (*above, key), met)


def _add(file: ArrayFile, data: Any, name: str, above: tuple[str, ...]) -> None:
    if why := unread_dataset(data):
        file.left_out[name] = why
        return
    kind, shape = data.dtype, data.shape or ()
    if kind.names is None:
        file.add(NamedArray(name, above, shape, partial(_loaded, data), _unit_of(data)), kind)
        return
    for field in kind.names:
        inner = kind[field]
        array = NamedArray(f"{name}.{field}", (*above, name), (*shape, *inner.shape), partial(_loaded, data, field))
        file.add(array, inner.base)


def unread_dataset(data: Any) -> str:
    """Why a dataset is not read, since it is not in this file or in pieces that are too large; empty if it is read."""
    if data.external:
        return "is stored in another file"
    if data.is_virtual:
        return "is put together from others"
    chunk = math.prod(data.chunks or (0,)) * data.dtype.itemsize
    return f"is stored in pieces of {in_bytes(chunk)}" if chunk > _LARGEST_CHUNK else ""


def _unit_of(data: Any) -> str:
    """Unit that an attribute of a dataset states; empty if none does."""
    for key in _UNITS:
        if key in data.attrs:
            value = data.attrs[key]
            value = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
            return str(value) if isinstance(value, str) else ""
    return ""


def _loaded(data: Any, field: str = "") -> NDArray[Any]:
    """A dataset, or a field of it, while its file is open."""
    return np.asarray(data[field] if field else data[()])
