"""Friction torque over speed: points of the windows, the fitted curve and its band [KD96] Figs. 2-4."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from excite.friction.fit.breakaway_torque import mean_break_aways
from excite.friction.fit.characteristics import Characteristic
from excite.friction.fit.friction_equations import Conditions
from excite.plots.figure_files import write_figure_files
from excite.plots.panels import legend_below
from excite.plots.style import (
    BAND,
    BLUE,
    DARK,
    GREY,
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

_COLUMNS = 3
_WIDTH, _HEIGHT = 4.2, 4.4  # of a panel [in]
_LEAST = 1.75  # width of a panel with its numbers [in]
_INSTANTS = 400
_LEVELS = 3
_LINE = 12  # of text above a panel [pt]
_WARMER = 2.0  # [K]


def friction_figure(robot: str, characteristics: Sequence[Characteristic]) -> Figure:
    """Draw friction torque over speed, one panel per drive."""
    columns = min(columns_that_fit(_COLUMNS, _LEAST), len(characteristics))
    rows = -(-len(characteristics) // columns)
    title = f"{robot}: friction over speed"
    figure = figure_of(_WIDTH * columns + 0.6, _HEIGHT * rows + 0.9, title, text=0.9 * rows + 0.9)
    grid = figure.add_gridspec(2 * rows, columns, height_ratios=[3.0, 1.0] * rows)
    for number, characteristic in enumerate(characteristics):
        row, column = divmod(number, columns)
        ax = figure.add_subplot(grid[2 * row, column])
        _panel(ax, characteristic)
        _left(figure.add_subplot(grid[2 * row + 1, column], sharex=ax), characteristic)
    handles = [
        Line2D([], [], color=DARK, marker="o", linestyle="", markersize=3, label="windows, 99 %"),
        Line2D([], [], color=BLUE, linewidth=1.5, label="fitted curve"),
        Patch(facecolor=BAND, label="its 99 % band"),
    ]
    if any(characteristic.stiction for characteristic in characteristics):
        handles.append(
            Line2D([], [], color=VERMILLION, marker="D", linestyle="", markersize=4, label="break-away, mean with 99 %")
        )
    legend_below(figure, handles)
    return figure


def _panel(ax: Axes, characteristic: Characteristic) -> None:
    v, tau, sigma = (
        np.array([getattr(p, name) for p in characteristic.points]) for name in ("speed", "torque", "deviation")
    )
    for sign in (1.0, -1.0):
        speeds = _speeds(characteristic, sign)
        if speeds.size:
            _curve(ax, characteristic, np.copysign(speeds, sign))
    tau = _at_one_load(characteristic) if characteristic.fit is not None and characteristic.fit.form.load else tau
    ax.errorbar(v, tau, 2.576 * sigma, fmt="none", ecolor=GREY, elinewidth=0.7, zorder=2)
    temperatures = _temperatures(characteristic)
    if np.ptp(temperatures) >= _WARMER:
        colours = ax.scatter(v, tau, 9, c=temperatures, cmap="viridis", zorder=3)
        bar = ax.figure.colorbar(colours, ax=ax, pad=0.02)
        bar.set_label("temperature [\N{DEGREE SIGN}C]", fontsize=NOTE)
        bar.ax.tick_params(labelsize=NOTE)
    else:
        ax.plot(v, tau, "o", color=DARK, markersize=2.5, zorder=3)
    for mean in mean_break_aways(characteristic.break_aways):
        ax.errorbar(
            0.0,
            mean.torque,
            mean.interval99,
            fmt="D",
            color=VERMILLION,
            markersize=4,
            capsize=3,
            linewidth=0.9,
            zorder=4,
        )
    ax.axhline(0.0, color=GREY, linewidth=0.6)
    ax.axvline(0.0, color=GREY, linewidth=0.6)
    lines = broken("\n".join(_caption_lines(characteristic)), panel_width(ax)).split("\n")
    ax.set_title(
        plain(characteristic.drive),
        loc="left",
        fontsize=LABEL,
        fontweight="bold",
        color=DARK,
        pad=6 + _LINE * len(lines),
    )
    label = ax.annotate(
        plain("\n".join(lines)), (0.0, 1.0), (0.0, 5.0), "axes fraction", "offset points", fontsize=NOTE, color=DARK
    )  # fmt: skip
    label.set_in_layout(False)  # it may be wider than its panel
    ax.set_ylabel(typeset(f"friction [{characteristic.unit}]"), fontsize=NOTE, color=DARK)
    ax.tick_params(labelbottom=False)
    tidy(ax)


def _caption_lines(characteristic: Characteristic) -> list[str]:
    """The equation, its further dependences, and the load at which it is drawn."""
    if characteristic.fit is None:
        return ["table"]
    equation, _, linear = characteristic.fit.form.name.partition(", ")
    drawn = f", at {_load(characteristic):.3g} {characteristic.unit}" if characteristic.fit.form.load else ""
    return [equation, linear + drawn] if linear else [equation]


def _at_one_load(characteristic: Characteristic) -> Array:
    """Torques of the points, corrected to the load at which the curve is drawn."""
    assert characteristic.fit is not None
    v = np.array([p.speed for p in characteristic.points])
    reference = characteristic.fit.form.temperature
    temperature_rise = [
        0.0 if reference is None or p.temperature is None else p.temperature - reference for p in characteristic.points
    ]
    at = Conditions(v, np.copysign(1.0, v), np.array(temperature_rise), np.full_like(v, _load(characteristic)))
    return np.asarray(
        characteristic.fit.form.values(characteristic.fit.values, at)[0]
        + characteristic.fit.residuals(characteristic.points)
    )


def _left(ax: Axes, characteristic: Characteristic) -> None:
    """Draw the residuals of the windows, and the band, which is too narrow to be visible in the full panel."""
    v, tau, sigma = (
        np.array([getattr(p, name) for p in characteristic.points]) for name in ("speed", "torque", "deviation")
    )
    off = (
        tau - characteristic.curve.torque(v)
        if characteristic.fit is None
        else characteristic.fit.residuals(characteristic.points)
    )
    for sign in (1.0, -1.0):
        speeds = np.copysign(_speeds(characteristic, sign), sign)
        if characteristic.fit is not None and speeds.size:
            _, half = characteristic.fit.band(speeds, load=_load(characteristic))
            ax.fill_between(speeds, -half, half, color=BAND, linewidth=0.0, zorder=1)
    ax.axhline(0.0, color=BLUE, linewidth=1.0)
    ax.errorbar(v, off, 2.576 * sigma, fmt="o", color=DARK, markersize=2.0, ecolor=GREY, elinewidth=0.7, zorder=3)
    ax.set_xlabel(typeset("speed [rad/s]" if characteristic.unit == "Nm" else "speed [m/s]"), fontsize=NOTE, color=DARK)
    ax.set_ylabel(typeset(f"deviation [{characteristic.unit}]"), fontsize=NOTE, color=DARK)
    tidy(ax)


def _speeds(characteristic: Characteristic, sign: float) -> Array:
    """Speeds of one direction from the slowest point to the fastest; none where there are no points."""
    speeds = [abs(p.speed) for p in characteristic.points if p.speed * sign > 0]
    if not speeds:
        return np.zeros(0)
    return np.linspace(0.0 if characteristic.rests else min(speeds), max(speeds), _INSTANTS)


def _curve(ax: Axes, characteristic: Characteristic, v: Array) -> None:
    if characteristic.fit is None:
        ax.plot(v, characteristic.curve.torque(v), color=BLUE, linewidth=1.5)
        return
    f, half = characteristic.fit.band(v, load=_load(characteristic))
    ax.fill_between(v, f - half, f + half, color=BAND, linewidth=0.0, zorder=1)
    ax.plot(v, f, color=BLUE, linewidth=1.5, zorder=2)
    if characteristic.fit.form.temperature is None or not np.all(np.isfinite(_temperatures(characteristic))):
        return
    known = _temperatures(characteristic)
    colours = ScalarMappable(Normalize(known.min(), known.max()), "viridis")
    for level in np.linspace(known.min(), known.max(), _LEVELS):
        warm, _ = characteristic.fit.band(v, level - characteristic.fit.form.temperature, _load(characteristic))
        ax.plot(v, warm, color=colours.to_rgba(level), linewidth=0.9, linestyle="--", zorder=2)


def _load(characteristic: Characteristic) -> float:
    """Load of the drive in the median window."""
    return float(np.median([0.0 if p.load is None else p.load for p in characteristic.points]))


def _temperatures(characteristic: Characteristic) -> Array:
    return np.array([np.nan if p.temperature is None else p.temperature for p in characteristic.points])


def write_friction_figure(
    robot: str,
    characteristics: Sequence[Characteristic],
    folder: str | Path,
    *,
    formats: str | Sequence[str] = ("png",),
    width: str = "screen",
) -> list[Path]:
    """Write the figure as ``friction.png``."""
    return write_figure_files(
        lambda: {"friction": friction_figure(robot, characteristics)},
        folder,
        "friction-fit",
        formats=formats,
        width=width,
    )
