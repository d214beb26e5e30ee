"""Figure of the study of separate friction, as Fig. 5 of [KD96]: the first joint's mass parameter over time."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from excite.views.style import BLUE, DARK, GREY, LABEL, NOTE, VERMILLION, drawing_style, figure_of
from regressors.samples import Array

COLUMNS = (("energy, 5 ms", "energy model, windows of 5 ms"), ("differential", "differential model"))
#: Motion, what it is, how long it is shown [s], and how far about the truth [kg m^2].
ROWS = (
    ("z1", "drive 1 alone, splined polynomials", 4.0, 1.2),
    ("designed", "all three joints, designed motion", 10.0, 4.0),
)
WAYS = (("all at once", "friction identified all at once", VERMILLION), ("separate", "friction measured before", BLUE))


@drawing_style("screen")
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
    drawing = figure_of(
        10.0, 6.6, "First joint's mass parameter over time: friction measured before, or identified with it"
    )
    panels = drawing.subplots(len(ROWS), len(COLUMNS), sharex="row", sharey="row")
    for row, (motion, said, length, shown) in zip(panels, ROWS, strict=True):
        for ax, (model, name) in zip(row, COLUMNS, strict=True):
            _panel(ax, time, {way: np.array(drawn[motion, model, way]) for way, _, _ in WAYS}, true)
            ax.set_xlim(0.0, length)
            ax.set_ylim(true - shown, true + shown)
            ax.set_xlabel("time [s]", fontsize=LABEL, color=DARK)
            ax.set_title(f"{name}; {said}", loc="left", fontsize=LABEL, color=DARK)
        row[0].set_ylabel("X1 [kg m²]", fontsize=LABEL, color=DARK)
    panels[0][0].fill_between([], [], color=GREY, alpha=0.3, linewidth=0, label="middle 90 % of the repetitions")
    panels[0][0].legend(loc="lower right", fontsize=NOTE)
    return drawing


def _panel(ax: Axes, time: Array, paths: dict[str, Array], true: float) -> None:
    for way, label, colour in WAYS:
        seen = np.isfinite(paths[way]).all(axis=0)
        low, high = np.percentile(paths[way][:, seen], (5, 95), axis=0)
        ax.fill_between(time[seen], low, high, color=colour, alpha=0.2, linewidth=0)
        ax.plot(time[seen], paths[way][0, seen], color=colour, linewidth=1.2, label=label)
    ax.axhline(true, color=DARK, linewidth=0.9, linestyle="--", label="true")
