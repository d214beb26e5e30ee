"""Distances between links and from obstacles over time, for the nearest pairs, all on one scale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, NullLocator, SymmetricalLogLocator

from constraints.bounds.certificate import LimitUse
from constraints.collision.collision_limits import Clearance
from excite.design.design import Design
from excite.plots.panels import Panel, head, legend_below, panels
from excite.plots.style import BLUE, DARK, FORBIDDEN, GREY, LABEL, NOTE, VERMILLION, columns_that_fit, tidy, typeset
from regressors.samples import Array

_COLUMNS, _ROWS = 3, 4
_LEAST = 1.7  # width of a panel with its numbers [in]
_MILLIMETRES = 1e3
_LINEAR = 0.6  # height of the linear part, in decades
_OTHERS: dict[str, Any] = {"color": GREY, "linewidth": 0.7, "linestyle": (0, (4, 1.5))}
_NEAREST: dict[str, Any] = {"color": BLUE, "linewidth": 1.6}


def clearance_figure(design: Design) -> Figure:
    """Draw the nearest pair of bodies above all others, and a panel per pair, for the twelve nearest pairs."""
    uses, distances = _uses(design), _distances(design)
    nearest = sorted(uses, key=lambda use: use.extreme)[: _COLUMNS * _ROWS]
    columns = columns_that_fit(_COLUMNS, _LEAST)
    rows = max(1, -(-len(nearest) // columns))
    panel = Panel(widths=(3.4,) * columns, height=1.5, left=0.65, between=0.62, least=_LEAST)
    figure, axes = panels(1 + rows, panel, _title(design, uses, len(nearest)))
    flat = [ax for row in axes[1:] for ax in row]
    time, scale = design.samples.time, _Scale.of(nearest, distances)
    overview = _whole_row(axes[0])
    for use in nearest[1:]:
        overview.plot(time, _MILLIMETRES * distances[use.label], **_OTHERS)
    if nearest:
        _draw(overview, time, distances[nearest[0].label], nearest[0], scale)
        head(overview, f"nearest: {nearest[0].label}", _note(nearest[0]), _colour(nearest[0]))
    for ax, use in zip(flat, nearest, strict=False):
        _draw(ax, time, distances[use.label], use, scale)
        head(ax, use.label, _note(use), _colour(use))
    for ax in flat[len(nearest) :]:
        ax.set_axis_off()
    for ax in flat[max(0, len(nearest) - columns) : len(nearest)]:
        ax.set_xlabel("time [s]", fontsize=LABEL, color=DARK)
    legend_below(figure, _legend(len(nearest) > 1))
    return figure


def _title(design: Design, uses: Sequence[LimitUse], shown: int) -> str:
    broken = sum(not use.holds for use in uses)
    verdict = "all keep the clearance" if broken == 0 else f"{broken} BROKEN"
    part = f", the nearest {shown} of {len(uses)} pairs" if shown < len(uses) else ""
    return f"{design.robot.name}: distances{part}; {verdict}"


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


@dataclass(frozen=True)
class _Scale:
    """Scale of all panels: linear up to the clearance, logarithmic above it [mm]."""

    bottom: float
    linear: float
    top: float

    @classmethod
    def of(cls, uses: Sequence[LimitUse], distances: Mapping[str, Array]) -> _Scale:
        linear = max((_MILLIMETRES * use.bound for use in uses), default=1.0)
        values = np.concatenate([[linear], *(_MILLIMETRES * distances[use.label] for use in uses)])
        lowest = min([0.0, float(values.min()), *(_MILLIMETRES * use.extreme for use in uses)])
        return cls(1.1 * lowest, linear, max(1.3 * float(values.max()), 3.0 * linear))

    def apply(self, ax: Axes) -> None:
        ax.set_yscale("symlog", linthresh=self.linear, linscale=_LINEAR)
        ax.set_ylim(self.bottom, self.top)
        ax.yaxis.set_major_locator(SymmetricalLogLocator(base=10.0, linthresh=self.linear, subs=[1.0, 3.0]))
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: typeset(f"{value:.4g}")))
        ax.yaxis.set_minor_locator(NullLocator())
        ax.set_ylabel("distance [mm]", fontsize=NOTE, color=DARK)


def _whole_row(row: Sequence[Axes]) -> Axes:
    """Replace the panels of a row by one."""
    place, figure = row[0].get_subplotspec(), row[0].figure
    assert place is not None
    assert isinstance(figure, Figure)
    coordinates = row[0].yaxis.label.get_position()[0] * float(row[0].bbox.width)
    for ax in row:
        ax.remove()
    ax = figure.add_subplot(place.get_gridspec()[0, :])
    tidy(ax)
    if figure.get_layout_engine() is None:
        ax.yaxis.set_label_coords(coordinates / float(ax.bbox.width), 0.5)
    return ax


def _draw(ax: Axes, time: Array, distance: Array, use: LimitUse, scale: _Scale) -> None:
    bound, extreme = _MILLIMETRES * use.bound, _MILLIMETRES * use.extreme
    ax.plot(time, _MILLIMETRES * distance, **_NEAREST)
    ax.axhspan(scale.bottom, bound, color=FORBIDDEN, linewidth=0, zorder=0.5)
    ax.axhline(bound, color=VERMILLION, linewidth=1.0, zorder=1.5)
    ax.plot([use.time], [extreme], "o", color=_colour(use), markersize=4.5, clip_on=False, zorder=3)
    ax.set_xlim(time[0], time[-1])
    scale.apply(ax)


def _colour(use: LimitUse) -> str:
    return DARK if use.holds else VERMILLION


def _note(use: LimitUse) -> str:
    extreme = f"{_MILLIMETRES * use.extreme:.1f} mm"
    return f"{extreme} or more" if use.holds else f"{extreme}, BROKEN"


def _legend(others: bool) -> list[Artist]:
    return [
        Line2D([], [], **_NEAREST, label="distance"),
        *([Line2D([], [], **_OTHERS, label="of the other pairs below")] if others else []),
        Patch(color=FORBIDDEN, label="closer than the clearance"),
        Line2D([], [], color=DARK, marker="o", markersize=4.5, linestyle="", label="no instant is below (proven)"),
    ]
