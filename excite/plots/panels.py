"""Panels of equal size with room for the text around them, for any number of panels.

matplotlib's own layout takes seconds for many panels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from excite.plots.style import DARK, LABEL, NOTE, ROUND, TITLE_STYLE, plain, tidy, typeset
from excite.plots.timeline import ends

NAME_STYLE: dict[str, Any] = {"loc": "left", "fontsize": LABEL, "fontweight": "bold", "color": DARK}
_TITLE_BELOW_TOP, _LEGEND_ABOVE_BOTTOM = 0.12, 0.06  # [in]
_ABOVE, _RIGHT, _LABEL_FROM_EDGE = 0.8, 0.25, 0.28
_LETTER, _BOLD = 0.58, 0.7  # mean width of a letter over the size of the font


@dataclass(frozen=True)
class Panel:
    """Size of a panel, and of its margins."""

    widths: tuple[float, ...]  # width of the panels of each column [in]
    height: float  # [in]
    left: float = 0.8  # room on the left of each panel [in]
    between: float = 0.5  # room between two rows [in]
    below: float = 0.95  # room below the last row [in]


def panels(rows: int, panel: Panel, title: str) -> tuple[Figure, list[list[Axes]]]:
    """Create a figure with a title and tidy panels, row by row."""
    columns = len(panel.widths)
    mean = sum(panel.widths) / columns
    width = sum(panel.widths) + columns * panel.left + _RIGHT
    height = _ABOVE + rows * panel.height + (rows - 1) * panel.between + panel.below
    figure = Figure(figsize=(width, height), facecolor="white")
    figure.subplots_adjust(
        left=panel.left / width,
        right=1.0 - _RIGHT / width,
        bottom=panel.below / height,
        top=1.0 - _ABOVE / height,
        wspace=panel.left / mean,
        hspace=panel.between / panel.height,
    )
    figure.suptitle(plain(title), y=1.0 - _TITLE_BELOW_TOP / height, va="top", **TITLE_STYLE)
    axes = figure.subplots(rows, columns, squeeze=False, width_ratios=panel.widths).tolist()
    for row in axes:
        for ax, wide in zip(row, panel.widths, strict=True):
            tidy(ax)
            ax.yaxis.set_label_coords((_LABEL_FROM_EDGE - panel.left) / wide, 0.5)
    return figure, axes


def split(ax: Axes, lower: float, gap: float) -> tuple[Axes, Axes]:
    """Replace a panel by one above another, with the same range of time."""
    figure, place = ax.figure, ax.get_subplotspec()
    assert place is not None
    assert isinstance(figure, Figure)
    height = float(ax.bbox.height) / figure.dpi
    upper, left = height - lower - gap, ax.yaxis.label.get_position()[0]
    ax.remove()
    grid = place.subgridspec(2, 1, height_ratios=(upper, lower), hspace=gap / (0.5 * (upper + lower)))
    pair = figure.add_subplot(grid[0]), figure.add_subplot(grid[1])
    for part in pair:
        tidy(part)
        part.yaxis.set_label_coords(left, 0.5)
    return pair


def head(ax: Axes, name: str, note: str = "", colour: str = DARK) -> None:
    """Write the name of a panel above it on the left, and a note on the right; below a name that leaves no room."""
    points = 72.0 * float(ax.bbox.width) / ax.figure.dpi
    letters = int(points / (_BOLD * LABEL))
    beside = _BOLD * LABEL * len(name) + _LETTER * NOTE * len(note) < points
    ax.set_title(typeset(ends(name, max(3, letters))) + ("" if beside or not note else "\n"), **NAME_STYLE)
    ax.set_title(typeset(note), loc="right", fontsize=NOTE, color=colour)


def value_axis(ax: Axes, label: str, numbers: int = 5) -> None:
    """Label a vertical axis with full numbers, without an offset or a factor above it."""
    ax.set_ylabel(typeset(label), fontsize=NOTE, color=DARK)
    ax.yaxis.set_major_locator(MaxNLocator(numbers, steps=ROUND))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: typeset(f"{value:.8g}")))


def legend_below(figure: Figure, handles: Sequence[Artist]) -> None:
    """Draw one legend for all panels, at the lower edge of the figure."""
    place = (0.5, _LEGEND_ABOVE_BOTTOM / figure.get_figheight())
    figure.legend(
        handles=list(handles),
        loc="lower center",
        bbox_to_anchor=place,
        ncols=len(handles),
        fontsize=LABEL,
        frameon=False,
    )
