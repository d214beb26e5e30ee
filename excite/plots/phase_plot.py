"""Phase plots: velocity over position of every joint and of every other limited coordinate, within its limits."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from constraints.linear import linear_limits
from excite.design.design import Design
from excite.plots.panels import legend_below
from excite.plots.style import (
    BLUE,
    DARK,
    FORBIDDEN,
    LABEL,
    NOTE,
    VERMILLION,
    broken,
    columns_that_fit,
    figure_of,
    panel_width,
    plain,
    tidy,
    typeset,
)
from regressors.samples import Array

_COLUMNS = 4
_LETTER = 0.75  # mean width of a bold letter over the size of a note
_LETTERS = 34  # of a line above a panel
_WIDTH, _HEIGHT = 3.0, 3.0  # of a panel [in]
_LEAST = 1.6  # width of a panel with its numbers [in]
_INSTANTS = 2001
_BEYOND = 0.06  # of the range, shown beyond a bound
_WIDER = 3.0  # a bound further out than this many times the motion's range is not in view


@dataclass(frozen=True)
class _Coordinate:
    """A coordinate ``row @ q + offset`` with its position and velocity bounds; infinite where there is none."""

    name: str
    unit: str
    row: Array
    offset: float
    position: tuple[float, float]
    velocity: tuple[float, float]


def phase_figure(design: Design) -> Figure:
    """Draw velocity over position of every coordinate that has limits, over one period."""
    coordinates = _coordinates(design)
    samples = design.trajectory.samples(np.linspace(0.0, design.trajectory.duration, _INSTANTS))
    columns = min(columns_that_fit(_COLUMNS, _LEAST), len(coordinates))
    rows = -(-len(coordinates) // columns)
    title = f"{design.robot.name}: velocity over position"
    figure = figure_of(_WIDTH * columns + 0.4, _HEIGHT * rows + 1.1, title, text=0.6 * rows + 1.1)
    for number, c in enumerate(coordinates, 1):
        ax = figure.add_subplot(rows, columns, number)
        z, dz = samples.q @ c.row + c.offset, samples.dq @ c.row
        ax.set_xlim(*_view(z, c.position))
        ax.set_ylim(*_view(dz, c.velocity))
        _forbidden(ax, c)
        ax.plot(z, dz, color=BLUE, linewidth=1.0)
        ax.plot(z[0], dz[0], "o", color=DARK, markersize=4)
        ax.set_title(
            plain(broken(textwrap.fill(c.name, _LETTERS, break_on_hyphens=False), panel_width(ax), letter=_LETTER)),
            loc="left",
            y=1.0,
            fontsize=LABEL,
            fontweight="bold",
            color=DARK,
        )
        ax.set_xlabel(typeset(f"position [{c.unit}]"), fontsize=NOTE, color=DARK)
        ax.set_ylabel(typeset(f"velocity [{c.unit}/s]"), fontsize=NOTE, color=DARK)
        tidy(ax)
    meanings = [
        Line2D([], [], color=BLUE, linewidth=1.2, label="motion"),
        Line2D([], [], color=DARK, marker="o", linestyle="", markersize=4, label="at rest, start and end"),
        Patch(facecolor=FORBIDDEN, edgecolor=VERMILLION, label="beyond a limit"),
    ]
    legend_below(figure, meanings)
    return figure


def _coordinates(design: Design) -> list[_Coordinate]:
    """Joints and drives of the moving robot; those with the same coordinate are merged."""
    coordinates: dict[tuple[float, ...], _Coordinate] = {}
    for limit in linear_limits(design.moving):
        if limit.derivative > 1:
            continue
        for k, label in enumerate(limit.labels):
            name = label.rsplit(" ", 1)[0]
            key = (*np.round(limit.matrix[k], 9).tolist(),)
            old = coordinates.get(key)
            unit = limit.units[k].removesuffix("/s")
            bounds = float(limit.lower[k]), float(limit.upper[k])
            if old is None:
                none = -np.inf, np.inf
                old = _Coordinate(name, unit, limit.matrix[k], float(limit.offset[k]), none, none)
            names = old.name if name in old.name.split(", ") else f"{old.name}, {name}"
            position, velocity = old.position, old.velocity
            if limit.derivative == 0:
                shift = float(limit.offset[k]) - old.offset
                position = max(position[0], bounds[0] - shift), min(position[1], bounds[1] - shift)
            else:
                velocity = max(velocity[0], bounds[0]), min(velocity[1], bounds[1])
            coordinates[key] = _Coordinate(names, unit, old.row, old.offset, position, velocity)
    return list(coordinates.values())


def _view(values: Array, bounds: tuple[float, float]) -> tuple[float, float]:
    """Range to show: the motion, and its bounds where they are near."""
    low, high = float(values.min()), float(values.max())
    size = max(high - low, 1e-9)
    ends = [low, high, *(b for b in bounds if np.isfinite(b) and low - _WIDER * size < b < high + _WIDER * size)]
    margin = _BEYOND * max(max(ends) - min(ends), 1e-9)
    return min(ends) - margin, max(ends) + margin


def _forbidden(ax: Axes, c: _Coordinate) -> None:
    """Shade the range beyond the bounds in view."""
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    pieces = (
        (left, c.position[0], bottom, top),
        (c.position[1], right, bottom, top),
        (left, right, bottom, c.velocity[0]),
        (left, right, c.velocity[1], top),
    )
    for x0, x1, y0, y1 in pieces:
        if x1 > x0 and y1 > y0 and np.all(np.isfinite([x0, x1, y0, y1])):
            ax.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, facecolor=FORBIDDEN, edgecolor="none", zorder=0))
    for bound in c.position:
        if left < bound < right:
            ax.axvline(bound, color=VERMILLION, linewidth=0.9)
    for bound in c.velocity:
        if bottom < bound < top:
            ax.axhline(bound, color=VERMILLION, linewidth=0.9)
