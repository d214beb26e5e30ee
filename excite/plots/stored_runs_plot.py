"""Runs of a friction plan that was read from its files: position and velocity of each coordinate, windows marked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from excite.friction.plan.measurements import Window
from excite.plots.panels import Panel, head, legend_below, panels, value_axis
from excite.plots.style import BLUE, DARK, GREEN, GREY, NOTE, VERMILLION, typeset
from regressors.samples import Array

_PANEL = Panel(widths=(5.0, 5.0), height=1.5)
_GRAVITY = {
    "none": "no gravity",
    "cancels": "gravity cancels",
    "subtracted": "gravity to be subtracted",
    "stated": "gravity stated to cancel",
}


@dataclass(frozen=True, eq=False)
class DrawnRuns:
    """Runs of one coordinate."""

    name: str
    unit: str
    time: Array  # (N,)
    position: Array  # (N,)
    velocity: Array  # (N,)
    windows: tuple[Window, ...]
    breakaways: tuple[tuple[float, float], ...]  # first and last instant of each test [s]
    limit: float  # of the velocity
    gravity: str
    note: str


def stored_runs_figure(robot: str, runs: Sequence[DrawnRuns]) -> Figure:
    """Draw position and velocity of every coordinate over its runs."""
    figure, rows = panels(len(runs), _PANEL, f"{robot}: runs to measure friction")
    for (left, right), c in zip(rows, runs, strict=True):
        for ax, values, quantity, unit in (
            (left, c.position, "position", c.unit),
            (right, c.velocity, "velocity", f"{c.unit}/s"),
        ):
            ax.plot(c.time, values, color=GREY, linewidth=0.7)
            value_axis(ax, f"{quantity} [{unit}]")
            ax.set_xlim(0.0, float(c.time[-1]))
        for window in c.windows:
            left.plot([window.start, window.end], [window.first, window.last], color=BLUE, linewidth=2.0)
            right.plot([window.start, window.end], [window.speed] * 2, color=BLUE, linewidth=2.0)
            right.plot(0.5 * (window.start + window.end), window.speed, "o", color=BLUE, markersize=2.5)  # if short
        for begin, end in c.breakaways:
            left.axvspan(begin, end, color=GREEN, alpha=0.3, linewidth=0.0)
        for sign in (-1.0, 1.0):
            right.axhline(sign * c.limit, color=VERMILLION, linewidth=0.9, zorder=1.5)
        head(left, c.name, _GRAVITY.get(c.gravity, c.gravity))
        head(right, c.name, c.note)
    for ax in rows[-1]:
        ax.set_xlabel(typeset("time [s]"), fontsize=NOTE, color=DARK)
    legend_below(
        figure,
        [
            Line2D([], [], color=GREY, linewidth=1.0, label="motion"),
            Line2D([], [], color=BLUE, linewidth=2.0, label="window of constant speed"),
            Line2D([], [], color=GREEN, alpha=0.3, linewidth=6.0, label="breaking away from rest"),
            Line2D([], [], color=VERMILLION, linewidth=1.0, label="velocity limit"),
        ],
    )
    return figure
