"""Measured and predicted values of an equation over time, their difference below, and its error.

Many values are drawn as bands of their extremes and percentiles, where a curve would be a solid block.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from excite.plots.panels import Panel, Timeline, head, split, value_axis
from excite.plots.style import BLUE, DARK, GREY, SKY, VERMILLION, significant
from regressors.samples import Array, Index

MEASURED: dict[str, Any] = {
    "color": "#BBBBBB",
    "linewidth": 3.2,
    "solid_joinstyle": "round",
}  # light and thick: seen beside the other
PREDICTED: dict[str, Any] = {"color": BLUE, "linewidth": 1.0}
_WIDTH, _LOWER, _GAP = 10.5, 0.6, 0.12  # [in]
BINS = 400  # at most, over all logs
DENSE = 1600  # values of all logs from which on they are drawn as bands
_FULL = 25  # values in a bin
PERCENTILES = (0.0, 5.0, 50.0, 95.0, 100.0)
_CURVE = 0.8  # width of a curve [pt]
_ALL = "#D9D9D9"
_QUANTITIES = {"Nm": "torque", "N": "force", "J": "work", "N s": "impulse", "Nm s": "angular impulse"}
_LARGE = 0.5  # relative error above which the note is highlighted


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


def envelope(values: Array, bins: int) -> tuple[Index, Array]:
    """Least value, 5th, 50th and 95th percentile and largest value of each of ``bins`` stretches."""
    edges = np.linspace(0, values.size, bins + 1).astype(np.intp)
    parts = [part[np.isfinite(part)] for part in np.split(values, edges[1:-1])]
    unknown = np.full(len(PERCENTILES), np.nan)
    return edges, np.array([np.percentile(part, PERCENTILES) if part.size else unknown for part in parts]).T


def draw_values(ax: Axes, timeline: Timeline, time: Array, log: Index, values: Array) -> None:
    """Draw values of several logs: curves, or bands where a log has many."""
    if values.size < DENSE:
        ax.plot(*timeline.curve(time, log, values), color=DARK, linewidth=_CURVE)
        return
    for k in range(len(timeline.names)):
        t, v = time[log == k] + timeline.offsets[k], values[log == k]
        if not v.size:
            continue
        edges, bands = envelope(v, max(1, min(round(BINS * v.size / values.size), v.size // _FULL)))
        places = np.repeat(np.append(t[edges[:-1]], t[-1]), 2)[1:-1]
        low, lower, middle, upper, high = np.repeat(bands, 2, axis=1)
        ax.fill_between(places, low, high, color=_ALL, linewidth=0.0)
        ax.fill_between(places, lower, upper, color=SKY, linewidth=0.0)
        ax.plot(places, middle, color=DARK, linewidth=_CURVE)


def values_legend(count: int, name: str) -> list[Artist]:
    """Entries of a legend for what `draw_values` draws."""
    if count < DENSE:
        return [Line2D([], [], color=DARK, linewidth=_CURVE, label=name)]
    return [
        Line2D([], [], color=DARK, linewidth=_CURVE, label=f"median of the {name}s"),
        Patch(color=SKY, label=f"90 % of the {name}s"),
        Patch(color=_ALL, label="all of them"),
    ]


def label_equation(ax: Axes, unit: str) -> None:
    """Write quantity and unit of an equation beside its panel."""
    value_axis(ax, f"{_QUANTITIES.get(unit, 'value')} [{unit}]")


def relative_error(measured: Array, predicted: Array) -> str:
    """``||y - y_predicted|| / ||y||`` in percent; a text where all measured values are zero."""
    size = float(np.linalg.norm(measured))
    return f"{significant(100 * float(np.linalg.norm(measured - predicted)) / size, 3)} %" if size > 0 else "undefined"


def error_note(measured: Array, predicted: Array, unit: str) -> tuple[str, str]:
    """Error of one equation as text, and the text's colour."""
    rms, size = (float(np.sqrt(np.mean(x**2))) for x in (measured - predicted, measured))
    return error_text(rms, size, unit, relative_error(measured, predicted)), VERMILLION if rms > _LARGE * size else DARK


def error_text(rms: float, size: float, unit: str, relative: str) -> str:
    """Root mean square of the differences and of the measured values [unit], and their ratio."""
    return f"rms error {significant(rms, 3)} {unit} of {significant(size, 3)} {unit}: {relative}"
