"""Panels of equal size with room for the text around them, for any number of panels.

On a screen their places are computed, as matplotlib's own layout takes seconds for many panels; in a column of a paper
matplotlib places them, in as many rows as they need.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from excite.plots.style import (
    BOLD,
    DARK,
    LABEL,
    LETTER,
    NOTE,
    ROUND,
    TITLE_STYLE,
    broken,
    column_width,
    columns_that_fit,
    figure_of,
    low,
    panel_width,
    plain,
    size_of,
    tidy,
    typeset,
)
from excite.plots.timeline import ends

NAME_STYLE: dict[str, Any] = {"loc": "left", "fontsize": LABEL, "fontweight": "bold", "color": DARK}
_TITLE_BELOW_TOP, _LEGEND_ABOVE_BOTTOM = 0.12, 0.06  # [in]
_NUMBER = 3.0  # height that a number takes on a vertical axis in a column, over the size of its font
_MOST = 0.5  # of a panel that is split, for the lower part
_HANDLE = 9  # letters that the line of a legend's entry takes, with the space around it
_ABOVE, _RIGHT, _LABEL_FROM_EDGE = 0.8, 0.25, 0.28


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
    """Create a figure with a title and tidy panels, row by row."""
    if column_width() < float("inf"):
        return _panels_in_column(rows, panel, title, notes, further)
    columns, own = len(panel.widths), rows
    rows += -(-further // columns)
    mean = sum(panel.widths) / columns
    width = sum(panel.widths) + columns * panel.left + _RIGHT
    above = _ABOVE + notes
    height = above + rows * panel.height + (rows - 1) * panel.between + panel.below
    figure = Figure(figsize=(width, height), facecolor="white")
    figure.subplots_adjust(
        left=panel.left / width,
        right=1.0 - _RIGHT / width,
        bottom=panel.below / height,
        top=1.0 - above / height,
        wspace=panel.left / mean,
        hspace=panel.between / panel.height,
    )
    figure.suptitle(plain(title), y=1.0 - _TITLE_BELOW_TOP / height, va="top", **TITLE_STYLE)
    axes = figure.subplots(rows, columns, squeeze=False, width_ratios=panel.widths).tolist()
    for row in axes:
        for ax, wide in zip(row, panel.widths, strict=True):
            tidy(ax)
            ax.yaxis.set_label_coords((_LABEL_FROM_EDGE - panel.left) / wide, 0.5)
    below = [ax for row in axes[own:] for ax in row]
    for ax in below[further:]:
        ax.remove()
    return figure, [*axes[:own], *([below[:further]] if further else [])]


def _panels_in_column(
    rows: int, panel: Panel, title: str, notes: float, further: int
) -> tuple[Figure, list[list[Axes]]]:
    """The same panels; a row that has no room is broken into several."""
    count = len(panel.widths)
    columns = columns_that_fit(count, panel.least)
    parts = -(-count // columns)
    first = rows * parts  # row of the further panels
    whole = first - (-further // columns)
    tall, text = whole * panel.height, _ABOVE + (whole - 1) * panel.between + panel.below
    figure = figure_of(column_width(), tall + text, title, text)
    height = figure.get_figheight() + notes
    figure.set_figheight(height)
    figure.set_layout_engine("constrained", rect=(0.0, 0.0, 1.0, 1.0 - notes / height))
    grid = figure.add_gridspec(whole, columns, width_ratios=panel.widths if parts == 1 else None)
    axes = [
        [figure.add_subplot(grid[parts * row + k // columns, k % columns]) for k in range(count)] for row in range(rows)
    ]
    if further:
        axes.append([figure.add_subplot(grid[first + k // columns, k % columns]) for k in range(further)])
    for ax in figure.axes:
        tidy(ax)
    return figure, axes


def split(ax: Axes, lower: float, gap: float) -> tuple[Axes, Axes]:
    """Replace a panel by one above another, with the same range of time."""
    figure, place = ax.figure, ax.get_subplotspec()
    assert place is not None
    assert isinstance(figure, Figure)
    height, gap = float(ax.bbox.height) / figure.dpi, low(gap)
    lower = min(lower, _MOST * height)
    upper, left = height - lower - gap, ax.yaxis.label.get_position()[0]
    ax.remove()
    grid = place.subgridspec(2, 1, height_ratios=(upper, lower), hspace=gap / (0.5 * (upper + lower)))
    pair = figure.add_subplot(grid[0]), figure.add_subplot(grid[1])
    for part in pair:
        tidy(part)
        if figure.get_layout_engine() is None:
            part.yaxis.set_label_coords(left, 0.5)
    return pair


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
    ax.set_title(typeset(note), loc="right", fontsize=NOTE, color=colour)


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
    if figure.get_layout_engine() is None:
        where = 0.5, _LEGEND_ABOVE_BOTTOM / figure.get_figheight()
        place: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": where}
    else:
        place = {"loc": "outside lower center"}
    style = {"fontsize": LABEL, "frameon": False, **place, **style}
    figure.legend(handles=list(handles), ncols=columns, **style)
