"""Runs of a friction plan: position and velocity of each coordinate over time, windows of constant speed marked."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from excite.friction.plan.measurements import CoordinatePlan, FrictionPlan
from excite.plots.panels import Panel, head, legend_below, panels, value_axis
from excite.plots.style import BLUE, DARK, GREEN, GREY, NOTE, VERMILLION, typeset

_PANEL = Panel(widths=(5.0, 5.0), height=1.5)
_INSTANTS = 4001
_GRAVITY = {
    "none": "no gravity",
    "cancels": "gravity cancels",
    "subtracted": "gravity to be subtracted",
    "stated": "gravity stated to cancel",
}


def friction_plan_figure(plan: FrictionPlan) -> Figure:
    """Draw position and velocity of every coordinate over its runs.

    Parameters
    ----------
    plan : FrictionPlan
    """
    figure, rows = panels(len(plan.coordinates), _PANEL, f"{plan.robot.name}: runs to measure friction")
    for (left, right), c in zip(rows, plan.coordinates, strict=True):
        bends = [part.begin + part.law.breaks for part in c.runs.parts if part.law is not None]
        time = np.unique(np.concatenate([np.linspace(0.0, c.runs.duration, _INSTANTS), *bends]))
        s, ds, *_ = c.runs.values(time)[0]
        for ax, values, quantity, unit in (
            (left, s + c.centre, "position", c.unit),
            (right, ds, "velocity", c.unit + "/s"),
        ):
            ax.plot(time, values, color=GREY, linewidth=0.7)
            value_axis(ax, f"{quantity} [{unit}]")
            ax.set_xlim(0.0, c.runs.duration)
        for window in c.windows:
            left.plot([window.start, window.end], [window.first, window.last], color=BLUE, linewidth=2.0)
            right.plot([window.start, window.end], [window.speed] * 2, color=BLUE, linewidth=2.0)
            right.plot(0.5 * (window.start + window.end), window.speed, "o", color=BLUE, markersize=2.5)  # if short
        for part in c.breakaways:
            left.axvspan(part.begin, _end(part.begin, c), color=GREEN, alpha=0.3, linewidth=0.0)
        for sign in (-1.0, 1.0):
            right.axhline(sign * c.pace.velocity, color=VERMILLION, linewidth=0.9, zorder=1.5)
        head(left, c.label, _GRAVITY[c.place.gravity])
        left_out = ", ".join(f"{percent:g}" for percent in c.left_out)
        notes = [f"left out: {left_out} %"] if left_out else []
        notes += [f"in another file: ramps of torque to {c.ramps.largest:.3g} {c.ramps.unit}"] if c.ramps else []
        head(right, c.label, "; ".join(notes))
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


def _end(begin: float, c: CoordinatePlan) -> float:
    """End of the part of a coordinate's runs that begins at ``begin`` [s]."""
    later = [part.begin for part in c.runs.parts if part.begin > begin]
    return min(later, default=c.runs.duration)
