"""Friction: torque over speed with the fitted curve and its band [KD96] Figs. 2-4, and the runs that measure it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from excite.design.friction_runs.friction_plan import CoordinatePlan, FrictionPlan
from excite.friction.friction_equations import Conditions
from excite.friction.friction_fit import Characteristic
from excite.views.panels import Panel, head, legend_below, panels, value_axis
from excite.views.style import (
    BAND,
    BLUE,
    DARK,
    GREEN,
    GREY,
    LABEL,
    NOTE,
    VERMILLION,
    broken,
    columns_that_fit,
    figure_of,
    padded,
    panel_width,
    plain,
    typeset,
)
from regressors.samples import Array

_COLUMNS = 3
_WIDTH, _HEIGHT = 4.2, 4.4  # of a panel [in]
_LEAST = 1.75  # width of a panel with its numbers [in]
_INSTANTS = 400
_LEVELS = 3
_LINE = 12  # of text above a panel [pt]
_WARMER = 2.0  # [K]
_BREAK_AWAY: dict[str, Any] = {"color": VERMILLION, "marker": "D", "linestyle": "", "markersize": 4}


def friction_figure(robot: str, characteristics: Sequence[Characteristic]) -> Figure:
    """Draw friction torque over speed, one panel per drive."""
    columns = min(columns_that_fit(_COLUMNS, _LEAST), len(characteristics))
    rows = -(-len(characteristics) // columns)
    title = f"{robot}: friction over speed"
    figure = figure_of(_WIDTH * columns + 0.6, _HEIGHT * rows + 0.9, title, text=0.9 * rows + 0.9)
    grid = figure.add_gridspec(2 * rows, columns, height_ratios=[3.0, 1.0] * rows)
    for number, c in enumerate(characteristics):
        row, column = divmod(number, columns)
        ax = figure.add_subplot(grid[2 * row, column])
        _panel(ax, c)
        _left(figure.add_subplot(grid[2 * row + 1, column], sharex=ax), c)
    handles = [
        Line2D([], [], color=DARK, marker="o", linestyle="", markersize=3, label="windows, 99 %"),
        Line2D([], [], color=BLUE, linewidth=1.5, label="fitted curve"),
        Patch(facecolor=BAND, label="its 99 % band"),
    ]
    if any(c.stiction for c in characteristics):
        handles.append(Line2D([], [], **_BREAK_AWAY, label="break-away, mean with 99 %"))
    legend_below(figure, handles)
    return figure


def _panel(ax: Axes, c: Characteristic) -> None:
    v, tau, sigma = (np.array([getattr(p, name) for p in c.points]) for name in ("speed", "torque", "deviation"))
    for speeds in _speeds(c):
        _curve(ax, c, speeds)
    tau = _at_one_load(c) if c.fit is not None and c.fit.form.load else tau
    ax.errorbar(v, tau, 2.576 * sigma, fmt="none", ecolor=GREY, elinewidth=0.7, zorder=2)
    temperatures = _temperatures(c)
    if np.ptp(temperatures) >= _WARMER:
        colours = ax.scatter(v, tau, 9, c=temperatures, cmap="viridis", zorder=3)
        bar = ax.figure.colorbar(colours, ax=ax, pad=0.02)
        bar.set_label("temperature [\N{DEGREE SIGN}C]", fontsize=NOTE)
    else:
        ax.plot(v, tau, "o", color=DARK, markersize=2.5, zorder=3)
    for mean in c.means:
        ax.errorbar(0.0, mean.torque, mean.interval99, capsize=3, linewidth=0.9, zorder=4, **_BREAK_AWAY)
    ax.axhline(0.0, color=GREY, linewidth=0.6)
    ax.axvline(0.0, color=GREY, linewidth=0.6)
    lines = broken("\n".join(_caption_lines(c)), panel_width(ax)).split("\n")
    ax.set_title(plain(c.drive), loc="left", fontsize=LABEL, fontweight="bold", color=DARK, pad=6 + _LINE * len(lines))
    label = ax.annotate(
        plain("\n".join(lines)), (0.0, 1.0), (0.0, 5.0), "axes fraction", "offset points", fontsize=NOTE, color=DARK
    )  # fmt: skip
    label.set_in_layout(False)  # it may be wider than its panel
    ax.set_ylabel(typeset(f"friction [{c.unit}]"), fontsize=NOTE, color=DARK)
    ax.tick_params(labelbottom=False)


def _caption_lines(c: Characteristic) -> list[str]:
    """The equation, its further dependences, and the load at which it is drawn."""
    if c.fit is None:
        return ["table"]
    equation, _, linear = c.fit.form.name.partition(", ")
    drawn = f", at {_load(c):.3g} {c.unit}" if c.fit.form.load else ""
    return [equation, linear + drawn] if linear else [equation]


def _at_one_load(c: Characteristic) -> Array:
    """Torques of the points, corrected to the load at which the curve is drawn."""
    assert c.fit is not None
    v = np.array([p.speed for p in c.points])
    reference = c.fit.form.temperature
    rise = [0.0 if reference is None or p.temperature is None else p.temperature - reference for p in c.points]
    at = Conditions(v, np.copysign(1.0, v), np.array(rise), np.full_like(v, _load(c)))
    return np.asarray(c.fit.form.values(c.fit.values, at)[0] + c.fit.residuals(c.points))


def _left(ax: Axes, c: Characteristic) -> None:
    """Draw the residuals of the windows, and the band, which is too narrow to be visible in the full panel."""
    v, tau, sigma = (np.array([getattr(p, name) for p in c.points]) for name in ("speed", "torque", "deviation"))
    off = tau - c.curve.torque(v) if c.fit is None else c.fit.residuals(c.points)
    for speeds in _speeds(c):
        if c.fit is not None:
            _, half = c.fit.band(speeds, load=_load(c))
            ax.fill_between(speeds, -half, half, color=BAND, linewidth=0.0, zorder=1)
    ax.axhline(0.0, color=BLUE, linewidth=1.0)
    ax.errorbar(v, off, 2.576 * sigma, fmt="o", color=DARK, markersize=2.0, ecolor=GREY, elinewidth=0.7, zorder=3)
    ax.set_xlabel(typeset("speed [rad/s]" if c.unit == "Nm" else "speed [m/s]"), fontsize=NOTE, color=DARK)
    ax.set_ylabel(typeset(f"deviation [{c.unit}]"), fontsize=NOTE, color=DARK)


def _speeds(c: Characteristic) -> Iterator[Array]:
    """Speeds of each direction that has points, from the slowest to the fastest."""
    for sign in (1.0, -1.0):
        if speeds := [abs(p.speed) for p in c.points if p.speed * sign > 0]:
            yield sign * np.linspace(0.0 if c.rests else min(speeds), max(speeds), _INSTANTS)


def _curve(ax: Axes, c: Characteristic, v: Array) -> None:
    if c.fit is None:
        ax.plot(v, c.curve.torque(v), color=BLUE, linewidth=1.5)
        return
    f, half = c.fit.band(v, load=_load(c))
    ax.fill_between(v, f - half, f + half, color=BAND, linewidth=0.0, zorder=1)
    ax.plot(v, f, color=BLUE, linewidth=1.5, zorder=2)
    known = _temperatures(c)
    if c.fit.form.temperature is None or not np.all(np.isfinite(known)):
        return
    colours = ScalarMappable(Normalize(known.min(), known.max()), "viridis")
    for level in np.linspace(known.min(), known.max(), _LEVELS):
        warm, _ = c.fit.band(v, level - c.fit.form.temperature, _load(c))
        ax.plot(v, warm, color=colours.to_rgba(level), linewidth=0.9, linestyle="--", zorder=2)


def _load(c: Characteristic) -> float:
    """Load of the drive in the median window."""
    return float(np.median([0.0 if p.load is None else p.load for p in c.points]))


def _temperatures(c: Characteristic) -> Array:
    return np.array([np.nan if p.temperature is None else p.temperature for p in c.points])


_RUN_HEIGHT, _LEFT, _BETWEEN = 1.5, 0.85, 0.62
_RUN_INSTANTS = 4001
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
    columns = [kind for kind in _KINDS if any(kind[2](c) for c in plan.coordinates)]
    panel = Panel(widths=tuple(width for _, width, *_ in columns), height=_RUN_HEIGHT, left=_LEFT, between=_BETWEEN)
    figure, rows = panels(len(plan.coordinates), panel, f"{plan.robot.name}: runs to measure friction")
    for row, c in zip(rows, plan.coordinates, strict=True):
        for ax, (name, _, shows, draw) in zip(row, columns, strict=True):
            if shows(c):
                draw(ax, c)
            else:
                ax.set_axis_off()
                head(ax, f"{c.label}: no {name}")
    for ax in rows[-1]:
        ax.set_xlabel(typeset("time [s]"), fontsize=NOTE, color=DARK)
    tests, ramps = (any(name == shown for name, *_ in columns) for shown in ("break-away tests", "ramps of torque"))
    meanings: list[Artist] = [
        Line2D([], [], color=GREY, linewidth=1.0, label="motion"),
        Line2D([], [], color=BLUE, linewidth=2.0, label="window of constant speed"),
        *([Patch(color=_TEST, label="breaking away from rest")] if tests else []),
        *([Line2D([], [], color=GREEN, linewidth=1.4, label="creeping out of the pose and back")] if tests else []),
        *([Line2D([], [], color=DARK, linewidth=1.2, label="torque")] if ramps else []),
        Line2D([], [], color=VERMILLION, linewidth=1.0, linestyle="--", label="velocity limit"),
    ]
    legend_below(figure, meanings)
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
    ax.set_xlim(begin, end)
    ax.set_ylim(*padded(float(ways.min()), float(ways.max()), 0.15))
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


# name and width of each column of panels [in], for which coordinates it is, and how it is drawn
_KINDS: tuple[tuple[str, float, Callable[[CoordinatePlan], bool], Callable[[Axes, CoordinatePlan], None]], ...] = (
    ("position", 4.2, lambda c: True, _draw_position),
    ("velocity", 4.2, lambda c: True, _draw_velocity),
    ("break-away tests", 3.6, lambda c: bool(c.breakaways), _draw_breakaways),
    ("ramps of torque", 3.6, lambda c: c.ramps is not None, _draw_ramps),
)


def _motion(c: CoordinatePlan) -> tuple[Array, Array, Array]:
    """Instants, position and velocity, with every instant where the motion bends."""
    bends = [part.begin + part.law.breaks for part in c.runs.parts if part.law is not None]
    time = np.unique(np.concatenate([np.linspace(0.0, c.runs.duration, _RUN_INSTANTS), *bends]))
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
