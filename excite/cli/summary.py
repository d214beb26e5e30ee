"""Views on the terminal: the verdict first, then what fits a screen; or all tables and notes, or JSON.

With ``--quiet`` only the verdict is printed, with ``--verbose`` all of the view, with ``--json`` its content.
"""

from __future__ import annotations

import json
import math
import platform
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from importlib.metadata import version
from itertools import chain, takewhile
from pathlib import Path
from shutil import get_terminal_size
from textwrap import wrap
from typing import Any, Literal

import click
from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from excite.cli.streams import has_colours, in_options, something_is_shown, verbosity
from excite.logs.log import counted
from excite.views.view import Column, Format, View, ViewTable
from regressors.errors import listed_names, one_line, percent

_LINES, _COLUMNS = 24, 100
_FIGURE, _ALIKE = "figure", 4
_OF_VERDICT = {True: "bold green", False: "bold red", None: "bold"}
_CAUTION = "bold yellow"
_OF_CELL = {"bad": "red", "best": "bold green"}
_NUMBERS = (Format.NUMBER, Format.PERCENT)
_WHOLE = 6  # significant digits of numbers
_WIDEST = 70  # letters of a column
_NAMED = 6  # names of a list in a cell of a short table
_LIBRARIES = ("numpy", "scipy", "casadi")


Drawn = Callable[[], Sequence[Path]]


def show(
    view: View,
    files: Sequence[Path] | Drawn = (),  # those that were written; a call draws figures first
    *,
    content: Callable[[], Any],
    next_steps: Sequence[str] = (),  # what to do next
    all_in: str | None = None,  # the file that has all numbers and notes
    details: Callable[[], None] | None = None,  # prints all, where that is more than the view
) -> None:
    """Show a view in the form that was asked for: its summary, all of it, its verdict alone, or its content as JSON."""
    something_is_shown()
    chosen = verbosity()
    left = tuple(text for text in view.remarks if f"excite: note: {in_options(text)}" not in chosen.said)
    view = replace(view, remarks=left)

    def drawn() -> Sequence[Path]:
        written = files() if callable(files) else files
        something_is_shown()  # the step of drawing has gone
        return written

    if chosen.as_json:
        known = content()
        click.echo(json.dumps({"verdict": view.verdict, **known} if isinstance(known, dict) else known, indent=1))
        drawn()
    elif chosen.quiet:
        click.echo(one_line(in_options(view.verdict)))
        drawn()
    else:
        whole = details or (lambda: print_view(view, drawn(), next_steps))
        _print_text(view, drawn, next_steps, all_in, whole if chosen.verbose else None)


def _print_text(
    view: View, drawn: Drawn, next_steps: Sequence[str], all_in: str | None, details: Callable[[], None] | None
) -> None:
    out = console()
    width = min(get_terminal_size((_COLUMNS, _LINES)).columns, _COLUMNS)
    verdict = _wrapped(view.verdict, width, "")
    for line in verdict:
        style = _CAUTION if view.caution and view.holds is not False else _OF_VERDICT[view.holds]
        out.print(Text(line, style=style), soft_wrap=True)
    if details is not None:
        details()
        named = ", ".join(f"{name} {version(name)}" for name in _LIBRARIES)
        own = f"excite {version('excite-trajectories')}, Python {platform.python_version()}, {named}"
        elapsed = time.monotonic() - verbosity().began
        out.print(f"{own}; {elapsed:.1f} s, {time.process_time():.1f} s CPU of this process", soft_wrap=True)
        return
    facts = (*view.against, *view.summary, *(line for table in view.tables for line in brief_table(table)))
    above = [_rendered(fact, out, width) for fact in facts]
    for line in chain.from_iterable(above):  # before figures are drawn
        out.print(line, soft_wrap=True)
    below = [_wrapped(text, width, "  ") for text in _written(drawn())]
    below += [_next(step, width) for step in next_steps]
    taken = len(verdict) + sum(map(len, [*above, *below]))
    notes = _notes_that_fit(view.remarks, all_in, _LINES - taken, width)
    for line in chain.from_iterable([*notes, *below]):
        out.print(line, soft_wrap=True)


def _rendered(fact: str | Table, out: LiteralConsole, width: int) -> list[str]:
    """Lines of a sentence or a table."""
    if isinstance(fact, str):
        return _wrapped(fact, width, "  ")
    options = out.options.update(width=width)
    segments = out.render_lines(fact, options, pad=False)
    return ["".join(segment.text for segment in line).rstrip() for line in segments]


def _wrapped(text: str, width: int, indent: str) -> list[str]:
    lines = wrap(in_options(text), width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    return lines or [""]


def _notes_that_fit(remarks: Sequence[str], all_in: str | None, lines: int, width: int) -> list[list[str]]:
    """The first notes, and how many there are beside them."""
    notes = [_wrapped(f"note: {note}", width, "  ") for note in remarks]
    shown: list[list[str]] = []
    for note in notes:
        last = len(shown) + 1 == len(notes)
        if shown and sum(map(len, [*shown, note])) > lines - (not last):
            break
        shown.append(note)
    if len(shown) < len(notes):
        where = f"in {all_in}, or with --verbose" if all_in else "with --verbose"
        shown.append([f"{counted(len(notes) - len(shown), 'more note')}: {where}"])
    return shown


def _written(files: Sequence[Path]) -> list[str]:
    """One sentence on what was written; figures, and many files of one ending, are counted."""
    if not files:
        return []
    kinds = Counter(map(_kind, files))
    many = {kind for kind, count in kinds.items() if count > _ALIKE or (kind == _FIGURE and len(files) > 2)}
    named = [path for path in files if _kind(path) not in many]
    together = [counted(kinds[kind], kind) for kind in kinds if kind in many]
    if len({path.parent for path in files}) == 1 and len(files) > 1:
        return [f"written to {files[0].parent}: {', '.join([*(path.name for path in named), *together])}"]
    return [f"written: {', '.join([*map(str, named), *together])}"]


def _kind(path: Path) -> str:
    return _FIGURE if path.suffix in (".png", ".pdf", ".svg") else f"{path.suffix.removeprefix('.')} file"


def _next(step: str, width: int) -> list[str]:
    """A next step; a command on several lines can be pasted into a shell."""
    if not step.startswith("excite "):
        return _wrapped(f"next: {step}", width, "  ")
    *lines, last = _wrapped(f"next: {step}", width - 2, "    ")
    return [*(f"{line} \\" for line in lines), last]


def brief_table(table: ViewTable) -> list[str | Table]:
    """The brief columns of a table, without rules, numbers with their unit, and how many rows are left out."""
    short = table.brief
    if not short.rows or not short.columns:
        return []
    left = len(list(takewhile(lambda column: column.format is Format.TEXT, short.columns)))
    drawn = Table(box=None, pad_edge=False)
    for k, column in enumerate(each for each in short.columns if each.format is not Format.UNIT):
        drawn.add_column(column.heading, justify="left" if k < left else "right", overflow="fold")
    for row in short.rows[: table.most]:
        drawn.add_row(*_with_units(short.columns, row))
    more = len(short.rows) - table.most
    return [drawn, *([f"... and {more} more"] if more > 0 else [])]


def _with_units(columns: tuple[Column, ...], row: tuple[Any, ...]) -> list[str]:
    """Texts of a row, with the unit that stands beside a number behind it, and of a list of names the first ones."""
    texts: list[str] = []
    for column, value in zip(columns, row, strict=True):
        if column.format is Format.UNIT:
            texts[-1] = f"{texts[-1]} {value}"
        else:
            known = listed_names(value.split(", "), _NAMED) if isinstance(value, str) else value
            texts.append(_text(column, known, column.digits))
    return texts


def _text(column: Column, value: Any, digits: int = _WHOLE) -> str:
    if column.format is Format.KEPT:
        return "yes" if value else "NO"
    if column.format not in _NUMBERS or isinstance(value, str):
        return in_options(str(value))
    if value is None or not math.isfinite(value):
        return column.missing or "-"
    return f"{value:.{digits}g}" if column.format is Format.NUMBER else percent(value, 3)


def print_verdict(view: View) -> None:
    """Print what a view is of, and its verdict."""
    console().print(Text(f"\n{view.title}", style="bold"), soft_wrap=True)
    console().print(Text(in_options(view.verdict), style=_OF_VERDICT[view.holds]), soft_wrap=True)


def print_view(view: View, files: Sequence[Path] = (), next_steps: Sequence[str] = ()) -> None:
    """Print all of a view but its verdict, which stands above, and its figures; then what was written."""
    out = console()
    for sentence in view.against:
        out.print(in_options(sentence), style="bold", soft_wrap=True)
    for sentence in (*view.summary, *(f"note: {remark}" for remark in view.remarks)):
        out.print(in_options(sentence), soft_wrap=True)
    for table in (each for each in view.tables if not each.folded and each.rows):
        out.print(Text(table.title, style="italic"), soft_wrap=True)
        out.print(_whole_table(table))
    for line in (*_written(files), *(f"next: {in_options(step)}" for step in next_steps)):
        out.print(line, soft_wrap=True)


def _whole_table(table: ViewTable) -> Table:
    """A table without columns that are wide, or know nothing, as of starts whose beginning is not stored."""
    drawn = Table(caption=table.note or None)
    known = [any(row[k] is not None for row in table.rows) for k in range(len(table.columns))]
    shown = [(k, column) for k, column in enumerate(table.columns) if known[k] and not column.wide]
    for _, column in shown:
        justify: Literal["left", "right"] = "right" if column.format in _NUMBERS else "left"
        drawn.add_column(column.heading, justify=justify, overflow="fold", max_width=_WIDEST)
    for j, row in enumerate(table.rows):
        texts = ((_text(column, row[k]), table.marked.get((j, k), "")) for k, column in shown)
        drawn.add_row(*(Text(text + " *" * (mark == "best"), _OF_CELL.get(mark, "")) for text, mark in texts))
    return drawn


def print_table(title: str | None, headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table of texts."""
    table = Table(title=title, title_justify="left")
    for heading in headings:
        table.add_column(heading, overflow="fold")
    for row in rows:
        table.add_row(*row)
    console().print(table)


class LiteralConsole(Console):
    """Console whose text has a replacement character for every control character but line ends."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Render as a `Console` does, literally."""
        for segment in super().render(renderable, options):
            text = "".join(c if c.isprintable() or c == "\n" else "\ufffd" for c in segment.text)
            yield segment if segment.control else Segment(text, segment.style)


def console() -> LiteralConsole:
    """Console on stdout that prints names literally, brackets included, and does not wrap tables when piped."""
    colours: dict[str, Any] = {"force_terminal": True} if has_colours(sys.stdout) else {"color_system": None}
    return LiteralConsole(markup=False, highlight=False, width=None if sys.stdout.isatty() else 120, **colours)
