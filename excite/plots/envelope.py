"""Many values over time as bands of their extremes and percentiles, where a curve would be a solid block."""

from __future__ import annotations

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from excite.plots.style import DARK, SKY
from excite.plots.timeline import Timeline
from regressors.samples import Array, Index

BINS = 400  # at most, over all logs
DENSE = 1600  # values of all logs from which on they are drawn as bands
_FULL = 25  # values in a bin
PERCENTILES = (0.0, 5.0, 50.0, 95.0, 100.0)
_WIDTH = 0.8  # [pt]
_ALL = "#D9D9D9"


def envelope(values: Array, bins: int) -> tuple[Index, Array]:
    """Least value, 5th, 50th and 95th percentile and largest value of each of ``bins`` stretches."""
    # values (N,); result (bins + 1,); result (5, bins)
    edges = np.linspace(0, values.size, bins + 1).astype(np.intp)
    parts = [part[np.isfinite(part)] for part in np.split(values, edges[1:-1])]
    unknown = np.full(len(PERCENTILES), np.nan)
    return edges, np.array([np.percentile(part, PERCENTILES) if part.size else unknown for part in parts]).T


def draw_values(ax: Axes, timeline: Timeline, time: Array, log: Index, values: Array) -> None:
    """Draw values of several logs: curves, or bands where a log has many."""  # time, values (m,); log (m,)
    if values.size < DENSE:
        ax.plot(*timeline.curve(time, log, values), color=DARK, linewidth=_WIDTH)
        return
    for k in range(len(timeline.names)):
        t, v = time[log == k] + timeline.offsets[k], values[log == k]
        if not v.size:
            continue
        edges, bands = envelope(v, max(1, min(round(BINS * v.size / values.size), v.size // _FULL)))
        places = np.repeat(np.append(t[edges[:-1]], t[-1]), 2)[1:-1]
        low, lower, middle, upper, high = np.repeat(bands, 2, axis=1)
        ax.fill_between(places, low, high, color=_ALL, linewidth=0.0)
        ax.fill_between(places, lower, upper, color=SKY, linewidth=0.0)
        ax.plot(places, middle, color=DARK, linewidth=_WIDTH)


def values_legend(count: int, name: str) -> list[Artist]:
    """Entries of a legend for what `draw_values` draws."""
    if count < DENSE:
        return [Line2D([], [], color=DARK, linewidth=_WIDTH, label=name)]
    return [
        Line2D([], [], color=DARK, linewidth=_WIDTH, label=f"median of the {name}s"),
        Patch(color=SKY, label=f"90 % of the {name}s"),
        Patch(color=_ALL, label="all of them"),
    ]
