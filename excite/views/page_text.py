"""The HTML of a page, from its sections: every text escaped, nothing from elsewhere."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from itertools import chain, groupby, zip_longest
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape

from excite.storage.manifest import Entry, check_files, read_manifest
from excite.views.figures import svg_text
from excite.views.style import drawing_style, take_sizes
from excite.views.view import Column, Drawing, Format, View, ViewTable, raised, text_of, view_of
from regressors.errors import ExciteError, InputError, percent, printable

_PAGE = Path(__file__).parent / "page"
_CODE = re.compile(r"`([^`]+)`")
_UNSAFE = str.maketrans({"<": "\\u003c", ">": "\\u003e", "&": "\\u0026", "\u2028": "\\u2028", "\u2029": "\\u2029"})
_DIGITS = 6  # significant, of numbers that are read; the page has all of them beside
_NAMES = {"wall_seconds": "time taken [s]", "cpu_seconds": "processor time [s]", "problem": "hash of the problem"}
_LEFT_OUT = ("run",)  # of the provenance
_JUDGED = ("identification", "servos")  # kinds of what verifications are of


@dataclass(frozen=True)
class PageSection:
    """A view, with its figures as they were drawn, and what a page has beside it."""

    view: View
    figures: tuple[PageFigure, ...] = ()
    missing: tuple[str, ...] = ()  # why figures or the motion are left out
    motion: Mapping[str, Any] | None = None  # data of the 3D player
    commands: tuple[str, ...] = ()  # they repeat it
    task: str = ""  # text of the task file that the commands read; empty where they read none


# text, the number behind it with all digits, by which rows are sorted, and state
PageCell = tuple[str, str, str]


def page_text(sections: Sequence[PageSection]) -> str:
    """One HTML page, whose content policy allows its own scripts and styles alone, by their hashes."""
    moves = any(section.motion is not None for section in sections)
    scripts = [_asset("tables.js"), *([_asset("player.min.js")] if moves else [])]
    style, views = _asset("style.css"), [section.view for section in sections]
    headline = _headline(views)
    page: str = _template().render(
        groups=_groups(sections),
        views=views,
        robot=", ".join(dict.fromkeys(v.facts["robot"] for v in views if "robot" in v.facts)) or headline.title,
        headline=headline,
        first_numbers=list(chain(*zip_longest(*(view.numbers for view in views)))),
        motions=[None if each.motion is None else _data(each.motion) for each in sections],
        policy=_policy(scripts, style),
        scripts=scripts,
        style=style,
        licence=_asset("three.LICENSE") if moves else "",
        version=version("excite-trajectories"),
        date=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
    )
    return page


def _headline(views: Sequence[View]) -> View:
    """The first view that does not hold, or else the last that was judged."""
    judged = [view for view in views if view.holds is not None] or views[:1]
    return next((view for view in judged if not view.holds), judged[-1])


def _groups(sections: Sequence[PageSection]) -> list[list[tuple[int, PageSection]]]:
    """Numbered sections, a verification with what it judges."""
    groups: list[list[tuple[int, PageSection]]] = []
    for k, section in enumerate(sections):
        if section.view.kind != "verification" or not groups or groups[-1][0][1].view.kind not in _JUDGED:
            groups.append([])
        groups[-1].append((k, section))
    return groups


def _grouped(texts: Sequence[str]) -> list[tuple[str, list[str]]]:
    """Neighbours that begin with the same words before a colon, without them; others alone, with none."""
    groups: list[tuple[str, list[str]]] = []
    for subject, group in groupby(texts, lambda text: text.partition(": ")[0]):
        same = list(group)
        groups.append(("", same) if len(same) == 1 else (subject, [text.removeprefix(f"{subject}: ") for text in same]))
    return groups


def notebook_text(result: Any) -> str:
    """What a notebook shows of a result: its verdict, its summary, and its first table."""
    view = None
    with suppress(ExciteError):  # such as of a design whose own parts are not given
        view = view_of(result)
    return str(_template("notebook.html").render(view=view, short=repr(result)))


def _template(name: str = "page.html") -> Any:
    environment = Environment(
        loader=FileSystemLoader(_PAGE), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.finalize = _literal
    environment.filters |= {"code": _with_code, "cells": _cells, "facts": _facts, "grouped": _grouped}
    return environment.get_template(name)


def _literal(value: Any) -> Any:
    """Text whose lines hold no control characters; what is markup or a number as it is."""
    return "\n".join(map(printable, value.split("\n"))) if type(value) is str else value


_MISSING = "missing"  # of a number


def _cells(table: ViewTable) -> tuple[list[tuple[str, bool]], list[list[PageCell]]]:
    """Headings, with whether their columns hold numbers, and rows: all columns that say something."""
    shown = [k for k in range(len(table.columns)) if any(row[k] is not None for row in table.rows)]
    rows = [
        [_cell(table.columns[k], row[k], table.marked.get((j, k), "")) for k in shown]
        for j, row in enumerate(table.rows)
    ]
    numeric = [any(exact or state == _MISSING for _, exact, state in cells) for cells in zip(*rows, strict=True)]
    return [(table.columns[k].heading, each) for k, each in zip(shown, numeric, strict=True)], rows


def _cell(column: Column, value: Any, state: str) -> PageCell:
    if column.format is Format.UNIT:
        return raised(str(value)), "", state or "unit"
    if column.format is Format.TEXT or isinstance(value, str):
        return str(value), "", state
    if column.format is Format.KEPT:
        return "yes" if value else "NO", repr(float(value)), state or ("" if value else "bad")
    if value is None or not math.isfinite(value):
        return column.missing or "\N{EN DASH}", "", state or _MISSING
    number = f"{value:.{_DIGITS}g}".replace("-", "\N{MINUS SIGN}")
    return percent(value, 3) if column.format is Format.PERCENT else number, repr(float(value)), state


def _facts(known: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Provenance of a result."""
    shown = {name: value for name, value in known.items() if name not in _LEFT_OUT and value not in (None, [], ())}
    return [(_NAMES.get(name, name.replace("_", " ")), text_of(value)) for name, value in shown.items()]


def _asset(name: str) -> str:
    return (_PAGE / name).read_text(encoding="utf-8")


def _policy(scripts: Sequence[str], style: str) -> str:
    """Content policy that allows these scripts, this style, and pictures in the page."""
    allowed = " ".join(_hash(script) for script in scripts)
    return (
        f"default-src 'none'; script-src {allowed}; style-src {_hash(style)}; img-src data:; base-uri 'none'; "
        "form-action 'none'"
    )


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode('ascii')}'"


def _data(motion: Any) -> str:
    """JSON that cannot end the element that it stands in."""
    return json.dumps(motion, allow_nan=False, separators=(",", ":")).translate(_UNSAFE)


def _with_code(text: str) -> Any:
    """Options in backticks as code, everything escaped."""
    parts = _CODE.split(printable(text))
    code = Markup("<code>{}</code>")
    return Markup("").join(code.format(part) if k % 2 else escape(part) for k, part in enumerate(parts))


_LARGEST = 4_000_000  # bytes of a picture that a page takes in


@dataclass(frozen=True)
class PageFigure:
    """A figure of a page."""

    title: str
    svg: str = ""  # an ``<svg>`` element; empty where the figure is a picture
    picture: str = ""  # a ``data:`` address of a PNG file


def drawn(figures: Sequence[Drawing], prefix: str) -> tuple[tuple[PageFigure, ...], tuple[str, ...]]:
    """Draw figures as SVG; sentences on those that cannot be drawn."""
    made, left_out = [], []
    for k, each in enumerate(figures):
        try:
            with drawing_style("single"):
                take_sizes(figure := each.draw())
                made.append(PageFigure(each.title, svg_text(figure, f"{prefix}-{k}", each.title)))
        except ExciteError as error:
            left_out.append(f"figure {each.title!r} is not drawn: {error}")
    return tuple(made), tuple(left_out)


def pictures(folder: Path, kind: str, titles: Mapping[str, str]) -> tuple[PageFigure, ...]:
    """Figures that a result was written with and that are not drawn from it, as PNG or else SVG, of its run."""
    entry = read_manifest(folder).get(kind)
    if entry is None:
        return ()
    shown = {name: file for name in titles if (file := _picture(folder, entry, name)) is not None}
    check_files(folder, kind, [*(name for name in entry.files if name.endswith(".json")), *shown.values()])
    return tuple(PageFigure(titles[name], picture=_address(folder / file)) for name, file in shown.items())


def _picture(folder: Path, entry: Entry, name: str) -> str | None:
    """The file of a figure in a form that browsers show; none where there is only a PDF, or nothing."""
    forms = (name, f"{Path(name).stem}.svg")
    return next((file for file in forms if file in entry.files and (folder / file).is_file()), None)


def _address(path: Path) -> str:
    kind = "svg+xml" if path.suffix == ".svg" else "png"
    try:
        if path.stat().st_size > _LARGEST:
            raise InputError(f"{path} is larger than {_LARGEST} bytes, more than a page takes in")
        return f"data:image/{kind};base64,{base64.b64encode(path.read_bytes()).decode('ascii')}"
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
