"""Text of a figure for a column: in the column's sizes, broken into lines, with as many numbers as have room."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from weakref import WeakKeyDictionary

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis, XAxis
from matplotlib.collections import Collection
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Annotation, Text
from matplotlib.ticker import FixedFormatter, FixedLocator, MaxNLocator

from excite.plots.drawing_style import in_proportion, size_of
from excite.plots.style import DARK, LABEL, NOTE, TITLE

_SIZES = {TITLE: "figure.titlesize", LABEL: "axes.labelsize", NOTE: "xtick.labelsize"}
_MOST_NUMBERS = 6  # on an axis
_BESIDE = 0.06  # between two texts on one line [in]
_LABEL_PAD = 0.09  # between numbers and the label beside them, with the marks [in]
_WHOLE: WeakKeyDictionary[Text, tuple[str, str]] = WeakKeyDictionary()  # a broken text, and what it was before
_BREAKS = re.compile(r" (?![^\[]*\])(?!%)")  # not within a unit, nor before a percent sign


def inches(text: Text) -> tuple[float, float]:
    """Width and height of a text as drawn [in]."""
    box = text.get_window_extent()
    dpi = text.get_figure(root=True).dpi  # type: ignore[union-attr]
    return float(box.width) / dpi, float(box.height) / dpi


def column_sizes(figure: Figure) -> None:
    """Give texts and lines the sizes of the style that is drawn in, where they have those of a figure for a screen."""
    small = in_proportion("xtick.labelsize")
    right = {size_of(parameter) for parameter in ("font.size", "axes.labelsize", "xtick.labelsize")}
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        before = float(text.get_fontsize())
        if before not in right:
            text.set_fontsize(size_of(_SIZES[before]) if before in _SIZES else small * before)
        if isinstance(text, Annotation) and text.anncoords == "offset points":
            x, y = text.xyann
            text.xyann = small * float(x), small * float(y)
    for ax in figure.axes:
        ax.tick_params(labelsize=size_of("xtick.labelsize"))
        ax.tick_params(grid_linewidth=size_of("grid.linewidth"))
        for artist in (*ax.lines, *ax.collections, *ax.patches):
            thin(artist)


def thin(artist: Artist) -> None:
    """Draw lines and marks in proportion to the lines of the style."""
    share = in_proportion("lines.linewidth")
    if isinstance(artist, Line2D):
        if artist.get_linewidth() != size_of("lines.linewidth"):
            artist.set_linewidth(share * float(artist.get_linewidth()))
        artist.set_markersize(share * float(artist.get_markersize()))
    elif isinstance(artist, Patch):
        artist.set_linewidth(share * float(artist.get_linewidth()))
    elif isinstance(artist, Collection):
        artist.set_linewidth([share * float(width) for width in np.atleast_1d(artist.get_linewidth())])


def break_lines(text: Text, width: float) -> int:
    """Break a text between words, so that none of its lines is wider than a width, if its words are not."""
    broken, whole = _WHOLE.get(text, ("", ""))
    if text.get_text() != broken:
        whole = text.get_text()
    lines: list[str] = []
    for paragraph in whole.split("\n"):
        line = ""
        for word in _BREAKS.split(paragraph):
            longer = f"{line} {word}" if line else word
            text.set_text(longer)
            if line and inches(text)[0] > width:
                lines.append(line)
                longer = word
            line = longer
        lines.append(line)
    text.set_text("\n".join(lines))
    _WHOLE[text] = text.get_text(), whole
    return len(lines)


def cut_names(names: Sequence[Text], width: float) -> None:
    """Leave the equations behind all names out where one is wider than a width [in], and cut what is wider still."""
    if all(inches(name)[0] <= width for name in names):
        return
    for text in names:
        name = text.get_text().split(" = ")[0]
        text.set_text(name)
        shown = len(name)
        while inches(text)[0] > width and shown > 3:
            shown -= 1
            text.set_text(f"{name[:shown].rstrip(' +-')}\N{HORIZONTAL ELLIPSIS}")


def titles(ax: Axes) -> tuple[Text, Text, Text]:
    """Texts above a panel: in the middle, on the left, on the right."""
    middle, left, right = (each for each in ax.get_children() if isinstance(each, Text) and each not in ax.texts)
    return middle, left, right


def stack_titles(row: Sequence[Axes], widths: Sequence[float]) -> None:
    """Put the names of a row's panels above their notes where both have no room side by side."""
    lines = [_broken_notes(ax, width) for ax, width in zip(row, widths, strict=True)]
    alone = sum(bool(titles(ax)[1].get_text().strip()) for ax in row) == 1  # then it may be as wide as the row
    for ax, width, own in zip(row, widths, lines, strict=True):
        _, left, right = titles(ax)
        text = left.get_text()
        name = text.rstrip("\n")
        left.set_text(name)
        beside = inches(left)[0] + inches(right)[0] + _BESIDE <= width
        above = len(text) - len(name) if beside and own <= 1 else own
        if alone and inches(left)[0] > width:
            above, width = max(lines), sum(widths)
        if name:
            break_lines(left, width - _BESIDE)
            left.set_text(left.get_text() + "\n" * above)


def _broken_notes(ax: Axes, width: float) -> int:
    """Break what stands above a panel in the middle and on the right, and give the lines on the right."""
    middle, left, right = titles(ax)
    break_lines(middle, width)
    for note in ax.texts:
        if not note.get_in_layout():  # a caption below the name, which had room beside its panel
            before = note.get_text().count("\n") + 1
            left.set_text(left.get_text() + "\n" * max(0, break_lines(note, width) - before - 1))
            note.set_in_layout(True)
    return break_lines(right, width) if right.get_text() else 0


def fewer_numbers(axis: Axis) -> None:
    """Leave out numbers of an axis until those that are left do not touch."""
    locator = axis.get_major_locator()
    if isinstance(locator, MaxNLocator):
        for most in range(_MOST_NUMBERS, 1, -1):
            locator.set_params(nbins=most)
            if not _touch(axis):
                return
        return
    low, high = sorted(axis.get_view_interval())
    places = [float(place) for place in axis.get_majorticklocs()]
    labels = axis.get_major_formatter().format_ticks(places)
    seen = [(p, text) for p, text in zip(places, labels, strict=True) if low <= p <= high]
    step = 1
    while len(seen[::step]) > 2 and _touch(axis):
        step += 1
        axis.set_major_locator(FixedLocator([p for p, _ in seen[::step]]))
        axis.set_major_formatter(FixedFormatter([text for _, text in seen[::step]]))


def _touch(axis: Axis) -> bool:
    """Whether two numbers side by side are nearer than half a digit."""
    low, high = sorted(axis.get_view_interval())
    ticks = [tick for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
    boxes = [tick.label1.get_window_extent() for tick in ticks if tick.label1.get_visible() and tick.label1.get_text()]
    ends = sorted((box.x0, box.x1) if isinstance(axis, XAxis) else (box.y0, box.y1) for box in boxes)
    apart = 0.5 * size_of("xtick.labelsize") / 72 * axis.axes.figure.dpi if isinstance(axis, XAxis) else 0.0
    return any(later[0] - before[1] < apart for before, later in pairwise(ends))


def put_label(ax: Axes, width: float) -> None:
    """Put the label of the vertical axis beside its numbers; the panel is so wide [in]."""
    low, high = sorted(ax.yaxis.get_view_interval())
    ticks = [tick.label1 for tick in ax.yaxis.get_major_ticks() if low <= tick.get_loc() <= high]
    numbers = max((inches(each)[0] for each in ticks if each.get_visible() and each.get_text()), default=0.0)
    ax.yaxis.set_label_coords(-(numbers + _LABEL_PAD) / width, 0.5)


def break_labels(ax: Axes, width: float, height: float) -> None:
    """Break the labels of both axes; of the vertical one, the unit stands on a line of its own where it has no room."""
    break_lines(ax.xaxis.label, width)
    label = ax.yaxis.label
    if inches(label)[1] > height:
        label.set_text(label.get_text().replace(" [", "\n["))
        label.set_linespacing(1.0)


def legend_below_all(figure: Figure, old: Sequence[Legend], width: float) -> tuple[float, list[Legend]]:
    """Draw the legends again at the lower edge, each in as many columns as have room."""
    height, made = 0.0, []
    for legend in old:
        handles = [handle for handle in legend.legend_handles if handle is not None]
        texts = [text.get_text() for text in legend.get_texts()]
        title = legend.get_title().get_text()
        legend.remove()
        for columns in range(len(texts), 0, -1):
            new = figure.legend(
                handles,
                texts,
                title=title or None,
                title_fontsize=size_of("xtick.labelsize"),
                loc="lower center",
                bbox_to_anchor=(0.5, 0.0),
                ncols=columns,
                fontsize=size_of("xtick.labelsize"),
                frameon=False,
                borderpad=0.1,
                handlelength=1.5,
                columnspacing=1.2,
                labelcolor=DARK,
            )
            if columns == 1:
                for text in new.get_texts():
                    break_lines(text, width - 0.5)
            box = new.get_window_extent()
            if float(box.width) / figure.dpi <= width or columns == 1:
                break
            new.remove()
        height += float(new.get_window_extent().height) / figure.dpi
        made.append(new)
    return height, made
