"""Views of results as text: summaries, tables, notes."""

from __future__ import annotations

import math
import platform
import time
from collections.abc import Callable, Sequence
from importlib.metadata import version
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from excite.cli.literal_console import console
from excite.cli.messages import in_options
from excite.cli.streams import verbosity
from excite.cli.summary import Summary, compact_table, show
from excite.views.view import Column, Format, View, ViewTable

if TYPE_CHECKING:
    import rich.table


_NUMBERS = (Format.NUMBER, Format.PERCENT)
_STYLES = {"bad": "red", "best": "bold green"}
_WHOLE = 6  # significant digits of numbers
_WIDEST = 70  # letters of a column


def view_summary(
    view: View, files: Sequence[Path] = (), next_steps: Sequence[str] = (), all_in: str | None = None
) -> Summary:
    """The short summary of a view: its verdict, its sentences, the tables that have brief columns, its remarks."""
    brief = [line for table in view.tables if any(c.brief for c in table.columns) for line in brief_table(table)]
    return Summary(
        verdict=view.verdict,
        holds=view.holds,
        caution=view.caution,
        facts=[*view.summary, *brief],
        notes=view.remarks,
        files=files,
        next_steps=next_steps,
        all_in=all_in,
    )


def brief_table(table: ViewTable, most: int = 0) -> list[str | rich.table.Table]:
    """The brief columns of a table, for a summary; numbers stand with their unit."""
    short = table.brief
    headings = [column.heading for column in short.columns if column.format is not Format.UNIT]
    left = len(list(takewhile(lambda column: column.format is Format.TEXT, short.columns)))
    rows = [_with_units(short.columns, row) for row in short.rows]
    return compact_table(*headings, rows=rows, left=left, most=most or table.most)


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
    if column.format not in _NUMBERS or isinstance(value, str):
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


def print_view(view: View, files: Sequence[Path] = (), next_steps: Sequence[str] = ()) -> None:
    """Print all of a view but its verdict, which stands above, and its figures; then what was written."""
    from rich.table import Table
    from rich.text import Text

    out = console()
    for sentence in (*view.summary, *(f"note: {remark}" for remark in view.remarks)):
        out.print(in_options(sentence), soft_wrap=True)
    for table in (each for each in view.tables if not each.folded and each.rows):
        out.print(Text(table.title, style="italic"), soft_wrap=True)
        drawn = Table(caption=table.note or None)
        # a column that knows nothing, as of starts whose beginning is not stored, is left out
        shown = [
            (k, column)
            for k, column in enumerate(table.columns)
            if not column.wide and any(row[k] is not None for row in table.rows)
        ]
        for _, column in shown:
            right = column.format in _NUMBERS
            drawn.add_column(
                column.heading, justify="right" if right else "left", overflow="fold", max_width=_WIDEST
            )  # fmt: skip
        for j, row in enumerate(table.rows):
            texts = ((_text(column, row[k], _WHOLE), table.marked.get((j, k), "")) for k, column in shown)
            drawn.add_row(*(Text(text + " *" * (m == "best"), _STYLES.get(m, "")) for text, m in texts))
        out.print(drawn)
    if files:
        out.print(f"written to {files[-1].parent}: {', '.join(path.name for path in files)}", soft_wrap=True)
    for step in next_steps:
        out.print(f"next: {in_options(step)}", soft_wrap=True)


def show_view(
    view: View,
    files: Sequence[Path] = (),
    *,
    content: Callable[[], Any],
    facts: Sequence[str | rich.table.Table] | None = None,
    notes: Sequence[str] | None = None,
    next_steps: Sequence[str] = (),
    all_in: str | None = None,
    more: Sequence[str] = (),  # lines below all tables
) -> None:
    """Show a result in the form that was asked for: its summary, all of its view, or its content as JSON."""

    def details() -> None:
        print_view(view)
        for line in (*more, *([f"written: {', '.join(map(str, files))}"] if files else [])):
            console().print(line, soft_wrap=True)

    show(
        Summary(
            verdict=view.verdict,
            holds=view.holds,
            facts=[*view.summary, *brief_table(view.tables[0])] if facts is None else facts,
            notes=view.remarks if notes is None else notes,
            files=files,
            next_steps=next_steps,
            all_in=all_in,
        ),
        content,
        details,
    )


_LIBRARIES = ("numpy", "scipy", "casadi")


def print_run_facts(out: Console) -> None:
    """Print how long this process has run, and in which versions."""
    named = ", ".join(f"{name} {version(name)}" for name in _LIBRARIES)
    own = f"excite {version('excite-trajectories')}, Python {platform.python_version()}, {named}"
    elapsed = time.monotonic() - verbosity().began
    out.print(f"{own}; {elapsed:.1f} s, {time.process_time():.1f} s CPU of this process", soft_wrap=True)
