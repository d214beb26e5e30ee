"""Numbers of a recorded table: read fast, and searched slowly for the line and column of a fault."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from excite.logs.layout import Layout, cells, is_number
from excite.logs.text import Text
from regressors.errors import InputError
from regressors.readers.documents import shortened
from regressors.samples import Array, Index


@dataclass(frozen=True, eq=False)
class Table:
    """Rows that were read.

    Parameters
    ----------
    values : ndarray, shape (N, columns)
        Cells of the layout's used columns, in the units of the file.
    lines : ndarray of int, shape (N,)
        Line of each row, 1 for the first of the file.
    left_out : tuple of str
        Rows that were left out, with their count.
    """

    values: Array
    lines: Index
    left_out: tuple[str, ...]


def table_of(text: Text, layout: Layout, drop: frozenset[str]) -> Table:
    """Numbers in the rows of a text.

    Parameters
    ----------
    text : Text
    layout : Layout
    drop : frozenset of str
        Faulty rows to leave out instead of refusing the file, of `excite.registry.DROPPABLE`.

    Raises
    ------
    InputError
        Rows of different length, cells that are not finite numbers, time that does not increase; with line and column.
    """
    rows = list(text.lines[layout.first :])
    left_out: list[str] = []
    if rows and (cut := _cut_off(text, layout, rows[-1])):
        if "truncated" not in drop:
            raise InputError(f"{text.source}, {cut}; the recording was cut off (`drop='truncated'` drops the line)")
        rows.pop()
        left_out.append("1 row cut off at the end")
    _check_lengths(text, layout, rows)
    if len(rows) < 2:
        raise InputError(f"{text.source} holds {'one row' if rows else 'no rows'}; a log has two or more")
    values = _values(text, layout, rows, "nan" in drop)
    lines = np.arange(len(rows), dtype=np.intp) + layout.first + 1
    keep = _finite(text, layout, values, lines, "nan" in drop)
    if dropped := int(np.sum(~keep)):
        left_out.append(f"{_counted(dropped)} with cells that are empty, NaN or infinite")
    values, lines = values[keep], lines[keep]
    keep = _later(text, layout, values[:, layout.used.index(layout.time)], lines, "repeated" in drop)
    if dropped := int(np.sum(~keep)):
        left_out.append(f"{_counted(dropped)} with time repeated")
    if np.sum(keep) < 2:
        raise InputError(f"{text.source}: fewer than two rows are left; left out: {', '.join(left_out)}")
    return Table(values[keep], lines[keep], tuple(left_out))


def _counted(rows: int) -> str:
    return f"{rows} row{'s' * (rows != 1)}"


def _length(row: str, layout: Layout) -> int:
    return row.count(layout.separator) + 1 if layout.separator else len(row.split())


def _cut_off(text: Text, layout: Layout, row: str) -> str:
    """How the last row is truncated; empty if it is complete."""
    line, length, expected = len(text.lines), _length(row, layout), len(layout.names)
    if length < expected:
        return f"line {line} ends early: {length} of {expected} columns"
    last = cells(row, layout.separator)[-1]
    if not text.complete and length == expected and expected - 1 in layout.used and not is_number(last):
        return f"line {line} ends early: its last cell is {shortened(last)}"
    return ""


def _check_lengths(text: Text, layout: Layout, rows: list[str]) -> None:
    expected = len(layout.names)
    bad = next((k for k, row in enumerate(rows) if _length(row, layout) != expected), None)
    if bad is None:
        return
    line, row = layout.first + bad + 1, rows[bad]
    what = f"has {_length(row, layout)} columns" if row.strip() else "is empty"
    raise InputError(f"{text.source}, line {line} {what}, expected {expected} columns")


def _values(text: Text, layout: Layout, rows: list[str], empty_is_nan: bool) -> Array:
    try:
        return np.loadtxt(rows, delimiter=layout.separator, comments=None, usecols=layout.used, ndmin=2)
    except ValueError:  # the fault is located cell by cell
        return np.array(
            [_row(text, layout, row, line, empty_is_nan) for line, row in enumerate(rows, layout.first + 1)]
        )


def _row(text: Text, layout: Layout, row: str, line: int, empty_is_nan: bool) -> list[float]:
    content = cells(row, layout.separator)
    values = []
    for column in layout.used:
        cell = content[column]
        if is_number(cell):
            values.append(float(cell))
        elif not cell and empty_is_nan:
            values.append(np.nan)
        else:
            place = f"{text.source}, line {line}, column {layout.names[column]}"
            if not cell:
                raise InputError(f"{place}: the cell is empty (`drop='nan'` leaves such rows out)")
            hint = "; numbers are written with a decimal point" if is_number(cell.replace(",", ".", 1)) else ""
            raise InputError(f"{place}: {shortened(cell)} is not a number{hint}")
    return values


def _finite(text: Text, layout: Layout, values: Array, lines: Index, drop: bool) -> NDArray[np.bool_]:
    finite = np.isfinite(values)
    whole = finite.all(axis=1)
    if not drop and not whole.all():
        row = int(np.argmin(whole))
        column = int(np.argmin(finite[row]))
        place = f"line {lines[row]}, column {layout.names[layout.used[column]]}"
        raise InputError(
            f"{text.source}, {place}: {values[row, column]} is not a measurement; "
            f"{_counted(int(np.sum(~whole)))} like this (`drop='nan'` leaves them out)"
        )
    return np.asarray(whole)


def _later(text: Text, layout: Layout, time: Array, lines: Index, drop: bool) -> NDArray[np.bool_]:
    """Rows whose time is later than that of the row before."""
    step = np.diff(time)
    place = f"column {layout.names[layout.time]}"
    if np.any(step < 0):
        k = int(np.argmax(step < 0))
        raise InputError(
            f"{text.source}, line {lines[k + 1]}, {place}: time runs backwards, from {time[k]:.17g} to "
            f"{time[k + 1]:.17g}; are these two recordings in one file?"
        )
    if not drop and np.any(step == 0):
        k = int(np.argmax(step == 0))
        raise InputError(
            f"{text.source}, line {lines[k + 1]}, {place}: time {time[k]:.17g} is repeated; "
            f"{_counted(int(np.sum(step == 0)))} like this (`drop='repeated'` leaves them out)"
        )
    return np.concatenate([[True], step > 0])
