"""Several logs in sequence on one axis, each with its own time; long ones are drawn by their extremes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedFormatter, FixedLocator, MaxNLocator

from excite.plots.style import DARK, LABEL, NOTE, ROUND, panel_width, plain
from regressors.samples import Array, Index

BINS = 1500  # minima and maxima per curve: about one per pixel
_GAP = 0.02  # between two logs, of the time of all
_BETWEEN_LOGS = "#EDEDED"
_TICKS, _NUMBERS = 12, 2.7  # numbers on the whole axis, and at most per inch
_LETTERS = 10.5  # per inch, of the logs' names side by side
_NAMES_BELOW, _LABEL_BELOW = -18, -32  # [pt]


def extremes(values: Array, bins: int = BINS) -> Index:
    """Indices of the lowest and the highest value in each of ``bins`` stretches, and of both ends, in order."""
    # values (N,)
    if values.size <= 2 * bins:
        return np.arange(values.size)
    edges = np.linspace(0, values.size, bins + 1).astype(int)
    kept = [0, values.size - 1]
    for first, part in zip(edges, np.split(values, edges[1:-1]), strict=False):
        kept += [first + int(np.argmin(part)), first + int(np.argmax(part))]
    return np.unique(kept)


@dataclass(frozen=True, eq=False)
class Timeline:
    """Place of every log on the axis."""

    names: tuple[str, ...]  # empty ones are not written
    first: Array  # (logs,) first and last instant of each log's own time [s]
    last: Array  # (logs,)
    offsets: Array  # (logs,) place on the axis minus the log's own time [s]

    @classmethod
    def of(cls, names: Sequence[str], time: Array, log: Index) -> Timeline:
        """Build the timeline of rows."""  # time (m,); log (m,)
        own = [time[log == k] for k in range(len(names))]
        first, last = (np.array([pick(t) for t in own]) for pick in (np.min, np.max))
        last = np.where(last > first, last, first + 1.0)  # a log of one instant needs some room too
        gap = _GAP * float(np.sum(last - first))
        begins = np.concatenate([[0.0], np.cumsum(last - first + gap)[:-1]])
        shown = tuple(PurePath(name).stem for name in names)
        return cls(shown, first, last, begins + first[0] - first)

    def curve(self, time: Array, log: Index, values: Array) -> tuple[Array, Array]:
        """Places and values to draw, a gap after each log."""  # time, values (m,); log (m,)
        places, drawn = [], []
        for k in range(len(self.names)):
            t, v = time[log == k], values[log == k]
            kept = extremes(v)
            places += [t[kept] + self.offsets[k], [self.last[k] + self.offsets[k]]]
            drawn += [v[kept], [np.nan]]
        return np.concatenate(places[:-1]), np.concatenate(drawn[:-1])

    def dress(self, ax: Axes, *, bottom: bool, numbers: int = _TICKS) -> None:
        """Label an axis with the logs' own times and bands between them; at the bottom, with their names too."""
        begin, end = self.first + self.offsets, self.last + self.offsets
        ax.set_xlim(begin[0], end[-1])
        for a, b in zip(end[:-1], begin[1:], strict=True):
            ax.axvspan(a, b, color=_BETWEEN_LOGS, linewidth=0, zorder=2.5)
        ticks, labels = self._ticks(min(numbers, int(_NUMBERS * panel_width(ax))))
        ax.xaxis.set_major_locator(FixedLocator(ticks))
        ax.xaxis.set_major_formatter(FixedFormatter(labels if bottom else [""] * len(labels)))
        if bottom:
            self._name(ax, 0.5 * (begin + end))

    def _ticks(self, numbers: int) -> tuple[list[float], list[str]]:
        """Places of round times, and the times."""
        share = (self.last - self.first) / np.sum(self.last - self.first)
        places, labels = [], []
        for k, part in enumerate(share):
            locator = MaxNLocator(max(1, round(numbers * float(part))), steps=ROUND)
            own = np.array(locator.tick_values(self.first[k], self.last[k]))
            room = 0.02 * (self.last[k] - self.first[k]) if k else 0.0  # the number before it is close
            own = own[(own >= self.first[k] + room) & (own <= self.last[k])]
            places += [float(t) for t in own + self.offsets[k]]
            labels += [f"{t:g}" for t in own]
        return places, labels

    def _name(self, ax: Axes, middles: Array) -> None:
        letters = _LETTERS * panel_width(ax)
        if len(self.names) == 1 or not any(self.names):
            where = "in each log " if len(self.names) > 1 else ""
            where = f"in {plain(ends(self.names[0], int(letters)))} " if self.names[0] else where
            ax.set_xlabel(f"time {where}[s]", fontsize=LABEL, color=DARK)
            return
        style: dict[str, Any] = {"ha": "center", "va": "top", "textcoords": "offset points", "color": DARK}
        share = (self.last - self.first) / np.sum(self.last - self.first)
        for name, middle, part in zip(self.names, middles, share, strict=True):
            text, where_to = plain(ends(name, max(3, int(letters * part)))), ("data", "axes fraction")
            ax.annotate(text, (middle, 0.0), (0, _NAMES_BELOW), xycoords=where_to, fontsize=NOTE, **style)
        text = "time in each log [s]"
        ax.annotate(text, (0.5, 0.0), (0, _LABEL_BELOW), xycoords="axes fraction", fontsize=LABEL, **style)


def ends(name: str, length: int) -> str:
    """Beginning and end of a name that exceeds a length; names of logs often differ at their ends."""
    if len(name) <= length:
        return name
    begin = (length - 1) // 2
    return f"{name[:begin]}\N{HORIZONTAL ELLIPSIS}{name[begin + 1 - length :]}"
