"""What a page shows, without its form: sections with a verdict, tables, figures, a motion and how to repeat it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

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
