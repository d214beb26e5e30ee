"""The section of a page that shows a view."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from excite.report.provenance_facts import facts
from excite.report.sections import ReportCell, ReportFigure, ReportSection, ReportTable, kept, number, percent, unit
from excite.views.view import Column, Format, View, ViewTable

_CELLS: dict[Format, Callable[[Any], ReportCell]] = {
    Format.TEXT: lambda value: ReportCell(str(value)),
    Format.UNIT: unit,
    Format.NUMBER: number,
    Format.PERCENT: percent,
    Format.KEPT: kept,
}


def section_of(
    view: View, kind: str, figures: tuple[ReportFigure, ...], missing: tuple[str, ...] = ()
) -> ReportSection:
    """The section of a view."""
    return ReportSection(
        kind=kind,
        title=view.title,
        verdict=view.verdict,
        holds=view.holds,
        asked=view.asked,
        assumed=view.remarks,
        notes=(*view.against, *missing),
        tables=tuple(map(_page_table, view.tables)),
        figures=figures,
        facts=facts({}, **view.facts),
    )


def _page_table(table: ViewTable) -> ReportTable:
    """The table with all of its columns that say something."""
    shown = [k for k in range(len(table.columns)) if any(row[k] is not None for row in table.rows)]
    columns = tuple(table.columns[k] for k in shown)
    rows = tuple(
        tuple(_cell(column, row[k], marked=(j, k) in table.marked) for k, column in zip(shown, columns, strict=True))
        for j, row in enumerate(table.rows)
    )
    headings = tuple(column.heading for column in columns)
    return ReportTable(table.title, headings, rows, table.note, table.name, folded=table.folded)


def _cell(column: Column, value: Any, *, marked: bool) -> ReportCell:
    cell = _CELLS[column.format](value)
    cell = replace(cell, state="bad") if marked else cell
    numbers = column.format in (Format.NUMBER, Format.PERCENT)
    return ReportCell(column.missing) if numbers and cell.value is None and column.missing else cell
