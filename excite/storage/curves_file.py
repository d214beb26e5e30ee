"""What figures draw of a log, beside a result: arrays in a compressed file of NumPy (``.npz``)."""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from excite.storage.atomic import replacing
from regressors.errors import InputError
from regressors.input_files import read_bytes
from regressors.samples import Array, Index

NUMBERS = 400_000  # measured and predicted values in a file; of more, every k-th instant
INSTANTS = 1200  # of a motion, for the 3D player of a report
_LARGEST = 64_000_000  # bytes of all arrays of a file that is read
_FAULTS = (
    ValueError, KeyError, TypeError, OverflowError, MemoryError, OSError, EOFError, NotImplementedError, zlib.error,
    zipfile.BadZipFile,
)  # fmt: skip

Arrays = dict[str, Any]


def every(count: int, most: int = NUMBERS) -> int:
    """The least k so that every k-th of `count` values are at most `most`."""
    return max(1, -(-count // most))


def chosen(count: int, most: int = INSTANTS) -> Index:
    """Indices of at most so many instants, evenly spread, both ends among them."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.intp))


def short(values: Array) -> Any:
    """Values with seven digits, of single precision: half the size."""
    return np.asarray(values, dtype=np.float32)


def write_curves(path: Path, arrays: Mapping[str, Any]) -> None:
    """Write arrays, whole or not at all."""
    with replacing(path, "wb") as stream:
        np.savez_compressed(stream, allow_pickle=False, **arrays)


def read_curves(path: Path) -> Arrays:
    """Arrays of a file."""
    try:
        content = io.BytesIO(read_bytes(path))
        with zipfile.ZipFile(content) as archive:
            size = sum(each.file_size for each in archive.infolist())
        if size > _LARGEST:
            raise InputError(f"{path}: expected at most {_LARGEST} bytes of arrays, given {size}")
        with np.load(content, allow_pickle=False) as arrays:
            read = {name: arrays[name] for name in arrays.files}
        if not all(isinstance(array, np.ndarray) for array in read.values()):
            raise ValueError("a member is no array")
        return read
    except _FAULTS as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: expected arrays of curves (.npz): {error}") from error
