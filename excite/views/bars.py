"""Rows of bars: whole expressions beside them, columns of numbers, one colour and hatch per unit in every figure."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from excite.views.style import (
    BLUE,
    DARK,
    GREEN,
    GREY,
    LABEL,
    LETTER,
    NOTE,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    broken,
    column_width,
    panel_width,
    size_of,
    tidy,
    typeset,
)
from regressors.samples import Array

LINES = 4  # of one expression; longer ones are left to a file
_SHARE, _LEFT_BY_NAMES = 0.4, 0.55  # of a column's width, for expressions; of a panel's, beside them
_FURTHER_LINE = 0.67  # of a row's height
_YELLOW = "#F0E442"  # of the same palette
_LINEAR = "////"  # units of prismatic joints, whose quantity has the colour of the revolute ones
# Hatches tell units apart in print without colours.
_LOOKS = {
    "kg m^2": (BLUE, ""),
    "kg m": (ORANGE, ""),
    "kg": (SKY, ".."),
    "Nm": (GREEN, ""),
    "N": (GREEN, _LINEAR),
    "Nm s/rad": (PURPLE, "\\\\"),
    "N s/m": (PURPLE, _LINEAR),
    "Nm/rad": (SKY, "\\\\"),
    "N/m": (SKY, _LINEAR),
    "Nm/Nm": (VERMILLION, ""),
    "N/N": (VERMILLION, _LINEAR),
    "Nm (s/rad)^0.5": (_YELLOW, ""),
    "N (s/m)^0.5": (_YELLOW, _LINEAR),
}
_OTHER = (GREY, "xx")


def parameter_label(name: str, expression: str, length: int, file: str) -> str:
    """Expression of a base parameter over several lines, preceded by its name unless the sum begins with it."""
    if column_width() < float("inf"):
        length = min(length, int(_SHARE * 72.0 * column_width() / (LETTER * size_of("xtick.labelsize"))))
    begins = expression == name or expression.startswith(f"{name} ")
    lines = wrapped_sum(expression if begins else f"{name} = {expression}", length)
    if len(lines) > LINES:
        lines = textwrap.wrap(f"{name} = sum of {len(_terms(expression))} terms, in {file}", max(length, len(file)))
    return typeset("\n".join(lines))


def beside_names(text: str, ax: Axes) -> str:
    """Text above or below a panel beside names, in a column in lines of what they leave of its width."""
    return broken(text, _LEFT_BY_NAMES * panel_width(ax), "axes.labelsize")


def wrapped_sum(text: str, length: int) -> list[str]:
    """Lines of a sum, broken between its terms."""
    lines = [""]
    for term in _terms(text):
        if lines[-1] and len(lines[-1]) + len(term) > length:
            lines.append(term.lstrip())
        else:
            lines[-1] += term
    return lines


def row_places(labels: Sequence[str]) -> tuple[Array, float]:
    """Middle of each label's row from the top, and the height of all, in heights of a row with one line."""
    heights = np.array([1.0 + _FURTHER_LINE * label.count("\n") for label in labels])
    return np.cumsum(heights) - 0.5 * heights, float(heights.sum())


def _terms(text: str) -> list[str]:
    return re.split(r"(?= [+-] )", text)


def unit_style(unit: str) -> dict[str, Any]:
    """Style of a patch that shows a value in a unit; units that no built-in model has are grey."""
    colour, hatch = _LOOKS.get(unit, _OTHER)
    return {"facecolor": colour, "hatch": hatch, "edgecolor": "white", "linewidth": 0.0}


def unit_patches(units: Iterable[str]) -> list[Patch]:
    """Entries of a legend for units, one for all that no built-in model has."""
    given = list(dict.fromkeys(units))
    others = [unit for unit in given if unit not in _LOOKS]
    patches = [Patch(**unit_style(unit), label=typeset(unit)) for unit in given if unit in _LOOKS]
    if others:
        patches.append(Patch(**unit_style(others[0]), label=typeset(", ".join(unit or "none" for unit in others))))
    return patches


_APART, _MEAN = 12.0, 0.6  # between columns of numbers [pt]; mean width of a letter over the size of the font


class NumberColumn(NamedTuple):
    """A column of numbers beside a panel; an empty text where a row has none."""

    heading: str
    texts: Sequence[str]
    side: str = "right"  # on which its texts end or begin
    marked: Sequence[bool] = ()

    @property
    def width(self) -> float:
        """Width [pt]."""
        return _MEAN * max(LABEL * len(self.heading), NOTE * max(map(len, self.texts), default=0))


def columns_inches(columns: Sequence[NumberColumn]) -> float:
    """Width of columns with the space around them [in]."""
    return (_APART + sum(column.width + _APART for column in columns)) / 72.0


def write_columns(ax: Axes, places: Sequence[float], columns: Sequence[NumberColumn]) -> None:
    """Write columns of numbers on the right of a panel, each text at the place of its row."""
    style: dict[str, Any] = {"textcoords": "offset points", "va": "center"}
    begin = _APART
    for column in columns:
        at = begin + column.width * (column.side == "right")
        heading = {**style, "va": "bottom", "xycoords": "axes fraction", "fontsize": LABEL, "color": DARK}
        ax.annotate(column.heading, (1.0, 1.0), (at, 6), ha=column.side, **heading)
        for k, (place, text) in enumerate(zip(places, column.texts, strict=True)):
            marked = bool(column.marked) and column.marked[k]
            look: dict[str, Any] = {
                "color": VERMILLION if marked else DARK,
                "fontweight": "bold" if marked else "normal",
            }
            where: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "fontsize": NOTE, "ha": column.side}
            ax.annotate(text, (1.0, place), (at, 0), **where, **look, **style)
        begin += column.width + _APART


def bar_panel(ax: Axes, top: float, bottom: float, places: Sequence[float] = (), labels: Sequence[str] = ()) -> None:
    """Make a panel one of horizontal bars, from the top, with labels on the left."""
    tidy(ax)
    ax.grid(False, axis="y")
    ax.set_ylim(bottom, top)
    ax.set_yticks(places, [typeset(label) for label in labels], fontsize=NOTE)
    ax.tick_params(axis="y", length=0)
