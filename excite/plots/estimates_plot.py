"""Estimates over time, of the recursive method [KD96] Figs. 5 and 15."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from excite.plots.panels import Panel, Timeline, head, legend_below, panels, value_axis
from excite.plots.style import BAND, BLUE, DARK, GREY, VERMILLION, columns_that_fit, significant
from regressors.errors import InputError
from regressors.samples import Array

if TYPE_CHECKING:
    from excite.identification.estimate import Estimate
    from excite.identification.identification import Identification
    from excite.identification.provenance import ReferenceValues

_FEW = 24  # parameters, above which panels are smaller
_LEAST = 1.15  # width of a panel with its numbers [in]
_SETTLED = 0.25  # of the instants, after which an estimate must be in view
_FAR = 6.0  # a reference further off than this many times the height of curve and band is not in view


def estimates_figure(result: Identification, reference: ReferenceValues | None = None) -> Figure:
    """Draw every estimate over time, with its final 99 % interval."""
    estimate = result.estimate
    if estimate.history is None:
        raise InputError(f"the estimator {estimate.method} keeps no history of its estimates; recursive does")
    time, path = estimate.history
    pass_number = np.concatenate([[0], np.cumsum(np.diff(time) < 0)])  # times restart with the next log
    timeline = Timeline.of([""] * (int(pass_number[-1]) + 1), time, pass_number)
    count = len(estimate.names)
    columns = min(columns_that_fit(4 if count <= _FEW else 6, _LEAST), count)
    panel = Panel((2.5 if count <= _FEW else 1.9,) * columns, 1.15, left=0.68, between=0.42, least=_LEAST)
    rows = -(-count // columns)
    figure, grid = panels(rows, panel, f"{result.robot.name}: estimates over time, {estimate.method}")
    flat = [ax for row in grid for ax in row]
    known = np.full(count, np.nan) if reference is None else reference.values
    for k, ax in enumerate(flat):
        if k >= count:
            ax.remove()
            continue
        ax.plot(*timeline.curve(time, pass_number, path[:, k]), color=BLUE, linewidth=1.1, zorder=3)
        _draw_end(ax, estimate, k, float(known[k]), path[:, k])
        timeline.dress(ax, bottom=k + columns >= count, numbers=5)
    legend_below(figure, _legend(reference))
    return figure


def _draw_end(ax: Axes, estimate: Estimate, k: int, known: float, path: Array) -> None:
    """Draw the final value, its interval and the reference, and set the vertical range."""
    value, half = float(estimate.values[k]), float(estimate.half_width[k])
    low, high = settled_range(path, value, half, known)
    note, colour = "", DARK
    if np.isfinite(value):
        ax.axhline(value, color=DARK, linewidth=0.8, zorder=2)
        if np.isfinite(half):
            ax.axhspan(value - half, value + half, color=BAND, linewidth=0, zorder=1)
    else:
        note, colour = "not shown", GREY
    if np.isfinite(known):
        ax.axhline(known, color=VERMILLION, linestyle=":", linewidth=1.3, zorder=2.5)
        if not low <= known <= high:
            arrow = "\N{UPWARDS ARROW}" if known > high else "\N{DOWNWARDS ARROW}"  # out of view
            note, colour = f"{arrow} {significant(known, 3)}", VERMILLION
    ax.set_ylim(low, high)
    value_axis(ax, "", 4)
    head(ax, f"{estimate.names[k]} [{estimate.units[k]}]", note, colour)


def settled_range(path: Array, value: float, half_width: float, known: float) -> tuple[float, float]:
    """Vertical range for an estimate's path."""  # path (k,)
    seen = path[int(_SETTLED * path.size) :]
    low, high = float(seen.min()), float(seen.max())
    if np.isfinite(value) and np.isfinite(half_width):
        low, high = min(low, value - half_width), max(high, value + half_width)
    if np.isfinite(known) and max(low - known, known - high) <= _FAR * (high - low):
        low, high = min(low, known), max(high, known)
    pad = 0.1 * (high - low) if high > low else max(0.1 * abs(high), 1e-12)
    return low - pad, high + pad


def _legend(reference: ReferenceValues | None) -> list[Artist]:
    handles: list[Artist] = [
        Line2D([], [], color=BLUE, linewidth=1.1, label="estimate"),
        Line2D([], [], color=DARK, linewidth=0.8, label="final value"),
        Patch(color=BAND, label="its 99 % interval"),
    ]
    if reference is not None:
        kind = {"truth": "true value"}.get(reference.kind, f"value of the {reference.kind}")
        handles.append(Line2D([], [], color=VERMILLION, linestyle=":", linewidth=1.3, label=kind))
    return handles
