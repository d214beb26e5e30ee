"""MAT-files of MATLAB 5 to 7.2; what MATLAB would have to run, such as function handles, is left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import ClassVar

from excite.logs.recordings.array_streams import ArrayFile, NamedArray, foreign_reader
from excite.logs.recordings.matlab_elements import (
    CELL,
    CHAR,
    FUNCTION,
    NUMBERS,
    OBJECT,
    OPAQUE,
    SPARSE,
    STRUCT,
    Matrix,
    matrices_of,
)
from excite.logs.recordings.recording import Contents, Recording
from excite.logs.recordings.recording_format import RecordingFormat
from regressors.errors import InputError
from regressors.input_files import LOG, opened

_MOST, _DEEPEST = 10_000, 32
_OBJECT = "is an object; save its numbers, such as those of a timeseries, in a struct"
_LEFT_OUT = {FUNCTION: "is a function handle", OBJECT: _OBJECT, OPAQUE: _OBJECT, SPARSE: "is sparse"}


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
    file = ArrayFile(path, MatlabFile.name)
    variables = _Variables(file)
    with opened(path, LOG) as stream:
        for matrix in matrices_of(path, stream):
            if matrix.name:  # what has none belongs to objects
                variables.add(matrix, matrix.name, ())
    return file


class _Variables:
    """Variables of a file, with what is in them."""

    def __init__(self, file: ArrayFile) -> None:
        self.file, self.count = file, 0

    def add(self, one: Matrix, name: str, above: tuple[str, ...]) -> None:
        """Add a variable, a field or an element."""
        self.count += 1
        if self.count > _MOST or len(above) > _DEEPEST:
            raise InputError(f"{self.file.path} has more than {_MOST} variables, or structs nested too deeply")
        if one.kind == STRUCT:
            self._struct(one, name, above)
        elif one.kind == CELL:
            for k, element in enumerate(one.elements()):
                self.add(element, f"{name}[{k}]", above)
        elif one.kind in NUMBERS and one.is_complex:
            self.file.left_out[name] = "holds complex numbers"
        elif one.kind in NUMBERS and 0 not in one.shape:
            self.file.add(NamedArray(name, above, one.shape, one.numbers), one.number_kind)
        elif one.kind in _LEFT_OUT:
            self.file.left_out[name] = _LEFT_OUT[one.kind]
        elif one.kind != CHAR and one.kind not in NUMBERS:
            self.file.left_out[name] = "is of no class that is known"

    def _struct(self, one: Matrix, name: str, above: tuple[str, ...]) -> None:
        several = one.shape != (1, 1)
        for number, field, value in one.fields():
            own = f"{name}[{number}]" if several else name
            self.add(value, f"{own}.{field}", (*above, own.rpartition(".")[2]))
