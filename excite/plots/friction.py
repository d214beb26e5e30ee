"""Friction torque over speed: what each window says, the fitted curve and its band [KD96] Figs. 2-4."""

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

from excite.friction.characteristics import Characteristic
from excite.plots.style import BAND, BLUE, DARK, GREY, LABEL, NOTE, VERMILLION, figure_of, plain, tidy, typeset
from excite.plots.writing import written
from regressors.samples import Array

_COLUMNS = 3
_WIDTH, _HEIGHT = 4.2, 3.6  # of a panel [in]
_INSTANTS = 400
_LEVELS = 3


def friction_figure(robot: str, found: Sequence[Characteristic]) -> Figure:
    """One panel per drive.

    Parameters
    ----------
    robot : str
        Its name.
    found : sequence of Characteristic
    """
    columns = min(_COLUMNS, len(found))
    rows = -(-len(found) // columns)
    figure = figure_of(_WIDTH * columns + 0.6, _HEIGHT * rows + 0.9, f"{robot}: friction over speed")
    for number, one in enumerate(found, 1):
        _panel(figure.add_subplot(rows, columns, number), one)
    handles = [
        Line2D([], [], color=DARK, marker="o", linestyle="", markersize=3, label="windows, 99 %"),
        Line2D([], [], color=BLUE, linewidth=1.5, label="fitted curve"),
        Patch(facecolor=BAND, label="its 99 % band"),
    ]
    if any(one.stiction for one in found):
        handles.append(Line2D([], [], color=VERMILLION, marker="D", linestyle="", markersize=4, label="break-away"))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=LABEL, frameon=False)
    return figure


def _panel(ax: Axes, one: Characteristic) -> None:
    v, tau, sigma = (np.array([getattr(p, name) for p in one.points]) for name in ("speed", "torque", "deviation"))
    for side in (v[v > 0], v[v < 0]):
        if side.size:
            _curve(ax, one, np.linspace(side.min(), side.max(), _INSTANTS))
    warm = one.fit is not None and one.fit.form.temperature is not None
    ax.errorbar(v, tau, 2.576 * sigma, fmt="none", ecolor=GREY, elinewidth=0.7, zorder=2)
    if warm:
        colours = ax.scatter(v, tau, 9, c=_temperatures(one), cmap="viridis", zorder=3)
        bar = ax.figure.colorbar(colours, ax=ax, pad=0.02)
        bar.set_label("temperature [\N{DEGREE SIGN}C]", fontsize=NOTE)
        bar.ax.tick_params(labelsize=NOTE)
    else:
        ax.plot(v, tau, "o", color=DARK, markersize=2.5, zorder=3)
    for rest in one.stiction:
        ax.plot(0.0, rest.torque, "D", color=VERMILLION, markersize=4, zorder=4)
    ax.axhline(0.0, color=GREY, linewidth=0.6)
    ax.axvline(0.0, color=GREY, linewidth=0.6)
    name = "table" if one.fit is None else one.fit.form.name
    ax.set_title(plain(one.drive), loc="left", fontsize=LABEL, fontweight="bold", color=DARK)
    ax.set_title(plain(name), loc="right", fontsize=NOTE, color=DARK)
    ax.set_xlabel(typeset("speed [rad/s]" if one.unit == "Nm" else "speed [m/s]"), fontsize=NOTE, color=DARK)
    ax.set_ylabel(typeset(f"friction [{one.unit}]"), fontsize=NOTE, color=DARK)
    tidy(ax)


def _curve(ax: Axes, one: Characteristic, v: Array) -> None:
    if one.fit is None:
        ax.plot(v, one.curve.torque(v), color=BLUE, linewidth=1.5)
        return
    f, half = one.fit.band(v)
    ax.fill_between(v, f - half, f + half, color=BAND, linewidth=0.0, zorder=1)
    ax.plot(v, f, color=BLUE, linewidth=1.5, zorder=2)
    if one.fit.form.temperature is None:
        return
    known = _temperatures(one)
    colours = ScalarMappable(Normalize(known.min(), known.max()), "viridis")
    for level in np.linspace(known.min(), known.max(), _LEVELS):
        warm, _ = one.fit.band(v, level - one.fit.form.temperature)
        ax.plot(v, warm, color=colours.to_rgba(level), linewidth=0.9, linestyle="--", zorder=2)


def _temperatures(one: Characteristic) -> Array:
    return np.array([np.nan if p.temperature is None else p.temperature for p in one.points])


def write_friction_figure(robot: str, found: Sequence[Characteristic], folder: str | Path) -> list[Path]:
    """Write the figure as ``friction.png``.

    Parameters
    ----------
    robot : str
    found : sequence of Characteristic
    folder : path
    """
    return written({"friction": friction_figure(robot, found)}, folder)
