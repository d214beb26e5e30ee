"""Numbers of a recorded table: read fast, and searched slowly for the line and column of a fault."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from excite.estimates.work_prediction import FLOAT, MemoryPart, WorkPrediction
from excite.logs.event import DROPPED, GARBAGE, ranges_of, row_ranges
from excite.logs.layout import Layout, cells, is_number
from excite.logs.log import Removed
from excite.logs.text import Lines, Text
from regressors.errors import InputError
from regressors.quoting import cut, shortened
from regressors.samples import Array, Index

_AT_ONCE = 50_000  # rows
_COPIES, _PER_LINE = 2.0, 4.0  # numbers of each cell, and of each line


@dataclass(frozen=True, eq=False)
class Table:
    """Rows that were read."""

    values: Array  # (N, columns) cells of the layout's used columns, in the units of the file
    lines: Index  # (N,) line of each row, 1 for the first of the file
    left_out: tuple[str, ...]  # rows that were left out, with their count
    removed: tuple[Removed, ...] = ()  # which, by their numbers


def table_of(text: Text, layout: Layout, drop: frozenset[str], only: tuple[int, int] | None = None) -> Table:
    """Numbers in the rows of a text."""
    values, lines, left_out, removed = _cells(text, layout, drop, only, "nan" in drop)

    def leave(keep: NDArray[np.bool_], why: str) -> None:
        nonlocal values, lines
        if dropped := int(np.sum(~keep)):
            left_out.append(f"{_counted(dropped)} {why}")
            removed.append(Removed(DROPPED, lines[~keep] - layout.first))
            values, lines = values[keep], lines[keep]

    leave(_finite(text, layout, values, lines, "nan" in drop), "with cells that are empty, NaN or infinite")
    time = values[:, layout.used.index(layout.time)]
    leave(_later(text, layout, time, lines, "repeated" in drop), "with time repeated")
    if values.shape[0] < 2:
        raise InputError(f"{text.source}: fewer than two rows are left; left out: {', '.join(left_out)}")
    return Table(values, lines, tuple(left_out), tuple(removed))


def sparse_table(text: Text, layout: Layout, drop: frozenset[str], only: tuple[int, int] | None = None) -> Table:
    """Numbers in the rows of a text whose cells may be empty, which is NaN, and whose time may be anything."""
    values, lines, left_out, removed = _cells(text, layout, drop, only, True)
    return Table(values, lines, tuple(left_out), tuple(removed))


def _cells(
    text: Text, layout: Layout, drop: frozenset[str], only: tuple[int, int] | None, empty_is_nan: bool
) -> tuple[Array, Index, list[str], list[Removed]]:
    """Numbers of the rows, their lines, and what was left out."""
    rows = text.lines[layout.first :]
    first = layout.first
    left_out: list[str] = []
    removed: list[Removed] = []
    if only is not None:
        rows, first = _asked_for(text, rows, only), first + only[0] - 1
    elif rows and (how := _cut_off(text, layout, rows[-1])):
        if "truncated" not in drop:
            raise InputError(f"{text.source}, {how}; the recording was cut off (`drop='truncated'` drops the line)")
        rows = rows[:-1]
        left_out.append("1 row cut off at the end")
    if len(rows) < 2:
        raise InputError(f"{text.source} holds {'one row' if rows else 'no rows'}; a log has two or more")
    rows_in_memory(text, layout, len(rows)).check()
    lines = np.arange(len(rows), dtype=np.intp) + first + 1
    values, lines = _read(text, layout, rows, lines, drop, left_out, removed, empty_is_nan)
    return values, lines, left_out, removed


def rows_in_memory(text: Text, layout: Layout, rows: int) -> WorkPrediction:
    """Memory of the numbers of the rows; beside them only where lines begin is held."""
    columns, remedy = len(layout.used), "choose fewer rows with `rows`"
    held = FLOAT * rows * (_COPIES * columns + _PER_LINE)
    return WorkPrediction(f"reading {text.source}", (MemoryPart("rows", rows, columns, held, remedy=remedy),))


def _asked_for(text: Text, rows: Lines, only: tuple[int, int]) -> Lines:
    if only[1] > len(rows):
        raise InputError(f"{text.source}: rows: given {only[0]}:{only[1]}, but the log has {len(rows)} rows")
    return rows[only[0] - 1 : only[1]]


def _read(
    text: Text,
    layout: Layout,
    rows: Lines,
    lines: Index,
    drop: frozenset[str],
    left_out: list[str],
    removed: list[Removed],
    empty_is_nan: bool,
) -> tuple[Array, Index]:
    """Numbers and lines of the rows; those that are garbage are left out and noted."""
    if (values := _faultless(layout, rows, empty_is_nan)) is not None:
        return values, lines
    if garbage := garbage_rows(text, layout, rows, int(lines[0]), asked="garbage" in drop):
        where = row_ranges(ranges_of(lines[garbage].tolist()))
        kind = "line holds" if len(garbage) == 1 else "lines hold"
        left_out.append(f"{len(garbage)} {kind} no row of numbers: line{'s' * (len(garbage) != 1)} {where}")
        removed.append(Removed(GARBAGE, lines[garbage] - layout.first))
        keep = np.ones(len(rows), dtype=bool)
        keep[garbage] = False
        rows, lines = rows.where(keep), lines[keep]
        if len(rows) < 2:
            raise InputError(f"{text.source}: fewer than two rows are left; left out: {', '.join(left_out)}")
    return _values(text, layout, rows, lines, empty_is_nan), lines


def _counted(rows: int) -> str:
    return f"{rows} row{'s' * (rows != 1)}"


def _cut_off(text: Text, layout: Layout, row: str) -> str:
    """How the last row is truncated; empty if it is complete."""
    line, length, expected = len(text.lines), row_length(row, layout), len(layout.names)
    if length < expected:
        return f"line {line} ends early: {length} of {expected} columns"
    last = cells(row, layout.separator)[-1]
    if not text.complete and length == expected and expected - 1 in layout.used and not is_number(last):
        return f"line {line} ends early: its last cell is {shortened(last)}"
    return ""


def _faultless(layout: Layout, rows: Lines, empty_is_nan: bool) -> Array | None:
    """Numbers of the rows; None where one of them has a fault, which is then located cell by cell."""
    values = np.empty((len(rows), len(layout.used)))
    for part in _parts(rows):
        some = list(rows[part])
        if wrong_lengths(layout, some):
            return None
        try:
            values[part] = _numbers(layout, some)
        except ValueError:
            if not empty_is_nan or (filled := _filled_numbers(layout, some)) is None:
                return None
            values[part] = filled
    return values


def _parts(rows: Lines) -> Iterator[slice]:
    """Rows that are converted at once: the text of all of them would take several times the memory of the numbers."""
    return (slice(first, min(first + _AT_ONCE, len(rows))) for first in range(0, len(rows), _AT_ONCE))


def _numbers(layout: Layout, rows: list[str], before: int = 0) -> Array:
    """Numbers of the used columns, behind some others that the layout does not count."""
    used = tuple(before + column for column in layout.used)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of NumPy, on numbers that no float can hold: these read as infinite
        return np.loadtxt(rows, delimiter=layout.separator, comments=None, usecols=used, ndmin=2)


def _values(text: Text, layout: Layout, rows: Lines, lines: Index, empty_is_nan: bool) -> Array:
    values = np.empty((len(rows), len(layout.used)))
    for part in _parts(rows):
        some = list(rows[part])
        try:
            values[part] = _numbers(layout, some)
        except ValueError:  # empty cells
            numbered = zip(some, lines[part].tolist(), strict=True)
            values[part] = [_row(text, layout, row, line, empty_is_nan) for row, line in numbered]
    return values


def _filled_numbers(layout: Layout, rows: list[str]) -> Array | None:
    """Numbers of rows, NaN where a cell is empty; None where it holds white space or anything else."""
    mark = layout.separator
    if mark is None:
        return None
    body = f"{mark}\n{mark}".join(rows)
    body = f"{mark}{body}{mark}".replace(2 * mark, f"{mark}nan{mark}").replace(2 * mark, f"{mark}nan{mark}")
    try:
        return _numbers(layout, body.split("\n"), 1)
    except ValueError:
        return None


def _row(text: Text, layout: Layout, row: str, line: int, empty_is_nan: bool) -> list[float]:
    content = cells(row, layout.separator)
    if not empty_is_nan and (empty := [k for k in layout.used if not content[k]]):
        place = f"{text.source}, line {line}, column {cut(layout.names[empty[0]])}"
        raise InputError(f"{place}: the cell is empty (`drop='nan'` leaves such rows out)")
    return [float(content[k]) if content[k] else np.nan for k in layout.used]


def _finite(text: Text, layout: Layout, values: Array, lines: Index, drop: bool) -> NDArray[np.bool_]:
    finite = np.isfinite(values)
    whole = finite.all(axis=1)
    if not drop and not whole.all():
        row = int(np.argmin(whole))
        column = int(np.argmin(finite[row]))
        place = f"line {lines[row]}, column {cut(layout.names[layout.used[column]])}"
        raise InputError(
            f"{text.source}, {place}: {values[row, column]} is not a measurement; "
            f"{_counted(int(np.sum(~whole)))} like this (`drop='nan'` leaves them out)"
        )
    return np.asarray(whole)


def _later(text: Text, layout: Layout, time: Array, lines: Index, drop: bool) -> NDArray[np.bool_]:
    """Rows whose time is later than that of the row before."""
    step = np.diff(time)
    place = f"column {cut(layout.names[layout.time])}"
    if np.any(step < 0):
        k = int(np.argmax(step < 0))
        raise InputError(
            f"{text.source}, line {lines[k + 1]}, {place}: time runs backwards, from {time[k]:.17g} to "
            f"{time[k + 1]:.17g}; are these two recordings in one file? `rows` chooses the rows of one of them"
        )
    if not drop and np.any(step == 0):
        k = int(np.argmax(step == 0))
        raise InputError(
            f"{text.source}, line {lines[k + 1]}, {place}: time {time[k]:.17g} is repeated; "
            f"{_counted(int(np.sum(step == 0)))} like this (`drop='repeated'` leaves them out)"
        )
    return np.concatenate([[True], step > 0])


MOST = 0.01  # of the lines, that are left out without being asked


def garbage_rows(text: Text, layout: Layout, rows: Sequence[str], offset: int, *, asked: bool) -> list[int]:
    """Which rows are garbage, 0 for the first, where they are few enough to be left out."""
    garbage = [
        k for k, row in enumerate(rows) if row_length(row, layout) != len(layout.names) or _has_text(row, layout)
    ]
    if garbage and not asked and len(garbage) > MOST * len(rows):
        more = f"; {len(garbage)} lines like this" if len(garbage) > 1 else ""
        raise InputError(
            f"{_fault(text, layout, rows[garbage[0]], offset + garbage[0])}{more} (`drop='garbage'` leaves such lines "
            "out, and a mapping with skip: N the first N lines of the file)"
        )
    return garbage


def wrong_lengths(layout: Layout, rows: Sequence[str]) -> bool:
    """Whether some row has another number of cells than the table."""
    mark = layout.separator
    lengths = {row.count(mark) + 1 for row in rows} if mark else {len(row.split()) for row in rows}
    return not lengths <= {len(layout.names)}


def row_length(row: str, layout: Layout) -> int:
    """Number of cells of a line."""
    return row.count(layout.separator) + 1 if layout.separator else len(row.split())


def _has_text(row: str, layout: Layout) -> bool:
    content = cells(row, layout.separator)
    return any(content[k] and not is_number(content[k]) for k in layout.used)


def _fault(text: Text, layout: Layout, row: str, line: int) -> str:
    """What is wrong with a line."""
    if row_length(row, layout) != len(layout.names):
        what = f"has {row_length(row, layout)} columns" if row.strip() else "is empty"
        return f"{text.source}, line {line} {what}, expected {len(layout.names)} columns"
    content = cells(row, layout.separator)
    column = next(k for k in layout.used if content[k] and not is_number(content[k]))
    hint = "; numbers are written with a decimal point" if is_number(content[column].replace(",", ".", 1)) else ""
    place = f"{text.source}, line {line}, column {cut(layout.names[column])}"
    return f"{place}: {shortened(content[column])} is not a number{hint}"
