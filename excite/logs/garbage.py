"""Lines of a table that hold no row of numbers: text among numbers, or another number of cells."""

from __future__ import annotations

from collections.abc import Sequence

from excite.logs.layout import Layout, cells, is_number
from excite.logs.text import Text
from regressors.errors import InputError
from regressors.quoting import cut, shortened

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
