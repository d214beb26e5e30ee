"""Information of the motion: singular values of W, and predicted accuracy of each base parameter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from excite.design.design import Design
from excite.information.matrix import CONVENTIONS, PredictedAccuracy, noise_text
from excite.information.prior import base_sizes
from excite.views.panels import (
    bar_panel,
    beside_names,
    legend_below,
    parameter_label,
    row_places,
    unit_patches,
    unit_style,
)
from excite.views.style import (
    BLUE,
    DARK,
    FORBIDDEN,
    GREY,
    LABEL,
    NOTE,
    ROUND,
    column_width,
    figure_of,
    log_scale,
    plain,
    significant,
    typeset,
)
from regressors.samples import Array

_FEW = 20  # up to this many parameters are in one column beside the spectrum; more are in two columns below it
_WIDE = 30.0  # a ratio of largest to smallest above which bars need a logarithmic scale
_EXPRESSION_LENGTH = 42
_FEWEST_ROWS = 8  # keep bars slim
_BAR_HEIGHT = 0.2  # [in]
_ROOM, _LOG_ROOM = 1.6, 0.5  # for the numbers at its end: times the longest bar, and share of its length
_LEAST = 5.0  # width of a figure with room for whole sentences and numbers [in]
_UNCLEAR = 100.0  # [%]: from here on the deviation is larger than the parameter


# of a base parameter: predicted accuracy, standard deviation over size [%], infinite where no size is known, and label
Bar = tuple[PredictedAccuracy, float, str]


def _bars(design: Design) -> list[Bar]:
    """Predicted standard deviation of each base parameter over its size, see `base_sizes`."""
    base = design.target.base
    size = dict(zip(base.names, base_sizes(design.target.model, base), strict=True))
    bars = []
    for p in design.predicted:
        known = size.get(p.name, np.inf)
        percent = 100.0 * p.standard_deviation / known if np.isfinite(known) and known > 0.0 else np.inf
        bars.append((p, float(percent), parameter_label(p.name, p.expression, _EXPRESSION_LENGTH, "design.json")))
    return bars


def spectrum_figure(design: Design) -> Figure:
    """Draw the singular values of W, and the predicted standard deviation of each base parameter over its size."""
    accuracy = _bars(design)
    count = len(accuracy)
    rows = count if count <= _FEW or column_width() <= _LEAST else -(-count // 2)
    columns = [accuracy[k : k + rows] for k in range(0, count, rows)]
    tall = max(row_places([label for *_, label in column])[1] for column in columns)
    title = f"{design.robot.name}: predicted accuracy of {count} base parameter{'s' if count != 1 else ''}"
    if column_width() <= _LEAST:
        height = 0.9 + _BAR_HEIGHT * max(tall, _FEWEST_ROWS)
        figure = figure_of(6.0, 4.2 + height, title, text=4.2 + height)
        spectrum, *bars = figure.subplots(2, 1, height_ratios=(2.8, height))
    elif len(columns) == 1:
        height = max(4.8, 2.0 + 1.25 * _BAR_HEIGHT * tall)
        figure = figure_of(12.5, height, title, text=height)
        spectrum, *bars = figure.subplots(1, 2, width_ratios=(1.0, 1.25))
    else:
        height = 0.9 + _BAR_HEIGHT * tall
        figure = figure_of(13.0, 4.2 + height, title, text=4.2 + height)
        (upper,), (lower,) = figure.subfigures(2, 1, squeeze=False, height_ratios=(2.8, height))
        spectrum, bars = upper.subplots(), list(lower.subplots(1, 2))
    _draw_spectrum(spectrum, design.spectrum, design.condition_number)
    _draw_predictions(bars, columns, max(tall, _FEWEST_ROWS))
    bars[0].set_title(plain(beside_names(_explanation(design), bars[0])), loc="left", y=1.0, fontsize=LABEL, color=DARK)
    handles = unit_patches(predicted.unit for predicted, *_ in accuracy)
    if any(np.isfinite(percent) and percent > _UNCLEAR for _, percent, _ in accuracy):
        handles.append(Patch(color=FORBIDDEN, label="deviation larger than the size"))
    legend_below(figure, handles, title="unit of the parameter", title_fontsize=NOTE, fontsize=NOTE)
    return figure


def _draw_spectrum(ax: Axes, sigma: Array, condition_number: float) -> None:
    number = np.arange(1, sigma.size + 1)
    room = max(2.0, float(sigma[0] / sigma[-1]) ** 0.12)
    floor = float(sigma[-1]) / room
    stems = ax.stem(number, sigma, bottom=floor, linefmt=BLUE, markerfmt="o", basefmt=" ")
    stems.stemlines.set_linewidth(1.2)
    stems.markerline.set(color=BLUE, markersize=4)
    log_scale(ax.yaxis, floor, room * float(sigma[0]))
    ax.set_xlim(0.0, 1.08 * sigma.size + 0.8)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True, steps=ROUND))
    first, last = significant(sigma[0], 4), significant(sigma[-1], 4)
    text: dict[str, Any] = {"textcoords": "offset points", "fontsize": NOTE, "color": DARK}
    if sigma.size > 1:
        ax.annotate(first, (1, sigma[0]), (-3, 6), **text)  # nothing is above the first or right of the last
    ax.annotate(last, (sigma.size, sigma[-1]), (6, 0), va="center", **text)
    ax.set_xlabel("singular values, largest first", fontsize=LABEL, color=DARK)
    ax.set_ylabel("singular value of W (SI)", fontsize=LABEL, color=DARK)
    convention = CONVENTIONS["condition_number"].removeprefix("cond(W), ")
    ratio = f"cond(W) = {first} / {last} = {significant(condition_number, 4)}"
    ax.set_title(beside_names(f"{ratio}\n{convention}", ax), loc="left", y=1.0, fontsize=LABEL, color=DARK)


def _draw_predictions(panels: Sequence[Axes], columns: Sequence[Sequence[Bar]], tall: float) -> None:
    """Bars in the order of the base, one column after the other, on one scale."""
    percent = np.array([percent for column in columns for _, percent, _ in column])
    shown = percent[np.isfinite(percent) & (percent > 0.0)]
    low, high = (float(shown.min()), float(shown.max())) if shown.size else (1.0, _UNCLEAR)
    for ax, column in zip(panels, columns, strict=True):
        labels = [label for *_, label in column]
        places, _ = row_places(labels)
        bar_panel(ax, 0.0, tall, places.tolist(), labels)
        _draw_bars(ax, column, places)
        if high > _WIDE * low:
            log_scale(ax.xaxis, low / 2.0, high * (2.0 * high / low) ** _LOG_ROOM)
        else:
            ax.set_xlim(0.0, _ROOM * high)
        left, right = ax.get_xlim()
        if high > _UNCLEAR:
            ax.axvspan(max(left, _UNCLEAR), right, color=FORBIDDEN, linewidth=0, zorder=0.5)
        text = beside_names("standard deviation / size of the parameter [%]", ax)
        ax.set_xlabel(text, fontsize=LABEL, color=DARK)


def _draw_bars(ax: Axes, column: Sequence[Bar], places: Array) -> None:
    for place, (predicted, percent, _) in zip(places, column, strict=True):
        known = bool(np.isfinite(percent))
        if known:
            ax.barh([place], [percent], height=0.62, **unit_style(predicted.unit))
        where: dict[str, Any] = {"xycoords": "data" if known else ("axes fraction", "data"), "va": "center"}
        style: dict[str, Any] = {"textcoords": "offset points", "fontsize": NOTE - 0.5}
        at, colour = (percent, DARK) if known else (0.0, GREY)
        # the relative deviation alone where a column has no room for both
        deviation = f"{significant(predicted.standard_deviation, 2)} {predicted.unit}"
        text = f"{significant(percent, 2)} %" if known else f"{deviation}, size not known"
        text += f" ({deviation})" if known and column_width() == float("inf") else ""
        number = ax.annotate(typeset(text), (at, place), (3, 0), color=colour, **where, **style)
        number.set_in_layout(False)  # it has room in the panel


def _explanation(design: Design) -> str:
    """What is drawn, for which noise, and where the sizes come from."""
    noise = noise_text(design.task.objective.noise, design.target.model)
    if column_width() <= _LEAST:
        return f"deviation / size for {noise}"
    return (
        "Predicted standard deviation of each base parameter, over its size\n"
        f"for {noise}, independent in {design.rows} rows\n"
        "size: as described, plausible for the robot where it is not"
    )
