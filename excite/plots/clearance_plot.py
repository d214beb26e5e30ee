"""Distances between links and from obstacles over time, for the nearest pairs."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from constraints.bounds.certificate import LimitUse
from constraints.collision.collision_limits import Clearance
from excite.design.design import Design
from excite.plots.drawing_style import columns_that_fit
from excite.plots.panels import Panel, head, legend_below, panels, value_axis
from excite.plots.style import BLUE, DARK, FORBIDDEN, LABEL, VERMILLION, shortened
from regressors.samples import Array

_COLUMNS, _ROWS = 3, 4
_LEAST = 1.7  # width of a panel with its numbers [in]
_MILLIMETRES = 1e3
_NAME = 34  # characters


def clearance_figure(design: Design) -> Figure:
    """Draw one panel per pair of bodies, for the twelve nearest pairs.

    Parameters
    ----------
    design : Design
        Design of a task with a world.

    Returns
    -------
    Figure
        Distance between the surfaces at the task's rate. The range below the clearance is shaded; the dot is the
        certified lower bound over all instants.
    """
    uses, distances = _uses(design), _distances(design)
    nearest = sorted(uses, key=lambda use: use.extreme)[: _COLUMNS * _ROWS]
    columns = columns_that_fit(_COLUMNS, _LEAST)
    broken = sum(not use.holds for use in uses)
    verdict = "all keep the clearance" if broken == 0 else f"{broken} BROKEN"
    shown = f", the nearest {len(nearest)} of {len(uses)} pairs" if len(nearest) < len(uses) else ""
    rows = max(1, -(-len(nearest) // columns))
    figure, axes = panels(
        rows,
        Panel(widths=(3.4,) * columns, height=1.5, left=0.65),
        f"{design.robot.name}: distances{shown}; {verdict}",
    )
    places = [ax for row in axes for ax in row]
    for ax, use in zip(places, nearest, strict=False):
        _draw(ax, design.samples.time, distances[use.label], use)
    for ax in places[len(nearest) :]:
        ax.set_axis_off()
    for ax in places[max(0, len(nearest) - columns) : len(nearest)]:
        ax.set_xlabel("time [s]", fontsize=LABEL, color=DARK)
    legend_below(
        figure,
        [
            Line2D([], [], color=BLUE, linewidth=1.4, label="distance"),
            Patch(color=FORBIDDEN, label="closer than the clearance"),
            Line2D([], [], color=DARK, marker="o", markersize=4, linestyle="", label="no instant is below (proven)"),
        ],
    )
    return figure


def _uses(design: Design) -> list[LimitUse]:
    labels = {label for limit in _limits(design) for label in limit.labels}
    return [use for use in design.limits if use.label in labels]


def _limits(design: Design) -> list[Clearance]:
    return [limit for limit in design.nonlinear if isinstance(limit, Clearance)]


def _distances(design: Design) -> dict[str, Array]:
    """Smallest of each label's functions at every instant [m]."""
    distances: dict[str, Array] = {}
    for limit in _limits(design):
        shown = limit.shown(limit.values(design.samples))
        for label in dict.fromkeys(limit.labels):
            distances[label] = shown[:, [other == label for other in limit.labels]].min(axis=1)
    return distances


def _draw(ax: Axes, time: Array, distance: Array, use: LimitUse) -> None:
    values, bound, extreme = (_MILLIMETRES * np.asarray(x) for x in (distance, use.bound, use.extreme))
    ax.plot(time, values, color=BLUE, linewidth=1.4)
    bottom = min(0.0, float(extreme), float(values.min()))
    ax.axhspan(bottom, float(bound), color=FORBIDDEN, linewidth=0, zorder=0.5)
    ax.axhline(float(bound), color=VERMILLION, linewidth=1.0, zorder=1.5)
    ax.plot([use.time], [extreme], "o", color=DARK if use.holds else VERMILLION, markersize=4, clip_on=False, zorder=3)
    ax.set_xlim(time[0], time[-1])
    ax.set_ylim(bottom, 1.05 * max(float(values.max()), 2 * float(bound)))
    value_axis(ax, "[mm]")
    note = f"{float(extreme):.1f} mm or more" if use.holds else f"{float(extreme):.1f} mm, BROKEN"
    head(ax, shortened(use.label, _NAME), note, DARK if use.holds else VERMILLION)
