"""Base parameters beside their bars: whole expressions, in rows as high as their lines."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from excite.plots.style import typeset
from regressors.samples import Array

LINES = 4  # of one expression; longer ones are left to a file
_FURTHER_LINE = 0.67  # of a row's height


def parameter_label(name: str, expression: str, length: int, file: str) -> str:
    """Expression of a base parameter over several lines, preceded by its name unless the sum begins with it."""
    begins = expression == name or expression.startswith(f"{name} ")
    lines = wrapped_sum(expression if begins else f"{name} = {expression}", length)
    if len(lines) > LINES:
        lines = [f"{name} = sum of {len(_terms(expression))} terms, in {file}"]
    return typeset("\n".join(lines))


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
