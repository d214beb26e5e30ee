"""A figure as it was drawn for a screen, laid out again for a column of a paper.

Panels keep their order and their proportions; rows that have no room are broken, and the height follows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from excite.plots.column_text import (
    break_labels,
    break_lines,
    column_sizes,
    cut_names,
    fewer_numbers,
    inches,
    legend_below_all,
    put_label,
    stack_titles,
    thin,
    titles,
)
from excite.plots.drawing_style import column_width, in_proportion

_EDGE, _GAP, _BELOW_TITLE, _ABOVE_LEGEND = 0.05, 0.06, 0.05, 0.06  # [in]
_LEAST, _LEAST_SQUARE = 0.6, 1.3  # width of a panel, and of one whose axes have the same scale [in]
_LOW = 0.62  # height of a panel in a column, over that on a screen
_NAMES = 0.4  # part of the width that names beside a panel may take
_EVENER = 0.7  # below 1: panels differ less in width than on a screen


@dataclass
class _Cell:
    """A panel: its size on the screen, and what it needs around it in the column [in]."""

    ax: Axes
    width: float
    height: float
    left: float = 0.0
    right: float = 0.0
    above: float = 0.0
    below: float = 0.0
    placed: tuple[float, float] = (0.0, 0.0)  # left edge and width

    @property
    def is_square(self) -> bool:
        return self.ax.get_aspect() != "auto"

    @property
    def lists_rows(self) -> bool:
        """True for bars and the like, one row of text each from the top."""
        return bool(self.ax.yaxis_inverted())

    def measure(self) -> None:
        """Measure numbers, labels and titles around the panel."""
        dpi, inner = self.ax.figure.dpi, self.ax.get_window_extent()
        centred = (*titles(self.ax), self.ax.xaxis.label)  # their width does not count: they are broken
        for text in centred:
            text.set_visible(False)
        outer = self.ax.get_tightbbox()
        for text in centred:
            text.set_visible(True)
        whole = self.ax.get_tightbbox()
        assert outer is not None
        assert whole is not None
        self.left, self.right = (max(0.0, x) / dpi for x in (inner.x0 - outer.x0, outer.x1 - inner.x1))
        self.below, self.above = (max(0.0, y) / dpi for y in (inner.y0 - whole.y0, whole.y1 - inner.y1))


@dataclass
class _Row:
    cells: list[_Cell]
    heights: list[float] = field(default_factory=list)

    @property
    def tall(self) -> float:
        return max(cell.above + height + cell.below for cell, height in zip(self.cells, self.heights, strict=True))


def lay_out(figure: Figure) -> None:
    """Lay a figure out for the column of the style that is drawn in, see `excite.plots.drawing_style`."""
    width = column_width()
    figure.draw_without_rendering()  # places what matplotlib's own layout places
    rows = _rows(figure)
    figure.set_layout_engine("none")
    column_sizes(figure)
    rows = [part for row in rows for part in _broken(row, width)]
    figure.set_size_inches(width, 20.0)
    legends = [*figure.legends, *(legend for ax in figure.axes if (legend := ax.get_legend()) is not None)]
    for legend in legends:
        for handle in legend.legend_handles:
            if handle is not None:
                thin(handle)
    below, legends = legend_below_all(figure, legends, width - 2 * _EDGE)
    above = _headings(figure, width)
    for _ in range(2):  # numbers that are left out make room for the panels
        for group in _alike(rows):
            _share_width(group, width)
        for row in rows:
            _set_heights(row)
            _place(figure, row, 10.0)
            _fit_text(row, width)
    for group in _alike(rows):
        _share_width(group, width)
    _stack(figure, rows, above, below, width, legends)


def _rows(figure: Figure) -> list[_Row]:
    """Panels that are side by side, from the top."""
    dpi, cells = figure.dpi, []
    for ax in figure.axes:
        if ax.axison and ax.get_visible():
            box = ax.get_window_extent()
            cells.append((float(box.y0 + box.y1) / 2, float(box.x0), _Cell(ax, box.width / dpi, box.height / dpi)))
    rows: list[list[tuple[float, float, _Cell]]] = []
    for middle, x, cell in sorted(cells, key=lambda each: -each[0]):
        if rows and abs(rows[-1][0][0] - middle) < 0.25 * dpi * min(cell.height, rows[-1][0][2].height):
            rows[-1].append((middle, x, cell))
        else:
            rows.append([(middle, x, cell)])
    return [_Row([cell for *_, cell in sorted(row, key=lambda each: each[1])]) for row in rows]


def _least(cell: _Cell) -> float:
    return _LEAST_SQUARE if cell.is_square else _LEAST


def _broken(row: _Row, width: float) -> list[_Row]:
    """The row in as few rows as its panels need."""
    for cell in row.cells:
        cut_names(_names(cell), _NAMES * width / len(row.cells))
        put_label(cell.ax, cell.width)
        cell.measure()
    count, least = len(row.cells), sum(_least(cell) + cell.left + cell.right for cell in row.cells)
    parts = min(count, max(1, -(-int(1000 * least) // int(1000 * width))))
    each = -(-count // parts)
    return [_Row(row.cells[k : k + each]) for k in range(0, count, each)]


def _names(cell: _Cell) -> list[Text]:
    """Names on the left of a panel."""
    edge = cell.ax.get_window_extent().x0
    beside = [text for text in cell.ax.texts if text.get_window_extent().x1 <= edge]
    return [*(tick.label1 for tick in cell.ax.yaxis.get_major_ticks()), *beside]


def _alike(rows: Sequence[_Row]) -> list[list[_Row]]:
    """Rows of the same columns; one that ends early belongs to those before it."""
    groups: list[list[_Row]] = []
    for row in rows:
        own = [round(cell.width, 1) for cell in row.cells]
        for group in groups:
            first = [round(cell.width, 1) for cell in group[0].cells]
            if first[: len(own)] == own and (len(first) == len(own) or len(first) > 1):
                group.append(row)
                break
        else:
            groups.append([row])
    return groups


def _share_width(rows: Sequence[_Row], width: float) -> None:
    """Give the panels of rows of the same columns what numbers and labels leave of the width."""
    columns = len(rows[0].cells)
    lefts, rights = (
        [max(getattr(row.cells[k], side) for row in rows if k < len(row.cells)) for k in range(columns)]
        for side in ("left", "right")
    )
    rights = [max(right, 0.02) for right in rights]
    left_over = width - 2 * _EDGE - sum(lefts) - sum(rights) - _GAP * (columns - 1)
    shares = [cell.width**_EVENER for cell in rows[0].cells]
    at = _EDGE
    for k in range(columns):
        wide = max(left_over * shares[k] / sum(shares), 0.3)
        for row in rows:
            if k < len(row.cells):
                row.cells[k].placed = (at + lefts[k], wide)
        at += lefts[k] + wide + rights[k] + _GAP


def _set_heights(row: _Row) -> None:
    text = in_proportion("xtick.labelsize")
    row.heights = [
        cell.height * cell.placed[1] / cell.width
        if cell.is_square
        else cell.height * (text if cell.lists_rows else _LOW)
        for cell in row.cells
    ]


def _place(figure: Figure, row: _Row, top: float) -> None:
    """Place a row whose panels' upper edge is so far from the lower edge of the figure [in]."""
    whole_width, whole_height = figure.get_size_inches()
    for cell, height in zip(row.cells, row.heights, strict=True):
        left, wide = cell.placed
        box = Bbox.from_bounds(
            left / whole_width, (top - height) / whole_height, wide / whole_width, height / whole_height
        )
        parent = cell.ax.get_figure(root=False)
        assert parent is not None
        own = box.transformed(figure.transFigure).transformed(parent.transSubfigure.inverted())
        cell.ax.set_position(own)


def _fit_text(row: _Row, width: float) -> None:
    """Break titles and labels, leave numbers out, and measure what is around the panels then."""
    edges = [*(cell.placed[0] - cell.left for cell in row.cells[1:]), width - _EDGE]
    stack_titles(
        [cell.ax for cell in row.cells],
        [end - cell.placed[0] - _GAP for cell, end in zip(row.cells, edges, strict=True)],
    )
    for cell, height in zip(row.cells, row.heights, strict=True):
        fewer_numbers(cell.ax.xaxis)
        if not cell.lists_rows:
            fewer_numbers(cell.ax.yaxis)
        break_labels(cell.ax, cell.placed[1] + cell.right, height)
        put_label(cell.ax, cell.placed[1])
        cell.measure()


def _headings(figure: Figure, width: float) -> float:
    """Break the figure's title and the notes below it, and give their height [in]."""
    tall = _EDGE
    for text in figure.texts:
        break_lines(text, width - 2 * _EDGE)
        tall += inches(text)[1] + 0.02
    return tall + _BELOW_TITLE


def _stack(
    figure: Figure, rows: Sequence[_Row], above: float, below: float, width: float, legends: Sequence[Legend]
) -> None:
    """Place all rows one below the other, and set the height of the figure."""
    height = above + sum(row.tall for row in rows) + _GAP * (len(rows) - 1) + _ABOVE_LEGEND + below + _EDGE
    figure.set_size_inches(width, height)
    top = height - _EDGE
    for text in figure.texts:
        text.set(x=0.5, y=top / height, ha="center", va="top")
        top -= inches(text)[1] + 0.02
    top = height - above
    for row in rows:
        _place(figure, row, top - max(cell.above for cell in row.cells))
        for cell in row.cells:
            put_label(cell.ax, cell.placed[1])
        top -= row.tall + _GAP
    at = _EDGE
    for legend in reversed(legends):
        legend.set_bbox_to_anchor((0.5, at / height), transform=figure.transFigure)
        at += float(legend.get_window_extent().height) / figure.dpi
