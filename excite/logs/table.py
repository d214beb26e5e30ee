"""Numbers of a recorded table: read fast, and searched slowly for the line and column of a fault."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection, Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from excite.logs.event import DROPPED, GARBAGE, ranges_of, row_ranges
from excite.logs.layout import QUOTE, ROWS, Layout, cells, is_number, number
from excite.logs.log import Removed, counted
from excite.logs.text import Lines, Text
from regressors.errors import InputError, cut, shortened
from regressors.samples import Array, Index
from regressors.work_prediction import FLOAT, check_memory

_AT_ONCE = 50_000  # rows
_COPIES, _PER_LINE = 2.0, 4.0  # numbers of each cell, and of each line


def table_of(text: Text, layout: Layout, drop: frozenset[str], only: tuple[int, int] | None = None) -> Table:
    """Numbers in the rows of a text."""
    return TextTable(text, layout, drop, only, "nan" in drop).measured()


class Table:
    """Rows of a table that were read, and what of it was left out."""

    # (N, columns) cells of the layout's used columns, in the units of the table; (N,) line of each row, 1 for the first
    # of the file, which is the header of what is not from a file
    values: Array
    lines: Index

    def __init__(self, source: str, sha256: str, layout: Layout, drop: frozenset[str]) -> None:
        self.source, self.sha256, self.layout, self.drop = source, sha256, layout, drop
        self.left_out: list[str] = []  # rows that were left out, with their count
        self.removed: list[Removed] = []  # which, by their numbers

    @property
    def clock(self) -> Array:
        """Time of each row in the unit of its column, or the rows before it."""
        layout = self.layout
        if layout.time == ROWS:
            return np.asarray(self.lines - layout.first - 1, dtype=float)
        clock = self.values[:, layout.used.index(layout.time)]
        if layout.nanoseconds is not None:
            clock = in_nanoseconds(clock, self.values[:, layout.used.index(layout.nanoseconds)])
        return np.asarray(clock)

    def measured(self) -> Self:
        """The same table, limited to rows of measurements, each later than the one before."""
        self.keep(self.finite(), "with cells that are empty, NaN or infinite")
        later = later_rows(self.clock, lambda k: self._place(self.lines[k], self.layout.time), self.drop)
        self.keep(later, "with time repeated")
        self.check_left(self.lines.size)
        return self

    def limited(self, only: tuple[int, int] | None) -> Self:
        """The same table, limited to rows between a first and a last one."""
        self.check_rows(self.lines.size, only)
        first, last = only or (1, self.lines.size)
        self.values, self.lines = self.values[first - 1 : last], self.lines[first - 1 : last]
        self.check_size(self.lines.size)
        return self

    def keep(self, rows: NDArray[np.bool_], why: str) -> None:
        """Leave the other rows out, which are as it says."""
        if not rows.all():
            self.left_out.append(f"{counted(int(np.sum(~rows)), 'row')} {why}")
            self.removed.append(Removed(DROPPED, self.lines[~rows] - self.layout.first))
            self.values, self.lines = self.values[rows], self.lines[rows]

    def check_left(self, count: int) -> None:
        """Refuse a table of one row."""
        if count < 2:
            raise InputError(f"{self.source}: fewer than two rows are left; left out: {', '.join(self.left_out)}")

    def check_rows(self, count: int, only: tuple[int, int] | None) -> None:
        """Refuse rows that a table does not have."""
        if only is not None and only[1] > count:
            raise InputError(f"{self.source}: rows: given {only[0]}:{only[1]}, but the log has {count} rows")

    def check_size(self, count: int) -> None:
        """Refuse fewer rows than a log has, and more than memory holds."""
        if count < 2:
            raise InputError(f"{self.source} holds {'one row' if count else 'no rows'}; a log has two or more")
        size = FLOAT * count * (_COPIES * len(self.layout.used) + _PER_LINE)
        check_memory(f"reading {self.source}", size, f"{count} rows", "choose fewer rows with `rows`")

    def finite(self) -> NDArray[np.bool_]:
        """Which rows hold finite numbers only; others are refused unless they are to be dropped."""
        finite = np.isfinite(self.values)
        whole = finite.all(axis=1)
        if "nan" not in self.drop and not whole.all():
            row = int(np.argmin(whole))
            column = int(np.argmin(finite[row]))
            raise InputError(
                f"{self._place(self.lines[row], self.layout.used[column])}: {self.values[row, column]} is not a "
                f"measurement; {counted(int(np.sum(~whole)), 'row')} like this (`drop='nan'` leaves them out)"
            )
        return np.asarray(whole)

    def _place(self, line: int, column: int) -> str:
        return f"{self.source}, row {line - self.layout.first}, column {cut(self.layout.names[column])}"


def in_nanoseconds(seconds: NDArray[Any], nanoseconds: NDArray[Any]) -> NDArray[Any]:
    """Time of a stamp of whole seconds and of the nanoseconds in them [ns]; whole numbers where both are."""
    return np.asarray(10**9 * seconds + nanoseconds)


def later_rows(time: Array, place: Callable[[int], str], drop: Collection[str]) -> NDArray[np.bool_]:
    """Which rows are later than the row before; earlier ones are refused, and repeated ones unless dropped."""
    step = np.diff(time)
    if np.any(step < 0):
        k = int(np.argmax(step < 0))
        raise InputError(
            f"{place(k + 1)}: time runs backwards, from {time[k]:.16g} to {time[k + 1]:.16g}; is this the right clock, "
            "and one recording? `rows` chooses the rows of one of several"
        )
    if "repeated" not in drop and np.any(step == 0):
        k = int(np.argmax(step == 0))
        raise InputError(
            f"{place(k + 1)}: time {time[k]:.16g} is repeated; {counted(int(np.sum(step == 0)), 'row')} like this "
            "(`drop='repeated'` leaves them out)"
        )
    return np.concatenate([[True], step > 0])


class TextTable(Table):
    """Rows of a text; empty cells are refused, or NaN."""

    def __init__(
        self, text: Text, layout: Layout, drop: frozenset[str], only: tuple[int, int] | None, empty_is_nan: bool = True
    ) -> None:
        super().__init__(text.source, text.sha256, layout, drop)
        self.text, self.empty_is_nan = text, empty_is_nan
        self.values, self.lines = self._read(only)

    def _place(self, line: int, column: int) -> str:
        return f"{self.source}, line {line}, column {cut(self.layout.names[column])}"

    def _read(self, only: tuple[int, int] | None) -> tuple[Array, Index]:
        """Numbers of the rows, and their lines; those that are garbage are left out."""
        text, layout = self.text, self.layout
        rows, first = text.lines[layout.first :], layout.first
        self.check_rows(len(rows), only)
        if only is not None:
            rows, first = rows[only[0] - 1 : only[1]], first + only[0] - 1
        elif rows and (how := _cut_off(text, layout, rows[-1])):
            if "truncated" not in self.drop:
                raise InputError(f"{text.source}, {how}; the recording was cut off (`drop='truncated'` drops the line)")
            rows = rows[:-1]
            self.left_out.append("1 row cut off at the end")
        self.check_size(len(rows))
        lines = np.arange(len(rows), dtype=np.intp) + first + 1
        if (values := self._values(rows, None)) is not None:
            return values, lines
        if garbage := garbage_rows(text, layout, rows, first + 1, asked="garbage" in self.drop):
            where = row_ranges(ranges_of(lines[garbage].tolist()))
            kind, plural = ("line holds", "") if len(garbage) == 1 else ("lines hold", "s")
            self.left_out.append(f"{len(garbage)} {kind} no row of numbers: line{plural} {where}")
            self.removed.append(Removed(GARBAGE, lines[garbage] - layout.first))
            keep = np.delete(np.arange(len(rows)), garbage)
            rows, lines = rows[keep], lines[keep]
            self.check_left(len(rows))
        values = self._values(rows, lines)
        assert values is not None
        return values, lines

    def _values(self, rows: Lines, lines: Index | None) -> Array | None:
        """Numbers of the rows; without their lines None where one of them has a fault, to be located cell by cell."""
        values = np.empty((len(rows), len(self.layout.used)))
        for first in range(0, len(rows), _AT_ONCE):  # the text of all rows would take several times their memory
            part = slice(first, first + _AT_ONCE)
            some = [row if self.layout.separator == "," else row.replace(",", ".") for row in rows[part]]
            if lines is None and wrong_lengths(self.layout, some):
                return None
            try:
                values[part] = _numbers(self.layout, some)
            except ValueError:
                if self.empty_is_nan and (filled := _filled_numbers(self.layout, some)) is not None:
                    values[part] = filled
                elif lines is None:
                    return None
                else:
                    values[part] = [self._row(*each) for each in zip(some, lines[part].tolist(), strict=True)]
        return values

    def _row(self, row: str, line: int) -> list[float]:
        content = cells(row, self.layout.separator)
        if not self.empty_is_nan and (empty := [k for k in self.layout.used if not content[k]]):
            here = self._place(line, empty[0])
            raise InputError(f"{here}: the cell is empty (`drop='nan'` leaves such rows out)")
        return [number(content[k]) if content[k] else np.nan for k in self.layout.used]


def _cut_off(text: Text, layout: Layout, row: str) -> str:
    """How the last row is truncated; empty if it is complete."""
    line, length, expected = len(text.lines), row_length(row, layout), len(layout.names)
    if length < expected:
        return f"line {line} ends early: {length} of {expected} columns"
    last = cells(row, layout.separator)[-1]
    if not text.complete and length == expected and expected - 1 in layout.used and not is_number(last):
        return f"line {line} ends early: its last cell is {shortened(last)}"
    return ""


def _numbers(layout: Layout, rows: list[str], before: int = 0) -> Array:
    """Numbers of the used columns, behind some others that the layout does not count."""
    used = tuple(before + column for column in layout.used)
    first, mark = cells(rows[0], layout.separator), layout.separator
    dates: dict[int | str, Callable[[str], float]] = {k: number for k in used if k < len(first) and ":" in first[k]}
    quote = QUOTE if mark and any(QUOTE in row for row in rows) else None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of NumPy, on numbers that no float can hold: these read as infinite
        return np.loadtxt(
            rows, delimiter=mark, comments=None, usecols=used, ndmin=2, converters=dates or None, quotechar=quote
        )


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


MOST = 0.01  # of the lines, that are left out without being asked


def garbage_rows(text: Text, layout: Layout, rows: Sequence[str], offset: int, *, asked: bool) -> list[int]:
    """Which rows are garbage, 0 for the first, where they are few enough to be left out."""
    faults = {k: fault for k, row in enumerate(rows) if (fault := _fault(layout, row))}
    if faults and not asked and len(faults) > MOST * len(rows):
        first, fault = next(iter(faults.items()))
        more = f"; {len(faults)} lines like this" if len(faults) > 1 else ""
        raise InputError(
            f"{text.source}, line {offset + first}{fault}{more} (`drop='garbage'` leaves such lines "
            "out, and a mapping with skip: N the first N lines of the file)"
        )
    return list(faults)


def wrong_lengths(layout: Layout, rows: Sequence[str]) -> bool:
    """Whether some row has another number of cells than the table."""
    return any(row_length(row, layout) != len(layout.names) for row in rows)


def row_length(row: str, layout: Layout) -> int:
    """Number of cells of a line."""
    mark = layout.separator
    return len(row.split()) if mark is None else len(cells(row, mark)) if QUOTE in row else row.count(mark) + 1


def _fault(layout: Layout, row: str) -> str:
    """What is wrong with a line, the end of a sentence that begins with the line; empty if nothing is."""
    if (length := row_length(row, layout)) != len(layout.names):
        what = f"has {length} columns" if row.strip() else "is empty"
        return f" {what}, expected {len(layout.names)} columns"
    content = cells(row, layout.separator)
    column = next((k for k in layout.used if content[k] and not is_number(content[k])), None)
    if column is None:
        return ""
    return f", column {cut(layout.names[column])}: {shortened(content[column])} is not a number"
