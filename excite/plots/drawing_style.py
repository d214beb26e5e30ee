"""The style that figures are drawn and written in: one style file, and one more for each width of a paper's columns."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import matplotlib
from matplotlib import style

from excite.plots.style import SCREEN, STYLES
from excite.registry import FIGURE_WIDTHS
from regressors.errors import InputError
from regressors.quantities import shown

_WIDTH: ContextVar[str] = ContextVar("width", default="screen")


@contextmanager
def drawing_style(width: str) -> Iterator[None]:
    """Draw and write in the style of a width; what the user's own matplotlibrc says does not count."""
    if width not in FIGURE_WIDTHS:
        raise InputError(f"expected `width` to be one of {', '.join(FIGURE_WIDTHS)}, given {shown(width)}")
    files = [STYLES / "screen.mplstyle", *([] if width == "screen" else [STYLES / f"{width}.mplstyle"])]
    before = _WIDTH.set(width)
    try:
        with style.context(files, after_reset=True):
            yield
    finally:
        _WIDTH.reset(before)


def column_width() -> float:
    """Width of the column that is drawn for [in]; infinite for a screen."""
    return float("inf") if _WIDTH.get() == "screen" else float(matplotlib.rcParams["figure.figsize"][0])


def size_of(parameter: str) -> float:
    """Size of the style that is drawn in, such as ``xtick.labelsize``."""
    style_in_use: Any = matplotlib.rcParams
    return float(style_in_use[parameter])


def columns_that_fit(most: int, width: float) -> int:
    """Number of columns of equal panels."""
    whole = column_width()
    return most if whole == float("inf") else min(most, max(1, int(whole / width)))


def in_proportion(parameter: str) -> float:
    """Size of the style that is drawn in, over that of figures for a screen."""
    return size_of(parameter) / float(SCREEN[parameter])
