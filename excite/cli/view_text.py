"""Views of results as text: summaries, tables, notes."""

from __future__ import annotations

import math
import platform
import time
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from rich.console import Console

from excite.cli.literal_console import console
from excite.cli.messages import in_options
from excite.cli.streams import verbosity
from excite.cli.summary import compact_table
from excite.views.view import Column, Format, View, ViewTable

if TYPE_CHECKING:
    import rich.table


_NUMBERS = (Format.NUMBER, Format.PERCENT)
_MARKED = "red"
_WHOLE = 6  # significant digits of numbers


def brief_table(table: ViewTable, left: int = 1, most: int = 8) -> list[str | rich.table.Table]:
    """The brief columns of a table, for a summary; numbers stand with their unit."""
    short = table.brief
    units = [column.format is Format.UNIT for column in short.columns]
    headings = [column.heading for column, is_unit in zip(short.columns, units, strict=True) if not is_unit]
    return compact_table(*headings, rows=[_with_units(short.columns, row) for row in short.rows], left=left, most=most)


def _with_units(columns: tuple[Column, ...], row: tuple[Any, ...]) -> list[str]:
    """Texts of a row, with the unit that stands beside a number behind it."""
    texts: list[str] = []
    for column, value in zip(columns, row, strict=True):
        if column.format is Format.UNIT:
            texts[-1] = f"{texts[-1]} {value}"
        else:
            texts.append(_text(column, value, column.digits))
    return texts


def _text(column: Column, value: Any, digits: int) -> str:
    if column.format is Format.KEPT:
        return "yes" if value else "NO"
    if column.format not in _NUMBERS:
        return in_options(str(value))
    if value is None or not math.isfinite(value):
        return column.missing or "-"
    return f"{value:.{digits}g}" if column.format is Format.NUMBER else f"{100 * value:.3g} %"


def print_verdict(view: View) -> None:
    """Print what a view is of, and its verdict."""
    from rich.text import Text

    console().print(Text(f"\n{view.title}", style="bold"), soft_wrap=True)
    style = {True: "bold green", False: "bold red", None: "bold"}[view.holds]
    console().print(Text(in_options(view.verdict), style=style), soft_wrap=True)


def print_view(view: View) -> None:
    """Print all of a view but its verdict, which stands above, and its figures."""
    from rich.table import Table
    from rich.text import Text

    out = console()
    for sentence in (*view.summary, *(f"note: {remark}" for remark in view.remarks)):
        out.print(in_options(sentence), soft_wrap=True)
    for table in (each for each in view.tables if not each.folded):
        out.print(Text(table.title, style="italic"), soft_wrap=True)
        drawn = Table()
        shown = [(k, column) for k, column in enumerate(table.columns) if not column.wide]
        for _, column in shown:
            drawn.add_column(column.heading, justify="right" if column.format in _NUMBERS else "left")
        for j, row in enumerate(table.rows):
            texts = ((_text(column, row[k], _WHOLE), (j, k) in table.marked) for k, column in shown)
            drawn.add_row(*(Text(text, _MARKED if marked else "") for text, marked in texts))
        if table.note:
            drawn.caption = table.note
        out.print(drawn)


_LIBRARIES = ("numpy", "scipy", "casadi")


def print_run_facts(out: Console) -> None:
    """Print how long this process has run, and in which versions."""
    named = ", ".join(f"{name} {version(name)}" for name in _LIBRARIES)
    own = f"excite {version('excite-trajectories')}, Python {platform.python_version()}, {named}"
    elapsed = time.monotonic() - verbosity().began
    out.print(f"{own}; {elapsed:.1f} s, {time.process_time():.1f} s CPU of this process", soft_wrap=True)
