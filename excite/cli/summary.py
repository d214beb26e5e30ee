"""The summary at the end of a command: the verdict first, then what fits a screen; or all of it, or JSON.

With ``--quiet`` only the verdict is printed, with ``--verbose`` all tables and notes.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from typing import Any

import click
from rich.table import Table
from rich.text import Text

from excite.cli.literal_console import LiteralConsole, console
from excite.cli.messages import in_options
from excite.cli.sign_of_life import something_is_shown
from excite.cli.streams import verbosity
from regressors.errors import one_line

_LINES, _COLUMNS = 24, 100
_FIGURE, _ALIKE = "figure", 4
_STYLES = {True: "bold green", False: "bold red", None: "bold"}
_CAUTION = "bold yellow"


@dataclass(frozen=True)
class Summary:
    """What a command has to say at its end."""

    verdict: str  # in words, with the number that matters most
    holds: bool | None = None  # whether what was asked for holds; None where that is no question
    # whether something that may break the robot was not checked, so that what holds is not safe to play
    caution: bool = False
    facts: Sequence[str | Table] = ()  # the few numbers that matter, with units
    notes: Sequence[str] = ()  # the first of them are shown, as many as fit
    files: Sequence[Path] = ()  # those that were written
    next_steps: Sequence[str] = ()  # what to do next
    all_in: str | None = None  # the file that has all numbers and notes


def show(summary: Summary, content: Callable[[], Any], details: Callable[[], None]) -> None:
    """Print a summary in the form that was asked for."""
    something_is_shown()
    chosen = verbosity()
    if chosen.as_json:
        click.echo(json.dumps(_with_verdict(content(), summary.verdict), indent=1))
    elif chosen.quiet:
        click.echo(one_line(in_options(summary.verdict)))
    else:
        _print_text(summary, details if chosen.verbose else None)


def _with_verdict(content: Any, verdict: str) -> Any:
    return {"verdict": verdict, **content} if isinstance(content, dict) else content


def _print_text(summary: Summary, details: Callable[[], None] | None) -> None:
    out = console()
    width = min(out.width, _COLUMNS) if sys.stdout.isatty() else _COLUMNS
    for line in _wrapped(summary.verdict, width, ""):
        style = _CAUTION if summary.caution and summary.holds is not False else _STYLES[summary.holds]
        out.print(Text(line, style=style), soft_wrap=True)
    if details is not None:
        from excite.cli.view_text import print_run_facts

        details()
        print_run_facts(out)
        return
    _print_rest(summary, out, width)


def _print_rest(summary: Summary, out: LiteralConsole, width: int) -> None:
    """Print facts, as many notes as fit, files and next steps."""
    above = [_rendered(fact, out, width) for fact in summary.facts]
    below = [_wrapped(text, width, "  ") for text in _written(summary.files)]
    below += [_next(step, width) for step in summary.next_steps]
    taken = len(_wrapped(summary.verdict, width, "")) + sum(map(len, [*above, *below]))
    notes = _notes_that_fit(summary, _LINES - taken, width)
    for lines in (*above, *notes, *below):
        for line in lines:
            out.print(line, soft_wrap=True)


def _rendered(fact: str | Table, out: LiteralConsole, width: int) -> list[str]:
    """Lines of a sentence or a table."""
    if isinstance(fact, str):
        return _wrapped(fact, width, "  ")
    options = out.options.update(width=width)
    segments = out.render_lines(fact, options, pad=False)
    return ["".join(segment.text for segment in line).rstrip() for line in segments]


def _wrapped(text: str, width: int, indent: str) -> list[str]:
    return wrap(in_options(text), width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False) or [
        ""
    ]


def _notes_that_fit(summary: Summary, lines: int, width: int) -> list[list[str]]:
    """The first notes, and how many there are beside them."""
    notes = [_wrapped(f"note: {note}", width, "  ") for note in summary.notes]
    shown: list[list[str]] = []
    for note in notes:
        last = len(shown) + 1 == len(notes)
        if shown and sum(map(len, [*shown, note])) > lines - (not last):
            break
        shown.append(note)
    if len(shown) < len(notes):
        more = len(notes) - len(shown)
        where = f"in {summary.all_in}, or with --verbose" if summary.all_in else "with --verbose"
        shown.append([f"{more} more note{'s' * (more > 1)}: {where}"])
    return shown


def _written(files: Sequence[Path]) -> list[str]:
    """One sentence on what was written; figures are counted."""
    if not files:
        return []
    named, counted = _counted(files)
    folders = {path.parent for path in files}
    if len(folders) == 1 and len(files) > 1:
        return [f"written to {files[0].parent}: {', '.join([*(path.name for path in named), *counted])}"]
    return [f"written: {', '.join([*map(str, named), *counted])}"]


def _counted(files: Sequence[Path]) -> tuple[list[Path], list[str]]:
    """Files that are named, and how many others of a kind there are: figures, and many of one ending."""
    kinds = Counter(_kind(path) for path in files)
    many = {kind for kind, count in kinds.items() if count > _ALIKE or (kind == _FIGURE and len(files) > 2)}
    counted = [f"{kinds[kind]} {kind}{'s' * (kinds[kind] > 1)}" for kind in kinds if kind in many]
    return [path for path in files if _kind(path) not in many], counted


def _kind(path: Path) -> str:
    return _FIGURE if path.suffix in (".png", ".pdf", ".svg") else f"{path.suffix.removeprefix('.')} file"


def _next(step: str, width: int) -> list[str]:
    """A next step; a command on several lines can be pasted into a shell."""
    if not step.startswith("excite "):
        return _wrapped(f"next: {step}", width, "  ")
    *lines, last = _wrapped(f"next: {step}", width - 2, "    ")
    return [*(f"{line} \\" for line in lines), last]


def compact_table(*headings: str, rows: Sequence[Sequence[str]], left: int = 1, most: int = 8) -> list[str | Table]:
    """A table without rules, and how many rows it leaves out; nothing where there are no rows."""
    if not rows:
        return []
    table = Table(box=None, pad_edge=False)
    for number, heading in enumerate(headings):
        table.add_column(heading, justify="left" if number < left else "right", overflow="fold")
    for row in rows[:most]:
        table.add_row(*row)
    more = len(rows) - most
    return [table, *([f"... and {more} more"] if more > 0 else [])]


def print_table(title: str | None, headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table of texts."""
    table = Table(title=title, title_justify="left")
    for heading in headings:
        table.add_column(heading, overflow="fold")
    for row in rows:
        table.add_row(*row)
    console().print(table)
