"""Logs of what is in memory: frames of other libraries, mappings of names to columns, and arrays.

No library of frames is imported. A frame has the names of its columns in `columns` (pandas, Polars) or in
`column_names` (PyArrow), and gives a column by its name; NumPy makes an array of it. The columns are laid out, checked
and left out as those of a file are: a frame is a table.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, Protocol, TypeAlias

import numpy as np

from excite.logs.layout import ROWS, ForeignHeader, Layout, house_layout, listed
from excite.logs.log import Log
from excite.logs.log_reading import (
    LOOKED_AT,
    SPARSE,
    at_the_joints,
    droppable_rows,
    from_zero,
    log_of_sparse,
    log_of_table,
)
from excite.logs.mapping import LogMapping, read_mapping
from excite.logs.recorded_log import with_further_files
from excite.logs.table import Table
from regressors.errors import InputError, cut, one_line, shortened
from regressors.robot.robot import Robot
from regressors.samples import Array


class DataFrame(Protocol):
    """A table of another library, which gives a column by its name."""

    @property
    def columns(self) -> Any:
        """Names of the columns."""


_SECONDS = "; give seconds, such as (time - time[0]) / numpy.timedelta64(1, 's')"
FrameLike: TypeAlias = DataFrame | Mapping[str, Any]


def is_frame(given: object) -> bool:
    """Whether something is a table in memory."""
    return isinstance(given, Mapping) or {"columns", "__getitem__"} <= {*dir(type(given))}


def log_of_frame(
    frame: FrameLike,
    mapping: LogMapping | str | Path | None,
    joints: Sequence[str] | None,
    robot: Robot | None,
    drop: Iterable[str],
    only: tuple[int, int] | None,
    source: str,
) -> Log:
    """Log of a frame, see `excite.logs.log.Log.from_frame`."""
    allowed, columns = droppable_rows(joints, drop), NamedColumns.of(frame, source)
    if mapping is None:
        layout = columns.layout(joints, () if robot is None else robot.passive)
        return log_of_table(columns.table(layout, allowed).limited(only).measured())
    mapping = (read_mapping(mapping) if isinstance(mapping, str | Path) else mapping).of(robot)
    index = {name: k for k, name in reversed(list(enumerate(columns.names)))}
    table = columns.table(mapping.columns_layout(source, columns.names, index), allowed)
    sparse = np.mean(np.isnan(table.values[:LOOKED_AT]).any(axis=1)) > SPARSE
    log, zero = log_of_sparse(table, only) if sparse else from_zero(log_of_table(table.limited(only).measured()))
    log = at_the_joints(with_further_files(log, Path(source), mapping, allowed, zero), mapping, robot)
    return log if joints is None else log.of(joints)


@dataclass(frozen=True, eq=False)
class NamedColumns:
    """Columns in memory."""

    source: str  # for messages
    names: tuple[str, ...]
    columns: tuple[Any, ...]
    hint: str = ""  # where a column may be that is missed

    @classmethod
    def of(cls, frame: FrameLike, source: str) -> NamedColumns:
        """Columns of a frame, none of them an array yet."""
        if not is_frame(frame):
            raise InputError(f"{source}: expected a frame or a dict of columns, given {type(frame).__name__}")
        names = "column_names" if hasattr(type(frame), "column_names") else "columns"
        labels = list(frame if isinstance(frame, Mapping) else getattr(frame, names))
        hint = "; an index is no column, `reset_index()` makes one of it" * hasattr(type(frame), "reset_index")
        columns = tuple(frame[label] for label in labels)  # type: ignore[index]
        return cls(source, tuple(str(label).strip() for label in labels), columns, hint)

    def layout(self, joints: Sequence[str] | None, passive: Sequence[str] = ()) -> Layout:
        """Layout by the names that columns have in files."""
        try:
            return house_layout(self.source, list(self.names), joints, passive=passive)
        except ForeignHeader as error:
            raise InputError(
                f"{self.source}: expected the columns time and NAME.position, given {listed(self.names) or 'none'}; "
                f"rename them, or give `mapping`, which says what columns of other names are{self.hint}"
            ) from error

    def table(self, layout: Layout, drop: frozenset[str]) -> Table:
        """Numbers of the columns of a layout, with their hash."""
        columns = {k: self._numbers(k) for k in layout.used}
        first = layout.used[0] if layout.time == ROWS else layout.time
        rows, clock = columns[first].size, cut(self.names[first])
        if (other := next((k for k, column in columns.items() if column.size != rows), None)) is not None:
            where = f"{self.source}, column {cut(self.names[other])}"
            raise InputError(f"{where}: {columns[other].size} rows, but column {clock} has {rows}")
        digest = sha256("\n".join(self.names[k] for k in layout.used).encode())
        values = np.column_stack(list(columns.values()))
        digest.update(values.tobytes())
        table = Table(self.source, digest.hexdigest(), layout, drop)
        table.check_size(rows)
        table.values, table.lines = values, np.arange(rows, dtype=np.intp) + layout.first + 1
        return table

    def _numbers(self, k: int) -> Array:
        """One column, NaN where it holds nothing."""
        try:
            given = np.asarray(self.columns[k])
            if given.ndim == 1 and given.dtype.kind in "fiuO":
                return np.asarray(self.columns[k], dtype=float)
            fault = f"an array of shape {given.shape}"
            if given.ndim == 1 and given.size:
                fault = f"{given.dtype}, such as {shortened(str(given[0]))}"
            if given.dtype.kind in "mM":
                fault += _SECONDS
        except (TypeError, ValueError, OverflowError) as error:
            fault = one_line(str(error))
        raise InputError(f"{self.source}, column {cut(self.names[k])}: expected a number in each row, given {fault}")
