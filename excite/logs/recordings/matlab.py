"""MAT-files of MATLAB 5 to 7.2, read by SciPy, and of MATLAB 7.3, which are HDF5, read by h5py.

What MATLAB would have to run, such as function handles, is left out. SciPy's reader may end its process on a damaged
file, and believes the sizes that it declares: it runs in a process of its own with a cap on memory, behind a check of
what the file unpacks to. The arrays come back as a temporary NPZ without a name. In files of 7.3 structs are groups,
cells and arrays of structs hold references, arrays appear transposed, since MATLAB writes them in the order of columns,
and the attribute ``MATLAB_class`` names the class.
"""

from __future__ import annotations

import itertools
import json
import struct
import subprocess
import sys
import warnings
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any, BinaryIO

import numpy as np
import scipy

from excite.logs.recordings.array_streams import (
    DEEPEST,
    MOST_OBJECTS,
    ArrayFile,
    NamedArray,
    array_format,
    hdf5_opened,
    left_unread,
)
from excite.logs.recordings.recording import Contents, check_bytes, foreign_reader
from regressors.errors import InputError, cut, one_line
from regressors.input_files import LOG, opened
from regressors.work_prediction import memory_cap

_HEADER, _COMPRESSED = 128, 15  # bytes before the first variable; kind of an element
_BLOCK = 2**20
_LIBRARIES = 2 * 10**9  # addresses that Python, NumPy and SciPy take by themselves
_COMMAND = "from excite.logs.recordings.matlab import hand_over; hand_over()"
_TOO_MANY = f"more than {MOST_OBJECTS} variables, or structs nested too deeply"
_OBJECT = "is an object; save its numbers, such as those of a timeseries, in a struct"
_NUMBERS = {
    "double", "single", "logical", *(f"{sign}int{size}" for sign in ("", "u") for size in (8, 16, 32, 64)),
}  # fmt: skip
_OWN = ("#refs#", "#subsystem#")  # where MATLAB 7.3 keeps what is referred to


@contextmanager
def _fill(file: ArrayFile) -> Iterator[None]:
    with opened(file.path, LOG) as stream:
        _check_size(file.path, stream)
    with TemporaryFile() as answer:
        _let_scipy_read(file.path, answer)
        answer.seek(0)
        with np.load(answer, allow_pickle=False) as archive:
            found = json.loads(archive["found"].tobytes())
            if "refused" in found:
                raise InputError(f"{file.path} has {found['refused']}")
            file.left_out |= found["left_out"]
            for k, (name, above, shape, kind) in enumerate(found["arrays"]):
                array = NamedArray(name, tuple(above), tuple(shape), partial(archive.__getitem__, f"{k}"))
                file.add(array, np.dtype(kind))
            yield


def _contents(path: Path) -> Contents:
    """Contents, which such a file does not tell without being loaded, so that they are kept."""
    with foreign_reader(path, _FORM.name):
        status = path.stat()
        return _contents_of(path, status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=4)
def _contents_of(path: Path, size: int, changed: int) -> Contents:
    return _FORM.contents(path)


_FORM = array_format(
    "MAT-file",
    lambda head: head.startswith(b"MATLAB 5.0 MAT-file") or head[124:128] in (b"\x00\x01IM", b"\x01\x00MI"),
    _fill,
)
MATLAB = replace(_FORM, contents=_contents)


def _check_size(path: Path, stream: BinaryIO) -> None:
    """Refuse a file that is cut off, or whose variables unpack to more than may be held."""
    head = stream.read(_HEADER)
    if len(head) < _HEADER:
        raise InputError(f"{path} ends within its header")
    order = "<" if head[126:128] == b"IM" else ">"
    end, total, at = stream.seek(0, 2), 0, _HEADER
    while at + 8 <= end:
        stream.seek(at)
        kind, size = struct.unpack(f"{order}II", stream.read(8))
        if size > end - at - 8:
            raise InputError(f"{path} ends early: its variable at byte {at} is cut off; save it again")
        check_bytes(path, total + size)
        unpacker, packed = zlib.decompressobj(), stream.read(size) if kind == _COMPRESSED else b""
        total += 0 if packed else size
        while packed:
            total += len(unpacker.decompress(packed, _BLOCK))
            check_bytes(path, total)
            packed = unpacker.unconsumed_tail
        at += 8 + size


def _let_scipy_read(path: Path, answer: IO[bytes]) -> None:
    """Write the variables of a file as NPZ, in another process."""
    memory = str(int(memory_cap() + _LIBRARIES))
    command = [sys.executable, "-P", "-c", _COMMAND, str(path.absolute()), memory]  # -P: no module of the folder
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=answer, stderr=subprocess.PIPE, check=False)
    if done.returncode:
        said = done.stderr.decode("utf-8", "replace").strip().splitlines()[-1:]
        reason = one_line(said[0]) if said and done.returncode > 0 else "SciPy's reader crashed"
        raise ValueError(reason.removeprefix("ValueError: "))


def hand_over() -> None:
    """Write the variables of a file as NPZ to the standard output; what that process does."""
    path, memory, matlab = sys.argv[1], int(sys.argv[2]), scipy.io.matlab  # imported before the cap
    warnings.simplefilter("ignore")
    with suppress(ImportError, AttributeError, OSError, ValueError):  # not on Windows, nor macOS
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    found, count = ArrayFile(Path(path), _FORM.name), itertools.count(1)
    answer: dict[str, Any] = {"arrays": [], "left_out": found.left_out}
    try:
        for name, value in matlab.loadmat(path, appendmat=False).items():
            if not name.startswith("__"):
                _add_loaded(found, value, name, (), count)
        answer["arrays"] = [(one.name, one.group, one.shape, one.load().dtype.str) for one in found.arrays]
    except OverflowError as error:
        answer["refused"] = str(error)
    arrays = {f"{k}": one.load() for k, one in enumerate(found.arrays)}
    np.savez(
        sys.stdout.buffer, allow_pickle=False, found=np.frombuffer(json.dumps(answer).encode(), np.uint8), **arrays
    )


def _add_loaded(file: ArrayFile, one: Any, name: str, above: tuple[str, ...], count: Iterator[int]) -> None:
    """Add the arrays of numbers in a variable, a field or an element that SciPy loaded."""
    if next(count) > MOST_OBJECTS or len(above) > DEEPEST:
        raise OverflowError(_TOO_MANY)
    if one is None:  # an empty field
        return
    if isinstance(one, scipy.io.matlab.MatlabOpaque):
        named = one.dtype.names and "s0" in one.dtype.names  # SciPy keeps the name of an object of a class inside it
        file.left_out[_text(one["s0"].item()) if named else name] = _OBJECT
    elif isinstance(one, scipy.io.matlab.MatlabObject):
        file.left_out[name] = _OBJECT
    elif isinstance(one, scipy.io.matlab.MatlabFunction):
        file.left_out[name] = "is a function handle"
    elif scipy.sparse.issparse(one):
        file.left_out[name] = "is sparse"
    elif one.dtype.names is not None:
        for k, element in enumerate(one.ravel(order="F")):
            own = f"{name}[{k}]" if one.shape != (1, 1) else name
            for key in one.dtype.names:
                _add_loaded(file, element[key], f"{own}.{key}", (*above, own.rpartition(".")[2]), count)
    elif one.dtype.kind == "O":
        for k, element in enumerate(one.ravel(order="F")):
            _add_loaded(file, element, f"{name}[{k}]", above, count)
    elif one.dtype.kind == "c":
        file.left_out[name] = "holds complex numbers"
    elif one.dtype.kind != "U" and one.size:
        file.arrays.append(NamedArray(name, above, one.shape, lambda: np.asarray(one)))


@contextmanager
def _fill_from_hdf5(file: ArrayFile) -> Iterator[None]:
    with hdf5_opened(file.path, "matlab") as base:
        count = itertools.count(1)
        for name in base:
            if name not in _OWN:
                _add_stored(file, base, base[name], name, (), count)
        yield


MATLAB_7_3 = array_format(
    "MAT-file of MATLAB 7.3", lambda head: head.startswith(b"MATLAB 7.3 MAT-file"), _fill_from_hdf5
)


def _add_stored(file: ArrayFile, base: Any, one: Any, name: str, above: tuple[str, ...], count: Iterator[int]) -> None:
    """Add the arrays of numbers in a variable, a field or an element that h5py reads."""
    import h5py

    if next(count) > MOST_OBJECTS or len(above) > DEEPEST:
        raise InputError(f"{file.path} has {_TOO_MANY}")
    kind = _text(one.attrs.get("MATLAB_class", b""))
    if "MATLAB_empty" in one.attrs or kind in ("char", "string"):
        return
    if "MATLAB_sparse" in one.attrs:
        file.left_out[name] = "is sparse"
    elif isinstance(one, h5py.Group) and kind == "struct":
        for key in one:
            _add_stored(file, base, one[key], f"{name}.{key}", (*above, name.rpartition(".")[2]), count)
    elif isinstance(one, h5py.Dataset) and h5py.check_ref_dtype(one.dtype) is not None:
        for reference, own, around in _referred(file, one, name, above, kind):
            _add_stored(file, base, base[reference], own, around, count)
    elif isinstance(one, h5py.Dataset) and kind in _NUMBERS and "MATLAB_object_decode" not in one.attrs:
        if not left_unread(file, one, name):
            shape, numbers = (one.shape or ())[::-1], one.dtype if one.dtype.names is None else np.dtype("V1")
            file.add(NamedArray(name, above, shape, lambda: np.asarray(one[()]).T), numbers)
    else:
        what = "a function handle" if kind == "function_handle" else f"an object of class {cut(kind) or 'unknown'}"
        file.left_out[name] = f"is {what}; save its numbers, such as those of a timeseries, in a struct"


def _referred(
    file: ArrayFile, one: Any, name: str, above: tuple[str, ...], kind: str
) -> Iterator[tuple[Any, str, tuple[str, ...]]]:
    """References to the elements of a cell, or of the fields of an array of structs, with their names."""
    if one.size > MOST_OBJECTS:
        raise InputError(f"{file.path} has more than {MOST_OBJECTS} variables")
    parent, _, last = name.rpartition(".")
    for k, reference in enumerate(one[()].reshape(-1)):
        if reference and (kind == "cell" or not parent):
            yield reference, f"{name}[{k}]", above
        elif reference:  # a field of an array of structs: the index belongs to the struct
            yield reference, f"{parent}[{k}].{last}", (*above[:-1], f"{above[-1]}[{k}]")


def _text(value: object) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
