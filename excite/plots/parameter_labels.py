"""Base parameters beside their bars: whole expressions, and one colour and hatch per unit in every figure."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from excite.plots.style import (
    BLUE,
    GREEN,
    GREY,
    LETTER,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    broken,
    column_width,
    panel_width,
    size_of,
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
