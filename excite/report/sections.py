"""Parts of which sections of a page consist: text, tables, drawings."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from excite.tasks.option import options_of
from excite.tasks.task import PARTS

DIGITS = 6  # significant, of numbers that are read; the page has all of them beside


@dataclass(frozen=True)
class ReportCell:
    """One cell of a table."""

    text: str
    value: float | None = None  # the number behind it, by which rows are sorted
    state: str = ""

    @property
    def exact(self) -> str:
        """The number with all digits; empty where there is none."""
        return "" if self.value is None else repr(float(self.value))


@dataclass(frozen=True)
class ReportTable:
    """A table that the reader can sort by any column."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[ReportCell, ...], ...]
    note: str = ""  # stands below it
    name: str = ""  # what tests find it by
    folded: bool = False  # shown when asked for

    @property
    def numeric(self) -> tuple[bool, ...]:
        """Whether each column holds numbers."""
        return tuple(any(cell.value is not None for cell in cells) for cells in zip(*self.rows, strict=True))


@dataclass(frozen=True)
class ReportFigure:
    """A figure."""

    title: str
    svg: str = ""  # an ``<svg>`` element, made by `excite.plots.svg_text`; empty where the figure is a picture
    picture: str = ""  # A ``data:`` address of a PNG file


@dataclass(frozen=True)
class ReportSection:
    """One design, campaign, identification, verification or comparison."""

    kind: str
    title: str
    verdict: str  # one sentence, or a few
    holds: bool | None = None  # whether what was asked holds; None where nothing was judged
    caution: bool = False  # whether something that may break the robot was not checked
    asked: tuple[tuple[str, str], ...] = ()  # what was asked, as names and values
    assumed: tuple[str, ...] = ()  # what was assumed, and what was not checked
    notes: tuple[str, ...] = ()
    tables: tuple[ReportTable, ...] = ()
    figures: tuple[ReportFigure, ...] = ()
    motion: Mapping[str, Any] | None = None  # data of the 3D player
    facts: tuple[tuple[str, str], ...] = ()  # provenance
    commands: tuple[str, ...] = ()  # they repeat it
    task: str = ""  # text of the task file that the commands read; empty where they read none


def number(value: Any, unit: str = "", state: str = "") -> ReportCell:
    """Cell of a number; of one that is missing or not finite, a dash."""
    if value is None or not np.isfinite(value):
        return ReportCell("\N{EN DASH}", None, state)
    return ReportCell(f"{plain_number(value)} {unit}".strip(), float(value), state)


def plain_number(value: float) -> str:
    """A number with up to six significant digits and a true minus sign."""
    return f"{value:.{DIGITS}g}".replace("-", "\N{MINUS SIGN}")


def unit(text: str) -> ReportCell:
    """Cell of a unit."""
    return ReportCell(raised(text), state="unit")


def raised(text: str) -> str:
    """A unit or a sum with raised exponents, such as ``kg m²``."""
    return text.replace("^2", "²").replace("^3", "³")


def percent(value: float | None, state: str = "") -> ReportCell:
    """Cell of a fraction in percent."""
    if value is None or not np.isfinite(value):
        return ReportCell("\N{EN DASH}", None, state)
    return ReportCell(f"{100 * value:.3g} %", float(value), state)


def kept(holds: bool) -> ReportCell:
    """Cell that says whether a limit holds."""
    return ReportCell("yes" if holds else "NO", float(holds), "" if holds else "bad")


def text_of(value: Any) -> str:
    """A value of a task or a recipe in words."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, Mapping):
        return "; ".join(f"{name}: {text_of(each)}" for name, each in value.items() if each is not None)
    if isinstance(value, Iterable) and not isinstance(value, str):
        return ", ".join(text_of(each) for each in value) or "none"
    return "none" if value is None else str(value)


_LIMITS = "limits"
_BESIDE = ("executor", "workers")  # change nothing in the result
_LONG = 200  # characters


def asked(task: Mapping[str, Any], always: Collection[str]) -> tuple[tuple[str, str], ...]:
    """Some options of a task, and every other one that is not the default, as names and texts."""
    changed = {name: value for name, value in _flat(task).items() if name in always or not _is_default(name, value)}
    return tuple((name.replace("_", " "), _cut(text_of(value))) for name, value in changed.items())


def task_file(task: Mapping[str, Any]) -> str:
    """The same task as the text of a task file, an option per line; JSON is YAML."""
    limits = {name: value for name, value in (task.get(_LIMITS) or {}).items() if value is not None}
    plain = {name: value for name, value in task.items() if value is not None and name != _LIMITS}
    options = {**plain, **({_LIMITS: limits} if limits else {})}
    lines = (f"{json.dumps(name)}: {json.dumps(value, ensure_ascii=False)}" for name, value in options.items())
    return "{\n  " + ",\n  ".join(lines) + "\n}\n"


def _flat(task: Mapping[str, Any]) -> dict[str, Any]:
    limits = {f"{name}_limit": value for name, value in (task.get(_LIMITS) or {}).items()}
    return {**{name: value for name, value in task.items() if name not in (_LIMITS, *_BESIDE)}, **limits}


def _is_default(name: str, value: Any) -> bool:
    if name == "snap_angles":
        return bool(value)
    known = _defaults().get(name)
    return value is None or value == known or (isinstance(value, list) and tuple(value) == known)


def _defaults() -> dict[str, Any]:
    fields = [(field, part) for part in PARTS.values() for field, _ in options_of(part)]
    return {field.name: field.default if field.default is not dataclasses.MISSING else None for field, _ in fields}


def _cut(text: str) -> str:
    return text if len(text) <= _LONG else f"{text[: _LONG - 1]}\N{HORIZONTAL ELLIPSIS}"


_NAMES = {"wall_seconds": "time taken [s]", "cpu_seconds": "processor time [s]", "problem": "hash of the problem"}
_LEFT_OUT = ("run",)


def facts(provenance: Mapping[str, Any], **hashes: Any) -> tuple[tuple[str, str], ...]:
    """Provenance of a result."""
    shown = {name.replace("_", " "): value for name, value in hashes.items() if value is not None}
    shown |= {_NAMES.get(name, name): value for name, value in provenance.items() if name not in _LEFT_OUT}
    return tuple((name, text_of(value)) for name, value in shown.items() if value not in (None, [], ()))
