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
from excite.information.metrics import CONVENTIONS, PredictedAccuracy, noise_text
from excite.plots.style import (
    BLUE,
    DARK,
    GREEN,
    GREY,
    LABEL,
    NOTE,
    ORANGE,
    PURPLE,
    ROUND,
    SKY,
    VERMILLION,
    figure_of,
    log_scale,
    named_sum,
    plain,
    significant,
    tidy,
    typeset,
)
from regressors.samples import Array

_FEW = 20  # up to this many parameters are in one column beside the spectrum; more are in two columns below it
_WIDE = 30.0  # a ratio of largest to smallest above which bars need a logarithmic scale
_EXPRESSION_LENGTH = 42
_FEWEST_ROWS = 8  # keep bars slim
_BAR_HEIGHT = 0.2  # [in]
_ROOM = 1.3  # times the longest bar: room for the number at its end
_UNIT_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILLION, GREY)


def spectrum_figure(design: Design) -> Figure:
    """Draw the singular values of W, and the predicted standard deviation of each base parameter.

    Parameters
    ----------
    design : Design

    Returns
    -------
    Figure
        The spectrum's panel first, then one or two with the parameters' bars, which share one scale.
    """
    count = len(design.predicted)
    title = f"{design.robot.name}: predicted accuracy of {count} base parameter{'s' if count != 1 else ''}"
    if count <= _FEW:
        figure = figure_of(12.5, max(4.8, 2.0 + 1.25 * _BAR_HEIGHT * count), title)
        spectrum, *bars = figure.subplots(1, 2, width_ratios=(1.0, 1.25))
    else:
        height = 0.9 + _BAR_HEIGHT * ((count + 1) // 2)
        figure = figure_of(13.0, 4.2 + height, title)
        (upper,), (lower,) = figure.subfigures(2, 1, squeeze=False, height_ratios=(2.8, height))
        spectrum, bars = upper.subplots(), list(lower.subplots(1, 2))
    _draw_spectrum(spectrum, design.spectrum, design.condition_number)
    _draw_predictions(bars, design)
    _unit_legend(figure, _unit_colours(design.predicted))
    return figure


def _draw_spectrum(ax: Axes, sigma: Array, condition_number: float) -> None:
    number = np.arange(1, sigma.size + 1)
    room = max(2.0, float(sigma[0] / sigma[-1]) ** 0.12)
    floor = float(sigma[-1]) / room
    tidy(ax)
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
    ax.set_title(f"{ratio}\n{convention}", loc="left", fontsize=LABEL, color=DARK)


def _draw_predictions(panels: Sequence[Axes], design: Design) -> None:
    """Bars in the order of the base, one column after the other, on one scale."""
    predicted = design.predicted
    colours = _unit_colours(predicted)
    deviation = np.array([p.standard_deviation for p in predicted])
    low, high = float(deviation.min()), float(deviation.max())
    rows = -(-len(predicted) // len(panels))
    for k, ax in enumerate(panels):
        tidy(ax)
        ax.grid(False, axis="y")
        part = predicted[k * rows : (k + 1) * rows]
        _draw_bars(ax, part, [colours[p.unit] for p in part])
        ax.set_ylim(max(rows, _FEWEST_ROWS) - 0.4, -0.6)
        if low > 0.0 and high > _WIDE * low:
            log_scale(ax.xaxis, low / 2.0, high * (2.0 * high / low) ** (_ROOM - 1.0))
        else:
            ax.set_xlim(0.0, _ROOM * high)
        ax.set_xlabel("standard deviation [unit of the parameter]", fontsize=LABEL, color=DARK)
    text = f"Predicted standard deviation of each base parameter\n{_noise_text(design)}"
    panels[0].set_title(plain(text), loc="left", fontsize=LABEL, color=DARK)


def _draw_bars(ax: Axes, part: Sequence[PredictedAccuracy], colours: Sequence[str]) -> None:
    places = np.arange(len(part))
    bars = ax.barh(places, [p.standard_deviation for p in part], height=0.62, color=colours)
    texts = [typeset(f"{significant(p.standard_deviation, 2)} {p.unit}") for p in part]
    ax.bar_label(bars, texts, padding=3, fontsize=NOTE - 0.5, color=DARK)
    ax.set_yticks(places, [named_sum(p.name, p.expression, _EXPRESSION_LENGTH) for p in part], fontsize=NOTE)
    ax.tick_params(axis="y", length=0)


def _unit_legend(figure: Figure, colours: dict[str, str]) -> None:
    handles = [Patch(color=colour, label=typeset(unit)) for unit, colour in colours.items()]
    place: dict[str, Any] = {"loc": "outside lower center", "ncols": len(handles), "frameon": False}
    figure.legend(handles=handles, title="unit of the parameter", title_fontsize=NOTE, fontsize=NOTE, **place)


def _unit_colours(predicted: Sequence[PredictedAccuracy]) -> dict[str, str]:
    units = list(dict.fromkeys(p.unit for p in predicted))
    return {unit: _UNIT_COLOURS[k % len(_UNIT_COLOURS)] for k, unit in enumerate(units)}


def _noise_text(design: Design) -> str:
    """Text of the noise for which the deviations are predicted."""
    return f"for {noise_text(design.task.objective.noise, design.target.model)}, independent in {design.rows} rows"
