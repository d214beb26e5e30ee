"""Runs of a friction plan over time: windows of constant speed, break-away tests on scales of their own, and ramps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from excite.friction.plan.friction_plan import CoordinatePlan, FrictionPlan
from excite.plots.panels import Panel, head, legend_below, panels, value_axis
from excite.plots.style import BLUE, DARK, GREEN, GREY, NOTE, VERMILLION, typeset
from regressors.samples import Array

_HEIGHT, _LEFT, _BETWEEN = 1.5, 0.85, 0.62
_INSTANTS = 4001
_TEST = "#CFEBE2"  # green, light enough to draw on
_THOUSAND = 1e3  # ways of break-away tests are in mrad or mm
_GRAVITY = {
    "none": "no gravity",
    "cancels": "gravity cancels",
    "subtracted": "gravity to be subtracted",
    "stated": "gravity stated to cancel",
}


def friction_plan_figure(plan: FrictionPlan) -> Figure:
    """Draw position and velocity of every coordinate over its runs, its break-away tests, and its torque ramps."""
    columns = [column for column in _COLUMNS if any(column.shows(c) for c in plan.coordinates)]
    panel = Panel(widths=tuple(column.width for column in columns), height=_HEIGHT, left=_LEFT, between=_BETWEEN)
    figure, rows = panels(len(plan.coordinates), panel, f"{plan.robot.name}: runs to measure friction")
    for row, c in zip(rows, plan.coordinates, strict=True):
        for ax, column in zip(row, columns, strict=True):
            if column.shows(c):
                column.draw(ax, c)
            else:
                ax.set_axis_off()
                head(ax, f"{c.label}: no {column.name}")
    for ax in rows[-1]:
        ax.set_xlabel(typeset("time [s]"), fontsize=NOTE, color=DARK)
    legend_below(figure, _legend(columns))
    return figure


def _draw_position(ax: Axes, c: CoordinatePlan) -> None:
    time, s, _ = _motion(c)
    ax.plot(time, s, color=GREY, linewidth=0.7)
    for window in c.windows:
        ax.plot([window.start, window.end], [window.first, window.last], color=BLUE, linewidth=2.0)
    if c.breakaways:
        ax.axvspan(*_span(c), color=_TEST, linewidth=0.0, zorder=0.5)
    value_axis(ax, f"position [{c.unit}]")
    ax.set_xlim(0.0, c.runs.duration)
    head(ax, c.label, _GRAVITY.get(c.gravity, c.gravity))


def _draw_velocity(ax: Axes, c: CoordinatePlan) -> None:
    time, _, ds = _motion(c)
    ax.plot(time, ds, color=GREY, linewidth=0.7)
    for window in c.windows:
        ax.plot([window.start, window.end], [window.speed] * 2, color=BLUE, linewidth=2.0)
        ax.plot(0.5 * (window.start + window.end), window.speed, "o", color=BLUE, markersize=2.5)  # if short
    for sign in (-1.0, 1.0):
        ax.axhline(sign * c.pace.velocity, color=VERMILLION, linewidth=0.9, linestyle="--", zorder=1.5)
    value_axis(ax, f"velocity [{c.unit}/s]")
    ax.set_xlim(0.0, c.runs.duration)
    left_out = ", ".join(f"{each.percent:g}" for each in c.left_out)
    head(ax, c.label, f"left out: {left_out} %" if left_out else "")


def _draw_breakaways(ax: Axes, c: CoordinatePlan) -> None:
    """The way from the pose, in the stretch of the break-away tests alone."""
    begin, end = _span(c)
    time, s, _ = _motion(c)
    inside = (time >= begin) & (time <= end)
    ways = _THOUSAND * (s[inside] - c.centre)
    for part in c.breakaways:
        ax.axvspan(part.begin, _end(part.begin, c), color=_TEST, linewidth=0.0, zorder=0.5)
    ax.plot(time[inside], ways, color=GREEN, linewidth=1.4)
    low, high = float(ways.min()), float(ways.max())
    pad = 0.15 * (high - low) if high > low else 1.0
    ax.set_xlim(begin, end)
    ax.set_ylim(low - pad, high + pad)
    value_axis(ax, f"way [m{c.unit}]")
    count = len(c.breakaways)
    head(ax, f"{c.label}: break-away tests", f"{count} at {_speed(c):.2g} m{c.unit}/s")


def _draw_ramps(ax: Axes, c: CoordinatePlan) -> None:
    assert c.ramps is not None
    ends = [time for ramp in c.ramps.ramps for time in (ramp.start, ramp.start, ramp.end, ramp.end)]
    torques = [torque for ramp in c.ramps.ramps for torque in (0.0, 0.0, ramp.rate * (ramp.end - ramp.start), 0.0)]
    ax.plot([0.0, *ends, c.ramps.duration], [0.0, *torques, 0.0], color=DARK, linewidth=1.2)
    value_axis(ax, f"{'force' if c.ramps.unit == 'N' else 'torque'} [{c.ramps.unit}]")
    ax.set_xlim(0.0, c.ramps.duration)
    head(ax, f"drive {c.ramps.drive}: ramps, in another file", f"to {c.ramps.largest:.3g} {c.ramps.unit}")


@dataclass(frozen=True)
class _Column:
    """Panels of one kind, for the coordinates that have what they show."""

    name: str
    width: float
    shows: Callable[[CoordinatePlan], bool]
    draw: Callable[[Axes, CoordinatePlan], None]


_COLUMNS = (
    _Column("position", 4.2, lambda c: True, _draw_position),
    _Column("velocity", 4.2, lambda c: True, _draw_velocity),
    _Column("break-away tests", 3.6, lambda c: bool(c.breakaways), _draw_breakaways),
    _Column("ramps of torque", 3.6, lambda c: c.ramps is not None, _draw_ramps),
)


def _motion(c: CoordinatePlan) -> tuple[Array, Array, Array]:
    """Instants, position and velocity, with every instant where the motion bends."""
    bends = [part.begin + part.law.breaks for part in c.runs.parts if part.law is not None]
    time = np.unique(np.concatenate([np.linspace(0.0, c.runs.duration, _INSTANTS), *bends]))
    s, ds, *_ = c.runs.values(time)[0]
    return time, s + c.centre, ds


def _speed(c: CoordinatePlan) -> float:
    """Creeping speed of the break-away tests [mrad/s or mm/s]."""
    part = c.breakaways[0]
    begin, end = part.steady()
    return _THOUSAND * float(np.abs(part.values(np.array([0.5 * (begin + end)]))[1, 0]))


def _span(c: CoordinatePlan) -> tuple[float, float]:
    """Beginning of the first break-away test and end of the last one [s]."""
    begins = [part.begin for part in c.breakaways]
    return min(begins), _end(max(begins), c)


def _end(begin: float, c: CoordinatePlan) -> float:
    """End of the part of a coordinate's runs that begins at ``begin`` [s]."""
    later = [part.begin for part in c.runs.parts if part.begin > begin]
    return min(later, default=c.runs.duration)


def _legend(columns: list[_Column]) -> list[Artist]:
    names = [column.name for column in columns]
    tests = "break-away tests" in names
    return [
        Line2D([], [], color=GREY, linewidth=1.0, label="motion"),
        Line2D([], [], color=BLUE, linewidth=2.0, label="window of constant speed"),
        *([Patch(color=_TEST, label="breaking away from rest")] if tests else []),
        *([Line2D([], [], color=GREEN, linewidth=1.4, label="creeping out of the pose and back")] if tests else []),
        *([Line2D([], [], color=DARK, linewidth=1.2, label="torque")] if "ramps of torque" in names else []),
        Line2D([], [], color=VERMILLION, linewidth=1.0, linestyle="--", label="velocity limit"),
    ]
