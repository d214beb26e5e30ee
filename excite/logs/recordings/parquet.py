"""Tables in Parquet, and data sets of LeRobot, which are folders of them.

How many values lists have is taken from the file's own description before they are read. Where that is damaged in its
statistics of sizes, pyarrow 26 ends the process instead of raising an error.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from excite.logs.recordings.recording import (
    LARGEST_ARRAY,
    Contents,
    Numbers,
    Recording,
    RecordingFormat,
    Stream,
    StreamContents,
    Wanted,
    check_table,
    check_wanted,
    foreign_reader,
    numbers_of,
    optional_package,
)
from regressors.errors import InputError, cut, listed_names
from regressors.input_files import LOG, opened, read_text
from regressors.work_prediction import FLOAT, memory_cap

_MAGIC, _ENCRYPTED = b"PAR1", b"PARE"
_INFO = "meta/info.json"
_STREAM = "table"
_EPISODE, _LEROBOT_CLOCK = "episode_index", "timestamp"
_MOST_FILES, _EPISODES_SHOWN = 10_000, 4


@dataclass(frozen=True)
class _Column:
    """A column of the file: numbers, or lists of numbers."""

    field: str  # its name in the file
    names: tuple[str, ...]  # of the columns that it becomes
    unit: str = ""  # that the file states
    is_clock: bool = False  # whether it is a time by its type
    lists: bool = False


class _Table:
    """All files of a table."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.pq = optional_package("pyarrow.parquet", "parquet", path)
        self.types = optional_package("pyarrow.types", "parquet", path)
        self.info, self.files = _info(path), _files(path)
        self.is_lerobot = "features" in self.info  # a data set of LeRobot, or a file of one
        version = f" {cut(str(self.info['codebase_version']))}" if "codebase_version" in self.info else ""
        self.form = f"Parquet of LeRobot{version}" if self.is_lerobot else "Parquet"
        self.left_out: dict[str, str] = {}
        self.rows = 0
        for file in self.files:
            with self._opened(file) as table:
                self.rows += int(table.metadata.num_rows)
                if file == self.files[0]:
                    self.columns = list(self._columns(table))

    @contextmanager
    def _opened(self, file: Path) -> Iterator[Any]:
        with foreign_reader(file, "Parquet"):
            with opened(file, LOG) as stream:
                if stream.read(4) == _ENCRYPTED or (stream.seek(-4, 2) and stream.read(4) == _ENCRYPTED):
                    raise InputError(f"{file} is encrypted; save it without encryption")
            with self.pq.ParquetFile(file, memory_map=False) as table:
                yield table

    def _columns(self, table: Any) -> Iterator[_Column]:
        for entry in table.schema_arrow:
            name, kind = entry.name, entry.type
            if self.types.is_timestamp(kind):
                yield _Column(name, (name,), kind.unit, is_clock=True)
            elif self._is(kind, "integer", "floating", "boolean"):
                yield _Column(name, (name,), _unit(entry.metadata))
            elif not self._is(kind, "list", "large_list", "fixed_size_list") or not self._is(
                kind.value_type, "integer", "floating", "boolean"
            ):
                self.left_out[name] = cut(str(kind))
            elif FLOAT * (count := _values_of(table, name)) > memory_cap():  # few bytes may stand for many equal ones
                self.left_out[name] = f"{count:.3g} values"
            elif (length := self._length(table, name)) and length <= LARGEST_ARRAY:
                yield _Column(name, self._names(name, length), _unit(entry.metadata), lists=True)
            else:
                self.left_out[name] = f"lists of {length}"

    def _is(self, kind: Any, *names: str) -> bool:
        return any(getattr(self.types, f"is_{name}")(kind) for name in names)

    def _length(self, table: Any, name: str) -> int:
        """Elements of the first list of a column."""
        for batch in table.iter_batches(batch_size=1, columns=[name], use_threads=False):
            value = batch.column(0)[0]
            return 0 if value.as_py() is None else len(value)
        return 0

    def _names(self, name: str, length: int) -> tuple[str, ...]:
        names: Any = self.info
        for key in ("features", name, "names"):
            names = names.get(key) if isinstance(names, dict) else None
        while isinstance(names, dict) and len(names) == 1:  # {"motors": [...]} of earlier versions
            names = next(iter(names.values()))
        if isinstance(names, list) and len(names) == length == len({str(one) for one in names}):
            return tuple(f"{name}.{one}" for one in names)
        return tuple(f"{name}[{k}]" for k in range(length))

    def notes(self) -> tuple[str, ...]:
        """What is left out."""
        names = [f"{cut(name)} ({why})" for name, why in list(self.left_out.items())[:5]]
        more = f" and {len(self.left_out) - 5} more" if len(self.left_out) > 5 else ""
        return (f"columns left out: {', '.join(names)}{more}",) * bool(names)

    def load(self, wanted: set[str]) -> tuple[dict[str, Numbers], tuple[str, ...]]:
        """Columns that are wanted, and notes on their rows."""
        columns = [column for column in self.columns if not wanted.isdisjoint(column.names)]
        check_table(self.path, self.rows, sum(len(column.names) for column in columns))
        parts: dict[str, list[Numbers]] = {name: [] for name in wanted}
        uneven = 0
        episodes: list[Numbers] = []
        for file in self.files:
            with self._opened(file) as table:
                if self.is_lerobot and _EPISODE in table.schema_arrow.names:
                    episodes.append(self._numbers(_values(table, _EPISODE)))
                for column in columns:
                    uneven += self._add(table, column, parts)
        values = {name: np.concatenate(pieces) for name, pieces in parts.items()}
        if any(column.size != self.rows for column in values.values()):
            raise InputError(f"{self.path} is damaged: its columns do not have the {self.rows} rows that it declares")
        notes = [f"{uneven} lists have another length than the first; their values are NaN"] * bool(uneven)
        return values, (*notes, *_episode_notes(episodes))

    def _add(self, table: Any, column: _Column, parts: dict[str, list[Numbers]]) -> int:
        """Append one column of a file; returns how many of its lists have another length."""
        values = _values(table, column.field)
        if not column.lists:
            parts[column.names[0]].append(self._numbers(values))
            return 0
        lengths = np.asarray(values.value_lengths().fill_null(0).to_numpy(zero_copy_only=False))
        flat, even = self._numbers(values.flatten()), lengths == len(column.names)
        matrix: NDArray[Any] = flat.reshape(-1, len(column.names)) if even.all() else _padded(flat, lengths, column)
        for k, name in enumerate(column.names):
            if name in parts:
                parts[name].append(np.ascontiguousarray(matrix[:, k]))
        return int(np.sum(~even))

    def _numbers(self, values: Any) -> Numbers:
        """Numbers of an Arrow array; NaN where it has none."""
        if self.types.is_timestamp(values.type):
            values = values.view("int64")
        if values.null_count:
            return np.asarray(values.cast("float64", safe=False).to_numpy(zero_copy_only=False), dtype=float)
        return numbers_of(np.asarray(values.to_numpy(zero_copy_only=False)))


def _values(table: Any, field: str) -> Any:
    return table.read(columns=[field], use_threads=False).column(0).combine_chunks()


def _padded(flat: Numbers, lengths: NDArray[Any], column: _Column) -> NDArray[Any]:
    """Lists as rows; those of another length are NaN."""
    matrix, even = np.full((lengths.size, len(column.names)), np.nan), lengths == len(column.names)
    matrix[even] = flat[np.repeat(even, lengths)].reshape(-1, len(column.names))
    return matrix


def _values_of(table: Any, name: str) -> int:
    """Values of a column, as the file declares them."""
    groups = (table.metadata.row_group(k) for k in range(table.metadata.num_row_groups))
    chunks = (group.column(k) for group in groups for k in range(group.num_columns))
    return sum(chunk.num_values for chunk in chunks if f"{chunk.path_in_schema}.".startswith(f"{name}."))


def _episode_notes(episodes: list[Numbers]) -> tuple[str, ...]:
    """Rows of the episodes, in each of which time begins anew."""
    numbers = np.concatenate(episodes) if episodes else np.zeros(0)
    first = np.flatnonzero(np.diff(numbers) != 0) + 1
    if not first.size:
        return ()
    starts, ends = [0, *first.tolist()], [*first.tolist(), numbers.size]
    some = list(zip(starts, ends, strict=True))[:_EPISODES_SHOWN]
    listed = ", ".join(f"episode {numbers[a]:g}: rows {a + 1}:{b}" for a, b in some)
    return (f"{len(starts)} episodes, in each of which time begins anew; {listed}" + "..." * (len(starts) > len(some)),)


def _files(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    files = sorted(path.glob("data/**/*.parquet"))[: _MOST_FILES + 1]
    if not files or len(files) > _MOST_FILES:
        raise InputError(f"{path}: expected 1 to {_MOST_FILES} files data/**/*.parquet of a LeRobot data set")
    return files


def _info(path: Path) -> dict[str, Any]:
    """Description of the data set that a file or folder belongs to; empty if there is none."""
    for folder in [path] if path.is_dir() else list(path.absolute().parents)[:3]:
        file = folder / _INFO
        if file.is_file():
            try:
                info = json.loads(read_text(file))
            except (OSError, ValueError, RecursionError) as error:
                raise InputError(f"{file} is not the JSON of a LeRobot data set") from error
            return info if isinstance(info, dict) else {}
    return {}


def _unit(metadata: Any) -> str:
    stated = next((metadata[key] for key in (b"unit", b"units") if key in (metadata or {})), b"")
    return str(stated.decode("utf-8", "replace"))


def _is_parquet(head: bytes, path: Path) -> bool:
    return head.startswith((_MAGIC, _ENCRYPTED)) if head else (path / _INFO).is_file() and path.is_dir()


def _contents(path: Path) -> Contents:
    table = _Table(path)
    columns = [name for column in table.columns for name in column.names]
    units = {name: column.unit for column in table.columns for name in column.names if column.unit}
    clocks = [column.names[0] for column in table.columns if column.is_clock]
    if table.is_lerobot and _LEROBOT_CLOCK in columns:
        clocks.insert(0, _LEROBOT_CLOCK)
        units[_LEROBOT_CLOCK] = "s"
    if not columns:
        raise InputError(f"{path} has no columns of numbers; it has {listed_names(table.left_out)}")
    stream = StreamContents(_STREAM, tuple(columns), table.rows, tuple(clocks), units=units)
    return Contents(str(path), table.form, (stream,), table.notes())


def _read(path: Path, wanted: Wanted) -> Recording:
    table = _Table(path)
    check_wanted(path, wanted, {_STREAM: [name for column in table.columns for name in column.names]})
    names = list(wanted.get(_STREAM, ()))
    values, notes = table.load(set(names))
    stream = Stream(_STREAM, {name: values[name] for name in names})
    return Recording(str(path), table.form, {_STREAM: stream}, (*table.notes(), *notes))


PARQUET = RecordingFormat("Parquet", _is_parquet, _contents, _read)
