"""Measured and predicted values of an equation over time, and their difference below."""

from __future__ import annotations

from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from excite.plots.envelope import draw_values, values_legend
from excite.plots.equation_text import error_note, label_equation
from excite.plots.panels import Panel, head, split, value_axis
from excite.plots.style import BLUE, GREY
from excite.plots.timeline import Timeline
from regressors.samples import Array, Index

MEASURED: dict[str, Any] = {
    "color": "#BBBBBB",
    "linewidth": 3.2,
    "solid_joinstyle": "round",
}  # light and thick: seen beside the other
PREDICTED: dict[str, Any] = {"color": BLUE, "linewidth": 1.0}
_WIDTH, _LOWER, _GAP = 10.5, 0.6, 0.12  # [in]


def fit_panel(count: int) -> Panel:
    """Size of the panels of so many equations, each to be split by `draw_fit`."""
    return Panel((_WIDTH,), (1.3 if count > 1 else 3.0) + _GAP + _LOWER)


def draw_fit(
    ax: Axes,
    timeline: Timeline,
    time: Array,
    log: Index,
    fit: tuple[Array, Array],
    equation: tuple[str, str],
    *,
    bottom: bool,
) -> None:
    """Draw measured values, predicted ones on top of them, and their difference in a panel below, on its own scale."""
    # time (m,); log (m,); fit (m,)
    (measured, predicted), (name, unit) = fit, equation
    upper, lower = split(ax, _LOWER, _GAP)
    upper.plot(*timeline.curve(time, log, measured), **MEASURED)
    upper.plot(*timeline.curve(time, log, predicted), **PREDICTED)
    lower.axhline(0.0, color=GREY, linewidth=0.6)
    draw_values(lower, timeline, time, log, measured - predicted)
    timeline.dress(upper, bottom=False)
    timeline.dress(lower, bottom=bottom)
    label_equation(upper, unit)
    value_axis(lower, f"residual\n[{unit}]", 3)
    head(upper, name, *error_note(measured, predicted, unit))


def fit_legend(count: int, predicted: str) -> list[Artist]:
    """Entries of a legend for `draw_fit`."""
    return [
        Line2D([], [], **MEASURED, label="measured"),
        Line2D([], [], **PREDICTED, label=predicted),
        *values_legend(count, "residual"),
    ]
