"""MAT-files of MATLAB 5 to 7.2, read by SciPy; what MATLAB would have to run, such as function handles, is left out."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, BinaryIO, ClassVar

import numpy as np
from numpy.typing import NDArray

from excite.logs.recordings.array_streams import ArrayFile, NamedArray, foreign_reader
from excite.logs.recordings.recording import Contents, Recording
from excite.logs.recordings.recording_format import RecordingFormat
from excite.logs.recordings.recording_size import check_bytes
from regressors.errors import InputError
from regressors.input_files import LOG, opened

_HEADER = 128  # bytes
_COMPRESSED = 15  # type of a data element
_MOST, _DEEPEST = 10_000, 32
_BLOCK = 2**20


class MatlabFile(RecordingFormat):
    """A MAT-file of MATLAB 5 to 7.2."""

    name: ClassVar[str] = "MAT-file"

    def recognises(self, head: bytes, path: Path) -> bool:
        """See `RecordingFormat.recognises`."""
        return head.startswith(b"MATLAB 5.0 MAT-file") or head[124:128] in (b"\x00\x01IM", b"\x01\x00MI")

    def contents(self, path: Path) -> Contents:
        """See `RecordingFormat.contents`."""
        with foreign_reader(path, self.name):
            status = path.stat()
            return _contents(path, status.st_size, status.st_mtime_ns)

    def read(self, path: Path, wanted: Mapping[str, Sequence[str]]) -> Recording:
        """See `RecordingFormat.read`."""
        with foreign_reader(path, self.name):
            return _arrays(path).read(wanted)


@lru_cache(maxsize=4)
def _contents(path: Path, size: int, changed: int) -> Contents:
    """Contents of a file of this size and time; the file does not tell them without being loaded."""
    return _arrays(path).contents()


def _arrays(path: Path) -> ArrayFile:
    import scipy.io

    file = ArrayFile(path, MatlabFile.name)
    with opened(path, LOG) as stream:
        _check_size(path, stream)
        stream.seek(0)
        content = scipy.io.loadmat(stream, struct_as_record=True, squeeze_me=False)
    variables = _Variables(file)
    for name, value in content.items():
        if not name.startswith("__"):
            variables.add(value, name, ())
    return file


def _check_size(path: Path, stream: BinaryIO) -> None:
    """Refuse a file whose compressed variables are larger than may be held."""
    head = stream.read(_HEADER)
    if len(head) < _HEADER:
        raise InputError(f"{path} ends within its header")
    order = "<" if head[126:128] == b"IM" else ">"
    end, total = stream.seek(0, 2), 0
    at = stream.seek(_HEADER)
    while at + 8 <= end:
        kind, size = struct.unpack(f"{order}II", stream.read(8))
        if size > end - at - 8:
            raise InputError(f"{path} ends early: its variable at byte {at} is cut off")
        total += _unpacked_size(path, stream, size, total) if kind == _COMPRESSED else size
        at = stream.seek(at + 8 + size)
    check_bytes(path, 2 * total)  # SciPy holds what it unpacks and what it makes of it


def _unpacked_size(path: Path, stream: BinaryIO, size: int, before: int) -> int:
    """Size of a compressed variable, counted without holding it."""
    unpacker, total = zlib.decompressobj(), 0
    while size > 0 and not unpacker.eof:
        block = unpacker.unconsumed_tail or stream.read(min(size, _BLOCK))
        size -= 0 if unpacker.unconsumed_tail else len(block)
        total += len(unpacker.decompress(block, _BLOCK))
        while unpacker.unconsumed_tail and not unpacker.eof:
            total += len(unpacker.decompress(unpacker.unconsumed_tail, _BLOCK))
            check_bytes(path, before + total)
    return total


class _Variables:
    """Variables of a file, with what is in them."""

    def __init__(self, file: ArrayFile) -> None:
        self.file, self.count = file, 0

    def add(self, value: Any, name: str, above: tuple[str, ...]) -> None:
        """Add a variable, a field or an element."""
        from scipy.io.matlab import MatlabFunction, MatlabObject, MatlabOpaque

        self.count += 1
        if self.count > _MOST or len(above) > _DEEPEST:
            raise InputError(f"{self.file.path} has more than {_MOST} variables, or structs nested too deeply")
        if isinstance(value, MatlabFunction):
            self.file.left_out[name] = "is a function handle"
        elif isinstance(value, MatlabObject | MatlabOpaque):
            self.file.left_out[name] = "is an object; save its numbers, such as those of a timeseries, in a struct"
        elif not isinstance(value, np.ndarray):
            self.file.left_out[name] = "is sparse, or no array"
        elif value.dtype.names is not None:
            self._struct(value, name, above)
        elif value.dtype == object:
            for k, element in enumerate(value.reshape(-1, order="F")):
                self.add(element, f"{name}[{k}]", above)
        elif value.dtype.kind != "U":
            self.file.add(NamedArray(name, above, value.shape, _Held(value)), value.dtype)

    def _struct(self, value: NDArray[Any], name: str, above: tuple[str, ...]) -> None:
        for k, element in enumerate(value.reshape(-1, order="F")):
            own = name if value.size == 1 else f"{name}[{k}]"
            for field in value.dtype.names or ():
                self.add(element[field], f"{own}.{field}", (*above, own.rpartition(".")[2]))


class _Held:
    """An array that is loaded already."""

    def __init__(self, values: NDArray[Any]) -> None:
        self.values = values

    def __call__(self) -> NDArray[Any]:
        return self.values
