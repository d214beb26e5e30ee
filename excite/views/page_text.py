"""The HTML of a page, from its sections: every text escaped, nothing from elsewhere."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape

from excite.storage.manifest import Entry, check_files, read_manifest
from excite.views.figures import svg_text
from excite.views.view import Column, Drawing, Format, View, ViewTable, raised, text_of, view_of
from regressors.errors import ExciteError, InputError, percent, printable
from regressors.samples import Array

_PAGE = Path(__file__).parent / "page"
_CODE = re.compile(r"`([^`]+)`")
_UNSAFE = str.maketrans({"<": "\\u003c", ">": "\\u003e", "&": "\\u0026", "\u2028": "\\u2028", "\u2029": "\\u2029"})
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


# text, the number behind it with all digits, by which rows are sorted, and state
PageCell = tuple[str, str, str]


def page_text(sections: Sequence[PageSection]) -> str:
    """One HTML page, whose content policy allows its own scripts and styles alone, by their hashes."""
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
    environment.filters |= {"code": _with_code, "cells": _cells, "facts": _facts}
    return environment.get_template(name)


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
    numeric = [any(exact for _, exact, _ in cells) for cells in zip(*rows, strict=True)]
    return [(table.columns[k].heading, each) for k, each in zip(shown, numeric, strict=True)], rows


def _cell(column: Column, value: Any, state: str) -> PageCell:
    if column.format is Format.UNIT:
        return raised(str(value)), "", state or "unit"
    if column.format is Format.TEXT or isinstance(value, str):
        return str(value), "", state
    if column.format is Format.KEPT:
        return "yes" if value else "NO", repr(float(value)), state or ("" if value else "bad")
    if value is None or not math.isfinite(value):
        return column.missing or "\N{EN DASH}", "", state
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
            made.append(PageFigure(each.title, svg_text(each.draw(), f"{prefix}-{k}", each.title)))
        except ExciteError as error:
            left_out.append(f"figure {each.title!r} is not drawn: {error}")
    return tuple(made), tuple(left_out)


def pictures(folder: Path, kind: str, titles: Mapping[str, str]) -> tuple[tuple[PageFigure, ...], tuple[str, ...]]:
    """Figures that a result was written with, as PNG or else SVG, of its run; what a page says where there are none."""
    entry = read_manifest(folder).get(kind)
    if entry is None:
        return (), ()
    shown = {name: file for name in titles if (file := _picture(folder, entry, name)) is not None}
    check_files(folder, kind, [*(name for name in entry.files if name.endswith(".json")), *shown.values()])
    figures = tuple(PageFigure(titles[name], picture=_address(folder / file)) for name, file in shown.items())
    none = f"figures of the logs are left out: {folder} has none as PNG or SVG; `figures='png'` writes them"
    return figures, () if figures else (none,)


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


CARD = "#1c2127"  # behind figures on a dark page, as in style.css
_COLOUR = re.compile(r'\b(fill|stroke|stop-color)="(#[0-9a-fA-F]{6})"')
_DARKEST, _LIGHTEST = 0.245, 0.945  # lightness of what is white and of what is black on paper
_GREY, _TINT = 0.035, 0.85  # chroma below which, and lightness above which, a colour has no meaning of its own
_READABLE, _LEAST = 0.62, 0.55  # lightness of colours that stay, and of the darkest ones
_BEND = 0.7
_TO_CONES = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
_TO_LAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)


def dark_rules(figures: Iterable[str]) -> str:
    """Style rules for every colour of some figures, empty where there are none."""
    found = sorted({(name, colour) for figure in figures for name, colour in _COLOUR.findall(figure)})
    rules = "\n".join(
        f'  :root:not(.printed) .paper [{name}="{value}"] {{ {name}: {dark(value)}; }}' for name, value in found
    )
    return f"\n@media screen and (prefers-color-scheme: dark) {{\n{rules}\n}}\n" if found else ""


def dark(colour: str) -> str:
    """The colour on a dark page."""
    lightness, *hue = _TO_LAB @ np.cbrt(_TO_CONES @ _linear(colour))
    chroma = np.hypot(*hue)
    if colour.lower() == "#ffffff":
        return CARD
    if chroma < _GREY or lightness > _TINT:
        new = _DARKEST + (_LIGHTEST - _DARKEST) * max(0.0, 1.0 - lightness) ** _BEND
    else:
        new = max(lightness, _LEAST + (_READABLE - _LEAST) * lightness / _READABLE)
    return _in_gamut(new, np.array(hue))


def _linear(colour: str) -> Array:
    """Red, green and blue in proportion to light."""
    rgb = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def _in_gamut(lightness: float, hue: Array) -> str:
    """The colour of a lightness with as much of its chroma as a screen shows."""
    for part in np.linspace(1.0, 0.0, 41):
        cones = np.linalg.solve(_TO_LAB, np.array([lightness, *(part * hue)])) ** 3
        light = np.linalg.solve(_TO_CONES, cones)
        if light.min() >= -1e-4 and light.max() <= 1 + 1e-4:
            break
    light = light.clip(0.0, 1.0)
    rgb = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return "#" + "".join(f"{round(255 * float(x)):02x}" for x in rgb)
