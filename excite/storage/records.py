"""Records in result folders: written whole, read back, replaced."""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

from excite.registry import built_in
from excite.storage.atomic import Destination, read_json, replacing, write_json
from excite.storage.codec import Arrays, content_of, record_of
from excite.storage.commit import read_settled
from excite.storage.manifest import check_files, read_manifest
from excite.storage.migrations import is_of_kind, migrated, schema_of
from excite.storage.result_folder import figure_names, replace_result, result_folder
from regressors.errors import InputError, about
from regressors.input_files import read_bytes
from regressors.samples import Array, Index

CURVES = "_curves.npz"
Record = TypeVar("Record")


class Shown:
    """A result, whose tables are columns, and which notebooks show."""

    def table(self, name: str) -> dict[str, list[Any]]:
        """Columns of one of its tables by their headings, of which ``pandas.DataFrame(...)`` makes a frame.

        Parameters
        ----------
        name : str
            Such as ``parameters``; an unknown one lists those that there are.

        Raises
        ------
        UnknownName
            There is no such table.
        """
        return dict(self._shown("table", name))

    def _repr_html_(self) -> str:
        return str(self._shown("html"))

    def _shown(self, how: str, *given: Any) -> Any:
        return built_in("shown", how)(self, *given)


class Saved(Shown):
    """A result that has a folder of its own."""

    def save(self, folder: str | Path, *, replace: bool = False) -> list[Path]:
        """Write the result into a folder, made if it does not exist.

        Parameters
        ----------
        folder : path
        replace : bool
            Replace a result of the kind that is already there.

        Returns
        -------
        list of Path
            Files that were written.

        Raises
        ------
        InputError
            The folder holds such a result, is being written by another process, or cannot be written to.
        """
        with result_folder(Path(folder)):
            return self._written(Path(folder), replace=replace)

    def _written(self, place: Path, *, replace: bool) -> list[Path]:
        raise NotImplementedError


def write_record(
    record: object,
    kind: str,
    folder: Path,
    stem: str,
    figures: Collection[str] = (),  # stems of its figures: those of the record that is replaced leave
    further: Mapping[str, Callable[[Path], object]] = MappingProxyType({}),  # what writes each further file, by name
    entry: str = "",  # of the manifest; the stem if not given
    older: Collection[str] = (),  # files of an earlier version that leave
    objects: Mapping[str, Any] = MappingProxyType({}),  # entries of the fields that the codec leaves to the caller
) -> list[Path]:
    """Write a record into a folder, made if it does not exist; one of the same stem is replaced."""
    file = f"{stem}.json"
    content, arrays = content_of(record)
    curves = curves_file(stem)
    names = [*further, file, *([curves] if arrays else ())]
    with result_folder(folder) as run:
        drawn = figure_names(figures) if (folder / file).exists() else []
        with replace_result(folder, entry or stem, run=run, older=[*older, *drawn]) as staged:
            for name, write in further.items():
                write(staged / name)
            if arrays:
                write_curves(staged / curves, arrays)
            write_json(staged / file, {"schema": schema_of(kind), **content, **objects})
    return [folder / name for name in names]


def curves_file(stem: str) -> str:
    """Name of the file of arrays beside ``STEM.json``."""
    return "curves.npz" if stem == "result" else f"{stem}{CURVES}"


def check_replaceable(folder: Path, kind: str, stem: str) -> None:
    """Raise `InputError` where a file has the name of a record, but is the user's own."""
    path = folder / f"{stem}.json"
    if not path.exists() or stem in read_manifest(folder):
        return
    with suppress(InputError):
        if is_of_kind(kind, read_json(path).get("schema")):
            return
    raise InputError(f"{path} is already there, and is not a {kind}; choose another `folder`")


def write_beside(record: object, kind: str, folder: Path, stem: str, figures: Collection[str] = ()) -> list[Path]:
    """Write a record beside other results, where no file of the user's own has its name."""
    with result_folder(folder):
        check_replaceable(folder, kind, stem)
        return write_record(record, kind, folder, stem, figures)


def read_record(
    path: Path, record: type[Record], kind: str, objects: Callable[[Mapping[str, Any]], Mapping[str, Any]] | None = None
) -> Record:
    """Read a record, also of an older schema."""

    def read() -> Record:
        content = read_json(path)
        if not is_of_kind(kind, content.get("schema")):
            raise InputError(f"{path}: expected schema {schema_of(kind)}, given {content.get('schema')!r}")
        curves = path.with_name(curves_file(path.stem))
        entry = path.stem if path.stem in read_manifest(path.parent) else kind
        check_files(path.parent, entry, (path.name, curves.name))
        arrays: Arrays = read_curves(curves) if curves.is_file() else {}
        what = kind.replace("-", " ")
        with complete(path, what):
            content, arrays = migrated(kind, content, arrays, path.parent)
            content = content if objects is None else {**content, **objects(content)}
        with about(f"{path}: not a complete {what}"):
            return record_of(record, content, arrays)

    return read_settled(Destination(path.parent), read)


@contextmanager
def complete(path: Path, what: str) -> Iterator[None]:
    """Turn errors from using a file's entries into one error that names the file."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    except KeyError as error:
        raise InputError(f"{path}: not a complete {what}: {error} is missing") from error
    except (ArithmeticError, AttributeError, IndexError, TypeError, ValueError) as error:
        raise InputError(f"{path}: not a complete {what}: {error}") from error


def json_of(record: object) -> dict[str, Any]:
    """Content of a record for a terminal: without arrays, and of robots without their descriptions."""
    content, _ = content_of(record)
    return _short(content)


def _short(content: Mapping[str, Any]) -> dict[str, Any]:
    kept = {}
    for name, value in content.items():
        if name == "description" or (isinstance(value, dict) and value.keys() == {"array"}):
            continue
        kept[name] = _short(value) if isinstance(value, dict) else value
    return kept


NUMBERS = 400_000  # measured and predicted values in a file; of more, every k-th instant
INSTANTS = 1200  # of a motion, for the 3D player of a report
_LARGEST = 64_000_000  # bytes of all arrays of a file that is read
_FAULTS = (
    ValueError, KeyError, TypeError, OverflowError, MemoryError, OSError, EOFError, NotImplementedError, zlib.error,
    zipfile.BadZipFile,
)  # fmt: skip


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
