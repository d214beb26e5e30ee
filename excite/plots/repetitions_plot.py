"""Repetitions of an experiment in simulation: scatter of the estimates beside their predicted intervals."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy.stats
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from excite.identification.estimate import CONFIDENCE
from excite.plots.figure_files import write_figure_files
from excite.plots.panels import legend_below
from excite.plots.style import (
    BAND,
    BLUE,
    DARK,
    LABEL,
    NOTE,
    VERMILLION,
    column_width,
    figure_of,
    significant,
    tidy,
    typeset,
)
from excite.study.repetitions import Repetitions
from regressors.samples import Array

FIGURE = "repetitions"
DOTS = 200  # repetitions drawn one by one; percentiles are of all
_ROW, _ABOVE, _BELOW = 0.24, 0.85, 1.0  # [in]
_PANEL, _NUMBERS = 5.0, 3.6  # widths [in]
_LEAST_NAMES, _LETTER = 1.2, 0.07  # width of the names, and of a letter [in]
_PLACES = 68.0, 168.0, 242.0  # right ends of the columns of numbers, from the panel [pt]
_BESIDE = ("axes fraction", "data")
_ENDS = 0.5, 99.5  # percentiles between which 99 % of the estimates are
_LEAST, _MOST = 1.6, 6.0  # half-widths shown to both sides
_UNLIKELY = 1e-3  # probability below which a coverage is marked


def repetitions_figure(repetitions: Repetitions, robot: str) -> Figure:
    """Draw the error of every estimate over half the width of its predicted interval."""
    count = len(repetitions.names)
    names = max(_LEAST_NAMES, _LETTER * (2 + max(map(len, repetitions.names), default=0)))
    width, height = names + _PANEL + _NUMBERS, _ABOVE + _ROW * count + _BELOW
    title = f"{robot}: {repetitions.count} repetitions in simulation and the predicted intervals"
    figure = figure_of(width, height, title, text=height)
    ax = figure.subplots()
    tidy(ax)
    ax.grid(False, axis="y")
    errors = relative_errors(repetitions)
    _draw(ax, errors, repetitions.seed)
    ax.set_yticks(np.arange(count), [typeset(name) for name in repetitions.names], fontsize=NOTE)
    ax.tick_params(axis="y", length=0)
    ax.set_ylim(count - 0.5, -0.5)
    ax.set_xlabel("(estimate less true value) / half-width of the predicted interval", fontsize=LABEL, color=DARK)
    if column_width() > _NUMBERS + _LEAST_NAMES:  # else the numbers have no room
        _write_numbers(ax, repetitions)
    legend_below(figure, _legend(repetitions.count))
    return figure


def relative_errors(repetitions: Repetitions) -> Array:
    """``(estimate - true value) / (t s)`` with the predicted deviation s of all repetitions, shape (R, b).

    t is the quantile of Student's distribution that makes ``t s`` half the width of a 99 % interval.
    """
    quantile = scipy.stats.t.ppf(0.5 + CONFIDENCE / 2, repetitions.degrees_of_freedom)
    half = quantile * repetitions.predicted_deviation
    error = repetitions.estimates - repetitions.beta
    return np.asarray(np.divide(error, half, out=np.full(error.shape, np.nan), where=half > 0))


def write_repetitions_figure(
    repetitions: Repetitions,
    robot: str,
    folder: str | Path,
    *,
    formats: str | Sequence[str] = ("png",),
    width: str = "screen",
) -> list[Path]:
    """Draw repetitions and write ``repetitions.png`` atomically into the folder of their result."""
    return write_figure_files(
        lambda: {FIGURE: repetitions_figure(repetitions, robot)}, folder, "result", formats=formats, width=width
    )


def _draw(ax: Axes, errors: Array, seed: int) -> None:
    ax.axvspan(-1.0, 1.0, color=BAND, linewidth=0.0)
    ax.axvline(0.0, color=DARK, linewidth=0.6)
    known = errors[np.isfinite(errors)]
    most = float(np.clip(1.1 * np.abs(known).max(initial=0.0), _LEAST, _MOST))
    heights = np.random.default_rng(seed).uniform(-0.3, 0.3, errors[:DOTS].shape)
    for k, column in enumerate(errors.T):
        if not np.all(np.isfinite(column)):
            continue
        ax.plot(np.clip(column[:DOTS], -most, most), k + heights[:, k], ".", color=BLUE, markersize=2.0, alpha=0.5)
        ax.plot(np.clip(np.percentile(column, _ENDS), -most, most), [k, k], color=DARK, linewidth=1.4)
        ax.plot(np.clip([np.mean(column)], -most, most), [k], "|", color=DARK, markersize=9.0, markeredgewidth=1.6)
    ax.set_xlim(-most, most)


def _write_numbers(ax: Axes, r: Repetitions) -> None:
    style: dict[str, Any] = {"textcoords": "offset points", "va": "center", "ha": "right", "fontsize": NOTE}
    above: dict[str, Any] = {**style, "xycoords": "axes fraction", "va": "bottom", "fontsize": LABEL, "color": DARK}
    deviations = [typeset(f"{significant(float(d), 2)} {unit}") for d, unit in zip(r.deviation, r.units, strict=True)]
    predicted = [typeset(significant(float(d), 2)) for d in r.predicted_deviation]
    shares = [f"{100 * float(share):.1f} %" for share in r.coverage]
    few = scipy.stats.binom.cdf(np.round(r.coverage * r.count), r.count, CONFIDENCE) < _UNLIKELY
    columns = (("predicted", predicted), ("deviation", deviations), ("contained", shares))
    for (heading, texts), place in zip(columns, _PLACES, strict=True):
        ax.annotate(heading, (1.0, 1.0), (place, 6), **above)
        for k, text in enumerate(texts):
            marked = bool(few[k]) and texts is shares
            colour, weight = (VERMILLION, "bold") if marked else (DARK, "normal")
            ax.annotate(text, (1.0, k), (place, 0), xycoords=_BESIDE, color=colour, fontweight=weight, **style)


def _legend(count: int) -> Sequence[Line2D | Patch]:
    dots = "a repetition" if count <= DOTS else f"one of the first {DOTS}"
    return [
        Line2D([], [], color=BLUE, marker=".", markersize=4.0, linestyle="", label=dots),
        Line2D([], [], color=DARK, linewidth=1.4, label="99 % of all"),
        Line2D([], [], color=DARK, marker="|", markersize=9.0, markeredgewidth=1.6, linestyle="", label="mean"),
        Patch(color=BAND, label="predicted 99 % interval"),
    ]
