"""Figure of the study of separate friction, as Fig. 5 of [KD96]: the first joint's mass parameter over time."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from excite.plots.style import BLUE, DARK, LABEL, NOTE, VERMILLION, figure_of, tidy
from regressors.samples import Array

COLUMNS = (("energy, 5 ms", "energy model, windows of 5 ms"), ("differential", "differential model"))
ROWS = (("z1", "drive 1 alone, splined polynomials"), ("designed", "all three joints, designed motion"))
WAYS = (("all at once", "friction identified all at once", VERMILLION), ("separate", "friction measured before", BLUE))
SHOWN = 1.2  # kg m^2 above and below the truth


def figure(time: Array, drawn: dict[tuple[str, str, str], list[Array]], true: float) -> Figure:
    """Recursive estimates of X1: one repetition as a line, the middle 90 % of all as a band.

    Parameters
    ----------
    time : ndarray, shape (k,)
        [s]
    drawn : dict
        Estimates over time of every repetition, by motion, model and way.
    true : float
        [kg m^2]
    """
    drawing = figure_of(10.0, 6.6, "Mass parameter of the first joint over time, [KD96] eq. (17), (18)")
    panels = drawing.subplots(len(ROWS), len(COLUMNS), sharex=True, sharey=True)
    for row, (motion, said) in zip(panels, ROWS, strict=True):
        for ax, (model, name) in zip(row, COLUMNS, strict=True):
            _panel(ax, time, {way: np.array(drawn[motion, model, way]) for way, _, _ in WAYS}, true)
            ax.set_title(f"{name}; {said}", loc="left", fontsize=LABEL, color=DARK)
        row[0].set_ylabel("X1 [kg m²]", fontsize=LABEL, color=DARK)
    for ax in panels[-1]:
        ax.set_xlabel("time [s]", fontsize=LABEL, color=DARK)
    panels[0][0].legend(loc="lower right", fontsize=NOTE)
    return drawing


def _panel(ax: Axes, time: Array, paths: dict[str, Array], true: float) -> None:
    tidy(ax)
    for way, label, colour in WAYS:
        seen = np.isfinite(paths[way]).all(axis=0)
        low, high = np.percentile(paths[way][:, seen], (5, 95), axis=0)
        ax.fill_between(time[seen], low, high, color=colour, alpha=0.2, linewidth=0)
        ax.plot(time[seen], paths[way][0, seen], color=colour, linewidth=1.2, label=label)
    ax.axhline(true, color=DARK, linewidth=0.9, linestyle="--", label="true")
    ax.set_ylim(true - SHOWN, true + SHOWN)
    ax.set_xlim(0.0, time[-1])
