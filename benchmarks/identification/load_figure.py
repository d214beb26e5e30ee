"""Figure of study 2: bias and coverage when the measured motion is noisy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from excite.views.panels import Panel, head, legend_below, panels
from excite.views.style import BAND, BLUE, DARK, GREEN, NOTE, ORANGE, PURPLE, SKY, VERMILLION, typeset

LEVEL = "1e-4 rad"
#: Way, estimator, and how the pair is drawn.
SHOWN = (
    ("differences, 4 ms", "least-squares", "4 ms, least squares", VERMILLION, "o"),
    ("differences, 4 ms", "instrumental", "4 ms, instruments", BLUE, "s"),
    ("differences, 4 ms, both sides filtered", "weighted", "4 ms, both sides filtered", GREEN, "^"),
    ("Butterworth, 4 ms", "weighted", "Butterworth", ORANGE, "v"),
    ("Fourier fit, 4 ms", "weighted", "Fourier fit", PURPLE, "D"),
    ("differences, 32 ms", "weighted", "32 ms", SKY, "P"),
)
_TICKS = (-30, -10, -3, -1, 0, 1, 3, 10, 30)
_SHARES = (0, 1, 2, 5, 10, 20, 50, 100)
_MOTIONS = ("paper's", "designed")


def figure(content: dict[str, Any]) -> Figure:
    """Bias in parts of the spread, and misses of the intervals, of every parameter, for both motions."""
    made, axes = panels(
        2, Panel((5.2, 5.2), 2.6), f"Positions noisy by {LEVEL}: what repairs the bias of least squares"
    )
    for column, motion in enumerate(_MOTIONS):
        runs = {
            (run["way"], run["estimator"]): run
            for run in content["noisy_motion"]
            if run["motion"] == motion and run["position_noise"] == LEVEL
        }
        top, bottom = axes[0][column], axes[1][column]
        head(top, f"{motion} motion", "bias, in standard deviations of the estimate")
        head(bottom, f"{motion} motion", "how often the 99 % interval misses the truth; wanted: 1 %")
        _bias(top, runs, content["names"])
        _misses(bottom, runs, content["names"])
    axes[0][0].set_ylabel("bias / spread", fontsize=NOTE, color=DARK)
    axes[1][0].set_ylabel("missed [%]", fontsize=NOTE, color=DARK)
    legend_below(
        made,
        [Line2D([], [], color=colour, marker=mark, linestyle="", label=label) for *_, label, colour, mark in SHOWN],
    )
    return made


def _bias(ax: Axes, runs: dict[tuple[str, str], Any], names: list[str]) -> None:
    ax.axhspan(-0.1, 0.1, color=BAND, linewidth=0)
    _points(ax, names, {key: np.divide(run["bias"], run["deviation"]) for key, run in runs.items()})
    _scale(ax, 0.3, _TICKS, (-60, 60))


def _misses(ax: Axes, runs: dict[tuple[str, str], Any], names: list[str]) -> None:
    ax.axhspan(0, 2, color=BAND, linewidth=0)
    _points(ax, names, {key: 100 - 100 * np.array(run["coverage"]) for key, run in runs.items()})
    _scale(ax, 2.0, _SHARES, (-0.4, 150))


def _scale(ax: Axes, linear: float, ticks: Sequence[int], ends: tuple[float, float]) -> None:
    """Linear up to some value, logarithmic above."""
    ax.set_yscale("symlog", linthresh=linear)
    ax.yaxis.set_minor_locator(NullLocator())
    ax.set_yticks(ticks, [typeset(f"{tick}") for tick in ticks])
    ax.set_ylim(*ends)


def _points(ax: Axes, names: list[str], values: dict[tuple[str, str], Any]) -> None:
    place = np.arange(len(names))
    for k, (way, estimator, label, colour, mark) in enumerate(SHOWN):
        if (way, estimator) in values:
            shift = 0.12 * (k - 0.5 * (len(SHOWN) - 1))
            ax.plot(place + shift, values[way, estimator], mark, color=colour, markersize=4.5, label=label)
    ax.set_xticks(place, names)
    ax.set_xlim(-0.5, len(names) - 0.5)
