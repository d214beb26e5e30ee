"""MAT-files of MATLAB 7.3, which are HDF5: structs are groups, cells and arrays of structs hold references.

MATLAB writes arrays in the order of columns, so that they appear transposed; the attribute ``MATLAB_class`` names the
class.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from excite.logs.recordings.array_streams import ArrayFile, NamedArray, foreign_reader
from excite.logs.recordings.hdf5_file import DEEPEST, MOST_OBJECTS, hdf5_opened, unread_dataset
from excite.logs.recordings.recording import Contents, Recording
from excite.logs.recordings.recording_format import RecordingFormat
from regressors.errors import InputError
from regressors.quoting import cut

_NUMBERS = {
    "double", "single", "logical", *(f"{sign}int{size}" for sign in ("", "u") for size in (8, 16, 32, 64)),
}  # fmt: skip
_OWN = ("#refs#", "#subsystem#")  # where MATLAB keeps what is referred to


class MatlabHdf5(RecordingFormat):
    """A MAT-file of MATLAB 7.3."""

    name: ClassVar[str] = "MAT-file of MATLAB 7.3"

    def recognises(self, head: bytes, path: Path) -> bool:
        """See `RecordingFormat.recognises`."""
        return head.startswith(b"MATLAB 7.3 MAT-file")

    def contents(self, path: Path) -> Contents:
        """See `RecordingFormat.contents`."""
        with foreign_reader(path, self.name), hdf5_opened(path, "matlab") as base:
            return self._arrays(path, base).contents()

    def read(self, path: Path, wanted: Mapping[str, Sequence[str]]) -> Recording:
        """See `RecordingFormat.read`."""
        with foreign_reader(path, self.name), hdf5_opened(path, "matlab") as base:
            return self._arrays(path, base).read(wanted)

    def _arrays(self, path: Path, base: Any) -> ArrayFile:
        file = ArrayFile(path, self.name)
        variables = _Variables(file, base)
        for name in base:
            if name not in _OWN:
                variables.add(base[name], name, ())
        return file


class _Variables:
    """Variables of a file, with what is in them."""

    def __init__(self, file: ArrayFile, base: Any) -> None:
        self.file, self.base, self.count = file, base, 0

    def add(self, one: Any, name: str, above: tuple[str, ...]) -> None:
        """Add a variable, a field or an element."""
        import h5py

        self.count += 1
        if self.count > MOST_OBJECTS or len(above) > DEEPEST:
            raise InputError(f"{self.file.path} has more than {MOST_OBJECTS} variables, or structs nested too deeply")
        kind = _text(one.attrs.get("MATLAB_class", b""))
        if "MATLAB_empty" in one.attrs or kind in ("char", "string"):
            return
        if "MATLAB_sparse" in one.attrs:
            self.file.left_out[name] = "is sparse"
        elif isinstance(one, h5py.Group) and kind == "struct":
            for key in one:
                self.add(one[key], f"{name}.{key}", (*above, name.rpartition(".")[2]))
        elif isinstance(one, h5py.Dataset) and h5py.check_ref_dtype(one.dtype) is not None:
            self._referred(one, name, above, kind)
        elif isinstance(one, h5py.Dataset) and kind in _NUMBERS and "MATLAB_object_decode" not in one.attrs:
            self._numbers(one, name, above)
        else:
            handle = kind == "function_handle"
            what = "a function handle" if handle else f"an object of class {cut(kind) or 'unknown'}"
            self.file.left_out[name] = f"is {what}; save its numbers, such as those of a timeseries, in a struct"

    def _referred(self, one: Any, name: str, above: tuple[str, ...], kind: str) -> None:
        """Elements of a cell, or of the fields of an array of structs."""
        if one.size > MOST_OBJECTS:
            raise InputError(f"{self.file.path} has more than {MOST_OBJECTS} variables")
        parent, _, last = name.rpartition(".")
        for k, reference in enumerate(one[()].reshape(-1)):
            if not reference:
                continue
            if kind == "cell" or not parent:
                self.add(self.base[reference], f"{name}[{k}]", above)
            else:  # a field of an array of structs: the index belongs to the struct
                self.add(self.base[reference], f"{parent}[{k}].{last}", (*above[:-1], f"{above[-1]}[{k}]"))

    def _numbers(self, one: Any, name: str, above: tuple[str, ...]) -> None:
        if why := unread_dataset(one):
            self.file.left_out[name] = why
        else:
            self.file.add(NamedArray(name, above, (one.shape or ())[::-1], _Transposed(one)), one.dtype)


class _Transposed:
    """Loads a dataset as MATLAB shows it, while its file is open."""

    def __init__(self, data: Any) -> None:
        self.data = data

    def __call__(self) -> NDArray[Any]:
        return np.asarray(self.data[()]).T


def _text(value: object) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
