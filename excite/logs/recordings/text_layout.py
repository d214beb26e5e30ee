"""Layout of a table in a text, found from its lines: separator, header, units, first row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

from excite.logs.layout import MOST_COLUMNS, cells, is_number, twice

_SEARCHED = 160  # lines
_ROWS = 20  # of numbers, by which a separator is judged
SEPARATORS: tuple[str | None, ...] = (",", ";", "\t", None)


@dataclass(frozen=True)
class TextLayout:
    """Where a table is in a text."""

    separator: str | None  # between two cells; None for any white space
    first: int  # lines before the first row of numbers
    names: tuple[str, ...]  # of the columns; numbers, 1 for the first, where there is no header that names each once
    # what stands above the columns, for whoever guesses what they are; empty strings where nothing does
    titles: tuple[str, ...]
    units: tuple[str, ...]  # what a row of units above the columns says; empty strings where there is none
    header: int | None  # line of the header, 0 for the first; None where columns have numbers

    @property
    def titles_or_names(self) -> tuple[str, ...]:
        """What columns are called in messages."""
        return tuple(title or name for title, name in zip(self.titles, self.names, strict=True))


def text_layout(lines: Sequence[str]) -> TextLayout | None:
    """Layout of the table in a text; None where there is none."""
    head = list(islice(lines, _SEARCHED))
    tables = [table for mark in SEPARATORS if (table := _table(head, mark)) is not None]
    if not tables:
        return None
    mark, first, count = max(tables, key=lambda table: table[2])
    return _with_names(head, mark, first, count)


def _table(head: Sequence[str], mark: str | None) -> tuple[str | None, int, int] | None:
    """Separator, first row and number of columns of the rows of numbers that a separator makes."""
    rows = [cells(line, mark) for line in head]
    for first, row in enumerate(rows):
        some = rows[first : first + _ROWS]
        alike = sum(_is_row(other) and len(other) == len(row) for other in some)
        if _is_row(row) and alike >= 0.8 * len(some) and len(some) >= 2:
            return (mark, first, len(row)) if len(row) <= MOST_COLUMNS else None
    return None


def _is_row(row: Sequence[str]) -> bool:
    filled = [cell for cell in row if cell]
    return bool(filled) and all(map(is_number, filled))


def _with_names(head: Sequence[str], mark: str | None, first: int, count: int) -> TextLayout:
    blank = ("",) * count
    titles, units, at = blank, blank, None
    above = [_title_cells(line, mark, count) for line in head[max(0, first - 2) : first]]
    if above and (last := above[-1]) is not None:
        titles, at = last, first - 1
        if len(above) == 2 and above[0] is not None and all(map(_is_unit, last)):
            titles, units, at = above[0], last, None
    numbers = tuple(f"{k}" for k in range(1, count + 1))
    named = at is not None and len(cells(head[at], mark)) == count and all(titles) and twice(titles) is None
    if not named or at is None:
        return TextLayout(mark, first, numbers, titles, units, None)
    return TextLayout(mark, first, tuple(cells(head[at], mark)), titles, units, at)


def _title_cells(line: str, mark: str | None, count: int) -> tuple[str, ...] | None:
    """Cells of a line that may name the columns, with or without a sign of a comment before them."""
    for text in (line, line.lstrip("#% \t")):
        row = cells(text, mark)
        if len(row) == count and sum(map(is_number, filter(None, row))) < 0.5 * count and any(row):
            return tuple(cell.removeprefix("#").strip() for cell in row)
    return None


def _is_unit(cell: str) -> bool:
    """Whether a cell of a second line of header may be a unit: short, of letters and the signs of units."""
    text = cell.strip("[]() ")
    return len(text) <= 8 and not any(mark.isdigit() and mark not in "2" for mark in text) and "_" not in text
