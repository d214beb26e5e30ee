"""The HTML of a page, from its sections: every text escaped, nothing from elsewhere."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

from excite.views.drawings import PageFigure, dark_rules
from excite.views.view import Column, Format, View, ViewTable, text_of
from regressors.errors import printable

_PAGE = Path(__file__).parent / "page"
_CODE = re.compile(r"`([^`]+)`")
_UNSAFE = {"<": "\\u003c", ">": "\\u003e", "&": "\\u0026", "\u2028": "\\u2028", "\u2029": "\\u2029"}
_DIGITS = 6  # significant, of numbers that are read; the page has all of them beside
_NAMES = {"wall_seconds": "time taken [s]", "cpu_seconds": "processor time [s]", "problem": "hash of the problem"}
_LEFT_OUT = ("run",)  # of the provenance


@dataclass(frozen=True)
class PageSection:
    """A view, with its figures as they were drawn, and what a page has beside it."""

    view: View
    figures: tuple[PageFigure, ...] = ()
    missing: tuple[str, ...] = ()  # why figures or the motion are left out
    motion: Mapping[str, Any] | None = None  # data of the 3D player
    commands: tuple[str, ...] = ()  # they repeat it
    task: str = ""  # text of the task file that the commands read; empty where they read none


class PageCell(NamedTuple):
    """One cell of a table."""

    text: str
    exact: str = ""  # the number behind it with all digits, by which rows are sorted
    state: str = ""


def page_text(sections: Sequence[PageSection]) -> str:
    """One HTML page.

    Scripts and styles are in the page, and its content policy allows these alone, by their hashes: no others, no
    network, no frames, no forms.
    """
    moves = any(section.motion is not None for section in sections)
    scripts = [_asset("tables.js"), *([_asset("player.min.js")] if moves else [])]
    style = _asset("style.css") + dark_rules(figure.svg for section in sections for figure in section.figures)
    page: str = _template().render(
        sections=sections,
        motions=[None if each.motion is None else _data(each.motion) for each in sections],
        policy=_policy(scripts, style),
        scripts=scripts,
        style=style,
        licence=_asset("three.LICENSE") if moves else "",
        version=version("excite-trajectories"),
        date=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
    )
    return page


def _template() -> Any:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(_PAGE), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.finalize = _literal
    environment.filters |= {"code": _with_code, "cells": _cells, "facts": _facts}
    return environment.get_template("page.html")


def _literal(value: Any) -> Any:
    """Text whose lines hold no control characters; what is markup or a number as it is."""
    return "\n".join(map(printable, value.split("\n"))) if type(value) is str else value


def _cells(table: ViewTable) -> tuple[list[tuple[str, bool]], list[list[PageCell]]]:
    """Headings, with whether their columns hold numbers, and rows: all columns that say something."""
    shown = [k for k in range(len(table.columns)) if any(row[k] is not None for row in table.rows)]
    rows = [
        [_cell(table.columns[k], row[k], table.marked.get((j, k), "")) for k in shown]
        for j, row in enumerate(table.rows)
    ]
    numeric = [any(cell.exact for cell in cells) for cells in zip(*rows, strict=True)]
    return [(table.columns[k].heading, each) for k, each in zip(shown, numeric, strict=True)], rows


def _cell(column: Column, value: Any, state: str) -> PageCell:
    if column.format is Format.UNIT:
        return PageCell(raised(str(value)), state=state or "unit")
    if column.format is Format.TEXT or isinstance(value, str):
        return PageCell(str(value), state=state)
    if column.format is Format.KEPT:
        return PageCell("yes" if value else "NO", repr(float(value)), state or ("" if value else "bad"))
    if value is None or not math.isfinite(value):
        return PageCell(column.missing or "\N{EN DASH}", state=state)
    number = f"{value:.{_DIGITS}g}".replace("-", "\N{MINUS SIGN}")
    return PageCell(f"{100 * value:.3g} %" if column.format is Format.PERCENT else number, repr(float(value)), state)


def raised(text: str) -> str:
    """A unit or a sum with raised exponents, such as ``kg m²``."""
    return text.replace("^2", "²").replace("^3", "³")


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
    text = json.dumps(motion, allow_nan=False, separators=(",", ":"))
    return "".join(_UNSAFE.get(letter, letter) for letter in text) if any(map(text.__contains__, _UNSAFE)) else text


def _with_code(text: str) -> Any:
    """Options in backticks as code, everything escaped."""
    from markupsafe import Markup, escape

    parts = _CODE.split(printable(text))
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if k % 2 else escape(part) for k, part in enumerate(parts)
    )
