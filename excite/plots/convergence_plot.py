"""Convergence of the search: the objective over the iterations of every start."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from excite.design.design import Design
from excite.design.start_results import RUNNING, StartResult
from excite.information.metrics import CONVENTIONS
from excite.information.weighting import minimised_text
from excite.plots.panels import legend_below
from excite.plots.style import (
    BLUE,
    DARK,
    GREY,
    LABEL,
    NOTE,
    ROUND,
    broken,
    column_width,
    figure_of,
    log_scale,
    plain,
    significant,
    tidy,
)
from excite.registry import name_of
from regressors.models.columns import COULOMB
from regressors.samples import Array

_MANY = 12  # number of other starts above which their lines are thinner
_SYMBOLS = {
    "condition": "cond(W)",
    "frobenius": "Frobenius cond(W)",
    "sigma-min": "1 / smallest singular value of W / √N",
    "logdet": "det(W'W / N)^(-1/2b)",
    "trace": "√ tr (W'W / N)^-1",
}
_MEASURES = {
    ("condition", "gautier"): "condition_number",
    ("condition", "pivoted"): "condition_number_pivoted",
    ("condition", "orthonormal"): "condition_number_orthonormal",
}


def convergence_figure(design: Design) -> Figure:
    """Draw the objective at every accepted iterate and the best so far, for all starts."""
    figure = figure_of(9.5, 5.4, _title(design), text=1.2)
    ax = figure.subplots()
    tidy(ax)
    others = [start for start in design.starts if start.index != design.best_start]
    best = [start for start in design.starts if start.index == design.best_start]
    thin = 1.0 if len(others) <= _MANY else 0.5
    for start in others:
        _draw_start(ax, start, GREY, thin, order=2.0)
    for start in best:
        _draw_start(ax, start, BLUE, 2.0, order=3.0)
        _name_end(ax, start)
    _scale(ax, design.starts)
    name = name_of(design.task.objective.criterion)
    symbol = _SYMBOLS.get(name, name)
    ax.set_xlabel("accepted iterate", fontsize=LABEL, color=DARK)
    ax.set_ylabel(f"{symbol} in the solver", fontsize=LABEL, color=DARK)
    explanation = broken(_explanation(design), 0.8 * figure.get_figwidth(), "axes.labelsize")
    ax.set_title(plain(explanation), loc="left", y=1.0, fontsize=LABEL, color=DARK)
    if column_width() < float("inf"):  # no room in the panel
        legend_below(figure, _legend(design))
    else:
        ax.legend(handles=_legend(design), loc="upper right", fontsize=NOTE, framealpha=0.9)
    return figure


def running_minimum(history: Sequence[float]) -> Array:
    """Best value so far at every iterate."""
    return np.asarray(np.minimum.accumulate(np.asarray(history, dtype=float)))


def _drawable(values: Array) -> Array:
    return np.where(np.isfinite(values), values, np.nan)


def _draw_start(ax: Axes, start: StartResult, colour: str, width: float, order: float) -> None:
    history, lowest = _drawable(np.asarray(start.history)), _drawable(running_minimum(start.history))
    iterate = np.arange(history.size)
    ax.plot(iterate, history, ":", color=colour, linewidth=0.9, zorder=order - 0.5)
    ax.plot(iterate, lowest, color=colour, linewidth=width, zorder=order)
    face = "white" if start.status == RUNNING else colour
    ax.plot(iterate[-1:], lowest[-1:], "o", color=colour, markerfacecolor=face, markersize=4.5, zorder=order)


def _name_end(ax: Axes, start: StartResult) -> None:
    """Write the best value below the end of the start's line, where there are few other lines."""
    value = float(running_minimum(start.history)[-1])
    style: dict[str, Any] = {"fontsize": NOTE, "fontweight": "bold", "color": BLUE, "zorder": 4.0}
    style["path_effects"] = [withStroke(linewidth=2.5, foreground="white")]
    ax.annotate(significant(value, 4), (len(start.history) - 1, value), (0, -13), textcoords="offset points", **style)


def _scale(ax: Axes, starts: Sequence[StartResult]) -> None:
    """Set a logarithmic scale, unless the objective is not positive."""
    values = np.concatenate([np.asarray(start.history, dtype=float) for start in starts])
    values = values[np.isfinite(values)]
    if values.size and values.min() > 0.0:
        low, high = float(values.min()), float(values.max())
        room = (1.3 * high / low) ** 0.06
        log_scale(ax.yaxis, low / room**2, high * room)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True, steps=ROUND))
    ax.set_xlim(0.0, 1.06 * max(len(start.history) for start in starts))


def _title(design: Design) -> str:
    count = design.number_of_starts
    unfinished = sum(start.status == RUNNING for start in design.starts)
    stopped = f" ({unfinished} unfinished)" if unfinished else ""
    return f"{design.robot.name}: search from {count} start{'s' if count != 1 else ''}{stopped}"


def _explanation(design: Design) -> str:
    """Text of what is minimised, and of the best start's final value as reported."""
    objective = design.task.objective
    as_measured = not objective.weighted and objective.prior is None and not objective.after
    plain = as_measured and objective.scale == "unit" and not objective.interest
    measure = _MEASURES.get((name_of(objective.criterion), objective.base)) if plain else None
    best = next(start for start in design.starts if start.index == design.best_start)
    if measure is None:
        return f"minimised: {minimised_text(design.task)}; best start {significant(best.value, 4)}"
    solver = significant(min(best.history), 4)
    soft = " (with smoothed friction signs)" if _smoothed(design) else ""
    written = f"{significant(design.criteria[measure], 4)} in the written file ({design.task.output.rate:g} Hz)"
    return f"minimised: {CONVENTIONS[measure]}\nbest start: {solver} in the solver{soft}, {written}"


def _smoothed(design: Design) -> bool:
    """Whether the model has Coulomb friction, whose sign is smooth for the solver."""
    return any(column.kind == COULOMB for column in design.target.model.standard_columns)


def _legend(design: Design) -> list[Line2D]:
    handles = [Line2D([], [], color=BLUE, linewidth=2.0, label=f"best start (number {design.best_start}): best so far")]
    if len(design.starts) > 1:
        handles.append(Line2D([], [], color=GREY, linewidth=1.0, label="other starts: best so far"))
    handles.append(Line2D([], [], color=DARK, linestyle=":", linewidth=0.9, label="objective at each iterate"))
    if any(start.status == RUNNING for start in design.starts):
        dot: dict[str, Any] = {"marker": "o", "markersize": 4.5, "markerfacecolor": "white", "linestyle": ""}
        handles.append(Line2D([], [], color=DARK, label="unfinished", **dot))
    return handles
