"""Phase plots: velocity over position of every joint and of every other limited coordinate, within its limits."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from constraints.linear import linear_limits
from excite.design.design import Design
from excite.views.motion_plot import motion_functions
from excite.views.panels import Panel, alike, head, legend_below, value_axis
from excite.views.style import BLUE, DARK, FORBIDDEN, NOTE, VERMILLION, typeset
from regressors.samples import Array

_COLUMNS = 4
_PANEL = Panel((2.35,), 2.4, left=0.65, between=0.6)
_INSTANTS = 2001
_BEYOND = 0.06  # of the range, shown beyond a bound
_WIDER = 3.0  # a bound further out than this many times the motion's range is not in view


def phase_figure(design: Design) -> Figure:
    """Draw velocity over position of every function of the joints that has limits, over one period."""
    functions = motion_functions(design.moving, linear_limits(design.moving), design.limits)
    functions = [each for each in functions if each.bounds[0] or each.bounds[1]]
    samples = design.trajectory.samples(np.linspace(0.0, design.trajectory.duration, _INSTANTS))
    figure, flat, _ = alike(len(functions), _COLUMNS, _PANEL, f"{design.robot.name}: velocity over position")
    for ax, each in zip(flat, functions, strict=True):
        z, dz = each.values(samples, 0), each.values(samples, 1)
        ax.set_xlim(*_view(z, each.allowed(0)))
        ax.set_ylim(*_view(dz, each.allowed(1)))
        _forbidden(ax, each.allowed(0), each.allowed(1))
        ax.plot(z, dz, color=BLUE, linewidth=1.0)
        ax.plot(z[0], dz[0], "o", color=DARK, markersize=4)
        head(ax, each.name)
        ax.set_xlabel(typeset(f"position [{each.unit}]"), fontsize=NOTE, color=DARK)
        value_axis(ax, f"velocity [{each.unit}/s]")
    meanings = [
        Line2D([], [], color=BLUE, linewidth=1.2, label="motion"),
        Line2D([], [], color=DARK, marker="o", linestyle="", markersize=4, label="at rest, start and end"),
        Patch(facecolor=FORBIDDEN, edgecolor=VERMILLION, label="beyond a limit"),
    ]
    legend_below(figure, meanings)
    return figure


def _view(values: Array, bounds: tuple[float, float]) -> tuple[float, float]:
    """Range to show: the motion, and its bounds where they are near."""
    low, high = float(values.min()), float(values.max())
    size = max(high - low, 1e-9)
    ends = [low, high, *(b for b in bounds if np.isfinite(b) and low - _WIDER * size < b < high + _WIDER * size)]
    margin = _BEYOND * max(max(ends) - min(ends), 1e-9)
    return min(ends) - margin, max(ends) + margin


def _forbidden(ax: Axes, position: tuple[float, float], velocity: tuple[float, float]) -> None:
    """Shade the range beyond the bounds in view."""
    for bounds, view, span, line in (
        (position, ax.get_xlim(), ax.axvspan, ax.axvline),
        (velocity, ax.get_ylim(), ax.axhspan, ax.axhline),
    ):
        for bound, edge in zip(bounds, view, strict=True):
            if view[0] < bound < view[1]:
                span(min(bound, edge), max(bound, edge), color=FORBIDDEN, linewidth=0.0, zorder=0)
                line(bound, color=VERMILLION, linewidth=0.9)
