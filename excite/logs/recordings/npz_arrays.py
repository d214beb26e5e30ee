"""Arrays of NumPy: NPY files, and NPZ archives of them. Arrays of objects are not read: they would need pickle."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, ClassVar

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from excite.logs.recordings.array_streams import ArrayFile, NamedArray, foreign_reader
from excite.logs.recordings.recording import Contents, Recording
from excite.logs.recordings.recording_format import RecordingFormat
from excite.logs.recordings.recording_size import check_table
from regressors.errors import InputError
from regressors.input_files import LOG, opened
from regressors.quoting import cut

_MOST_MEMBERS = 1000
_ENCRYPTED = 1  # bit of the flags of a member of a ZIP archive
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


class NpyFile(RecordingFormat):
    """One array in a file."""

    name: ClassVar[str] = "NPY"

    def recognises(self, head: bytes, path: Path) -> bool:
        """See `RecordingFormat.recognises`."""
        return head.startswith(npy.MAGIC_PREFIX)

    def contents(self, path: Path) -> Contents:
        """See `RecordingFormat.contents`."""
        return self._arrays(path).contents()

    def read(self, path: Path, wanted: Mapping[str, Sequence[str]]) -> Recording:
        """See `RecordingFormat.read`."""
        return self._arrays(path).read(wanted)

    def _arrays(self, path: Path) -> ArrayFile:
        file = ArrayFile(path, self.name)

        @contextmanager
        def stream() -> Iterator[IO[bytes]]:
            with opened(path, LOG) as content:
                yield content

        with foreign_reader(path, self.name):
            _add(file, path.stem, stream)
        return file


class NpzFile(RecordingFormat):
    """Several arrays in an archive."""

    name: ClassVar[str] = "NPZ"

    def recognises(self, head: bytes, path: Path) -> bool:
        """See `RecordingFormat.recognises`."""
        if not head.startswith(b"PK\x03\x04"):
            return False
        end = 30 + int.from_bytes(head[26:28], "little")  # of the first member's name
        return head[30:end].endswith(b".npy")

    def contents(self, path: Path) -> Contents:
        """See `RecordingFormat.contents`."""
        return self._arrays(path).contents()

    def read(self, path: Path, wanted: Mapping[str, Sequence[str]]) -> Recording:
        """See `RecordingFormat.read`."""
        return self._arrays(path).read(wanted)

    def _arrays(self, path: Path) -> ArrayFile:
        file = ArrayFile(path, self.name)
        with foreign_reader(path, self.name), opened(path, LOG) as content, zipfile.ZipFile(content) as archive:
            members = [member for member in archive.infolist() if member.filename.endswith(".npy")]
            if len(members) > _MOST_MEMBERS:
                raise InputError(f"{path} has {len(members)} arrays, more than the {_MOST_MEMBERS} that are read")
            for member in members:
                if member.flag_bits & _ENCRYPTED:
                    raise InputError(f"{path} is encrypted: {cut(member.filename)}; save it without a password")
                _add(file, member.filename.removesuffix(".npy"), _Member(path, member.filename))
        return file


class _Member:
    """A member of an archive, opened when it is called."""

    def __init__(self, path: Path, name: str) -> None:
        self.path, self.name = path, name

    @contextmanager
    def __call__(self) -> Iterator[IO[bytes]]:
        with opened(self.path, LOG) as content, zipfile.ZipFile(content) as archive, archive.open(self.name) as member:
            yield member


def _add(file: ArrayFile, name: str, stream: Any) -> None:
    """Add an array, or the fields of an array of records."""
    with stream() as content:
        shape, kind = _header(content)
    group = tuple(name.split("/")[:-1])
    for field, part in _fields(kind).items():
        load = _Loader(file.path, stream, field)
        full = f"{name}.{field}" if field else name
        file.add(NamedArray(full, (*group, name) if field else group, (*shape, *part.shape), load), part.base)


def _fields(kind: np.dtype[Any]) -> dict[str, np.dtype[Any]]:
    if kind.names is None or kind.hasobject:
        return {"": np.dtype("O") if kind.hasobject else kind}
    return {name: kind[name] for name in kind.names}


def _header(content: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = npy.read_magic(content)
    if version not in _HEADERS:
        raise ValueError(f"version {version} of NPY is not read")
    shape, _, kind = _HEADERS[version](content)
    return shape, kind


class _Loader:
    """Loads an array, or a field of it."""

    def __init__(self, path: Path, stream: Any, field: str) -> None:
        self.path, self.stream, self.field = path, stream, field

    def __call__(self) -> NDArray[Any]:
        with self.stream() as content:
            shape, kind = _header(content)
        check_table(self.path, float(np.prod(shape, dtype=float)) * kind.itemsize / 8, 1.0)
        with self.stream() as content:
            array = npy.read_array(content, allow_pickle=False)
        return np.asarray(array[self.field] if self.field else array)
