"""Panels of a figure, which matplotlib's constrained layout places, and the time that they share."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec
from matplotlib.patches import Patch
from matplotlib.ticker import FixedFormatter, FixedLocator, FuncFormatter, MaxNLocator
from numpy.typing import ArrayLike

from excite.logs.event import STEPS
from excite.views.style import (
    BLUE,
    BOLD,
    DARK,
    GREEN,
    GREY,
    LABEL,
    LETTER,
    NOTE,
    ORANGE,
    PURPLE,
    ROUND,
    SKY,
    VERMILLION,
    broken,
    column_width,
    columns_that_fit,
    figure_of,
    panel_width,
    plain,
    size_of,
    typeset,
)
from regressors.samples import Array, Index

NAME_STYLE: dict[str, Any] = {"loc": "left", "y": 1.0, "fontsize": LABEL, "fontweight": "bold", "color": DARK}
_NUMBER = 3.0  # height that a number takes on a vertical axis in a column, over the size of its font
_HANDLE = 9  # letters that the line of a legend's entry takes, with the space around it
_ABOVE, _RIGHT = 0.8, 0.25  # [in]
_WIDE, _LOWER = 10.5, 0.6  # width of a panel over the whole width, and height of a lower one [in]


@dataclass(frozen=True)
class Panel:
    """Size of a panel, and of its margins."""

    widths: tuple[float, ...]  # width of the panels of each column [in]
    height: float  # [in]
    left: float = 0.8  # room on the left of each panel [in]
    between: float = 0.5  # room between two rows [in]
    below: float = 0.95  # room below the last row [in]
    least: float = 1.6  # least width of a panel of a column with its numbers [in]


def panels(
    rows: int, panel: Panel, title: str, notes: float = 0.0, further: int = 0
) -> tuple[Figure, list[list[Axes]]]:
    """Create a figure with a title and panels, row by row; a row that has no room is broken into several."""
    count = len(panel.widths)
    columns = columns_that_fit(count, panel.least)
    parts = -(-count // columns)
    first = rows * parts  # row of the further panels
    figure, grid = _grid(first - (-further // columns), columns, panel, title, notes)
    axes = [
        [figure.add_subplot(grid[parts * row + k // columns, k % columns]) for k in range(count)] for row in range(rows)
    ]
    if further:
        axes.append([figure.add_subplot(grid[first + k // columns, k % columns]) for k in range(further)])
    return figure, axes


def _grid(rows: int, columns: int, panel: Panel, title: str, notes: float = 0.0) -> tuple[Figure, GridSpec]:
    """Create a figure with a title and places for its panels."""
    count, text = len(panel.widths), _ABOVE + (rows - 1) * panel.between + panel.below
    width = sum(panel.widths) + count * panel.left + _RIGHT
    figure = figure_of(width, rows * panel.height + text, title, text, notes)
    return figure, figure.add_gridspec(rows, columns, width_ratios=panel.widths if columns == count else None)


def alike(
    count: int, most: int, panel: Panel, title: str, xlabel: str = "", whole: int = 0
) -> tuple[Figure, list[Axes], list[Axes]]:
    """Create so many panels of one width in as many columns as fit, below panels over the whole width."""
    columns = max(1, min(columns_that_fit(most, panel.least), count))
    panel = replace(panel, widths=panel.widths[:1] * columns)
    figure, grid = _grid(whole - (-count // columns), columns, panel, title)
    below = [figure.add_subplot(grid[whole + k // columns, k % columns]) for k in range(count)]
    above = [figure.add_subplot(grid[row, :]) for row in range(whole)]
    for ax in below[-columns:] if xlabel else ():
        ax.set_xlabel(xlabel, fontsize=LABEL, color=DARK)
    return figure, below, above


def fit_panels(rows: int, title: str) -> tuple[Figure, list[tuple[Axes, Axes]]]:
    """Create a panel over the whole width for each of so many equations, and a lower one below each."""
    height, text = 1.3 if rows > 1 else 3.0, _ABOVE + (rows - 1) * Panel.between + Panel.below
    figure = figure_of(_WIDE + Panel.left + _RIGHT, rows * (height + _LOWER) + text, title, text)
    axes = list(figure.subplots(2 * rows, 1, height_ratios=(height, _LOWER) * rows))
    return figure, list(zip(axes[::2], axes[1::2], strict=True))


def head(ax: Axes, name: str, note: str = "", colour: str = DARK) -> None:
    """Write the name of a panel above it on the left, and a note on the right; below a name that leaves no room."""
    label, small, points = size_of("axes.labelsize"), size_of("xtick.labelsize"), 72.0 * panel_width(ax)
    letters = int(points / (BOLD * label))
    beside = BOLD * label * len(name) + LETTER * small * len(note) < points
    note = broken(note, points / 72.0)
    below = "" if beside or not note else "\n" * (1 + note.count("\n"))
    if column_width() < float("inf"):
        name = broken(name, points / 72.0, "axes.labelsize", BOLD)
    else:
        name = ends(name, max(3, letters))
    ax.set_title(typeset(name) + below, **NAME_STYLE)
    ax.set_title(typeset(note), loc="right", y=1.0, fontsize=NOTE, color=colour)


def value_axis(ax: Axes, label: str, numbers: int = 5) -> None:
    """Label a vertical axis with full numbers, without an offset or a factor above it."""
    points = 72.0 * float(ax.bbox.height) / ax.figure.dpi
    if column_width() < float("inf"):
        size = size_of("xtick.labelsize")
        numbers = min(numbers, max(2, int(points / (_NUMBER * size))))
        label = label.replace(" [", "\n[") if LETTER * size * len(label) > points else label
    ax.set_ylabel(typeset(label), fontsize=NOTE, color=DARK)
    ax.yaxis.set_major_locator(MaxNLocator(numbers, steps=ROUND))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: typeset(f"{value:.8g}")))


def legend_below(figure: Figure, handles: Sequence[Artist], **style: Any) -> None:
    """Draw one legend for all panels at the lower edge, in a column in as many columns as have room."""
    columns = len(handles)
    if column_width() < float("inf"):
        letters = int(72.0 * column_width() / (LETTER * size_of("axes.labelsize")))
        for handle in handles:
            handle.set_label(textwrap.fill(str(handle.get_label()), letters - _HANDLE))
        lengths = [_HANDLE + max(map(len, str(handle.get_label()).split("\n"))) for handle in handles]
        while columns > 1 and sum(int(part.max()) for part in np.array_split(lengths, columns)) > letters:
            columns -= 1
    style = {"fontsize": LABEL, "frameon": False, "loc": "outside lower center", **style}
    figure.legend(handles=list(handles), ncols=columns, **style)


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
    width = -(-values.size // bins)
    parts = np.pad(values, (0, -values.size % width), "edge").reshape(-1, width)
    first = width * np.arange(len(parts))
    kept = np.concatenate([[0, values.size - 1], first + parts.argmin(axis=1), first + parts.argmax(axis=1)])
    return np.unique(np.minimum(kept, values.size - 1))


def left_out(time: Array) -> Index:
    """Numbers of the rows behind which others are missing, by steps that are far longer than most."""  # time (m,)
    step = np.diff(time)
    return np.flatnonzero(step > STEPS * np.median(step)) if step.size else np.array([], dtype=np.intp)


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

    def curve(self, time: Array, log: Index, values: Array, *, whole: bool = False) -> tuple[Array, Array]:
        """Places and values to draw, a gap after each log and, unless it is whole, where rows were left out."""
        # time, values (m,); log (m,)
        places, drawn = list[ArrayLike](), list[ArrayLike]()
        for k in range(len(self.names)):
            t, v = time[log == k], values[log == k]
            kept = extremes(v)
            cut = np.array([], dtype=np.intp) if whole else np.unique(np.searchsorted(kept, left_out(t), side="right"))
            places += [np.insert(t[kept], cut, t[kept[cut]]) + self.offsets[k], [self.last[k] + self.offsets[k]]]
            drawn += [np.insert(v[kept], cut, np.nan), [np.nan]]
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


LINES = 4  # of one expression; longer ones are left to a file
_SHARE, _LEFT_BY_NAMES = 0.4, 0.55  # of a column's width, for expressions; of a panel's, beside them
_FURTHER_LINE = 0.67  # of a row's height
_YELLOW = "#F0E442"  # of the same palette
_LINEAR = "////"  # units of prismatic joints, whose quantity has the colour of the revolute ones
# Hatches tell units apart in print without colours.
_LOOKS = {
    "kg m^2": (BLUE, ""),
    "kg m": (ORANGE, ""),
    "kg": (SKY, ".."),
    "Nm": (GREEN, ""),
    "N": (GREEN, _LINEAR),
    "Nm s/rad": (PURPLE, "\\\\"),
    "N s/m": (PURPLE, _LINEAR),
    "Nm/rad": (SKY, "\\\\"),
    "N/m": (SKY, _LINEAR),
    "Nm/Nm": (VERMILLION, ""),
    "N/N": (VERMILLION, _LINEAR),
    "Nm (s/rad)^0.5": (_YELLOW, ""),
    "N (s/m)^0.5": (_YELLOW, _LINEAR),
}
_OTHER = (GREY, "xx")


def parameter_label(name: str, expression: str, length: int, file: str) -> str:
    """Expression of a base parameter over several lines, preceded by its name unless the sum begins with it."""
    if column_width() < float("inf"):
        length = min(length, int(_SHARE * 72.0 * column_width() / (LETTER * size_of("xtick.labelsize"))))
    begins = expression == name or expression.startswith(f"{name} ")
    lines = wrapped_sum(expression if begins else f"{name} = {expression}", length)
    if len(lines) > LINES:
        lines = textwrap.wrap(f"{name} = sum of {len(_terms(expression))} terms, in {file}", max(length, len(file)))
    return typeset("\n".join(lines))


def beside_names(text: str, ax: Axes) -> str:
    """Text above or below a panel beside names, in a column in lines of what they leave of its width."""
    return broken(text, _LEFT_BY_NAMES * panel_width(ax), "axes.labelsize")


def wrapped_sum(text: str, length: int) -> list[str]:
    """Lines of a sum, broken between its terms."""
    lines = [""]
    for term in _terms(text):
        if lines[-1] and len(lines[-1]) + len(term) > length:
            lines.append(term.lstrip())
        else:
            lines[-1] += term
    return lines


def row_places(labels: Sequence[str]) -> tuple[Array, float]:
    """Middle of each label's row from the top, and the height of all, in heights of a row with one line."""
    heights = np.array([1.0 + _FURTHER_LINE * label.count("\n") for label in labels])
    return np.cumsum(heights) - 0.5 * heights, float(heights.sum())


def _terms(text: str) -> list[str]:
    return re.split(r"(?= [+-] )", text)


def unit_style(unit: str) -> dict[str, Any]:
    """Style of a patch that shows a value in a unit; units that no built-in model has are grey."""
    colour, hatch = _LOOKS.get(unit, _OTHER)
    return {"facecolor": colour, "hatch": hatch, "edgecolor": "white", "linewidth": 0.0}


def unit_patches(units: Iterable[str]) -> list[Patch]:
    """Entries of a legend for units, one for all that no built-in model has."""
    given = list(dict.fromkeys(units))
    others = [unit for unit in given if unit not in _LOOKS]
    patches = [Patch(**unit_style(unit), label=typeset(unit)) for unit in given if unit in _LOOKS]
    if others:
        patches.append(Patch(**unit_style(others[0]), label=typeset(", ".join(unit or "none" for unit in others))))
    return patches


_APART, _MEAN = 12.0, 0.6  # between columns of numbers [pt]; mean width of a letter over the size of the font


class NumberColumn(NamedTuple):
    """A column of numbers beside a panel; an empty text where a row has none."""

    heading: str
    texts: Sequence[str]
    side: str = "right"  # on which its texts end or begin
    marked: Sequence[bool] = ()

    @property
    def width(self) -> float:
        """Width [pt]."""
        return _MEAN * max(LABEL * len(self.heading), NOTE * max(map(len, self.texts), default=0))


def columns_inches(columns: Sequence[NumberColumn]) -> float:
    """Width of columns with the space around them [in]."""
    return (_APART + sum(column.width + _APART for column in columns)) / 72.0


def write_columns(ax: Axes, places: Sequence[float], columns: Sequence[NumberColumn]) -> None:
    """Write columns of numbers on the right of a panel, each text at the place of its row."""
    style: dict[str, Any] = {"textcoords": "offset points", "va": "center"}
    begin = _APART
    for column in columns:
        at = begin + column.width * (column.side == "right")
        heading = {**style, "va": "bottom", "xycoords": "axes fraction", "fontsize": LABEL, "color": DARK}
        ax.annotate(column.heading, (1.0, 1.0), (at, 6), ha=column.side, **heading)
        for k, (place, text) in enumerate(zip(places, column.texts, strict=True)):
            colour, weight = (VERMILLION, "bold") if column.marked and column.marked[k] else (DARK, "normal")
            where: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "fontsize": NOTE, "ha": column.side}
            ax.annotate(text, (1.0, place), (at, 0), color=colour, fontweight=weight, **where, **style)
        begin += column.width + _APART


def bar_panel(ax: Axes, top: float, bottom: float, places: Sequence[float] = (), labels: Sequence[str] = ()) -> None:
    """Make a panel one of horizontal bars, from the top, with labels on the left."""
    ax.grid(False, axis="y")
    ax.set_ylim(bottom, top)
    ax.set_yticks(places, [typeset(label) for label in labels], fontsize=NOTE)
    ax.tick_params(axis="y", length=0)
