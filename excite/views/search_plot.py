"""The search: the objective over the iterations of every start, and robot time against precision."""

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
from excite.information.half_widths import PrecisionForecast
from excite.information.matrix import CONVENTIONS
from excite.information.weighting import minimised_text
from excite.registry import name_of
from excite.study.period_search import PeriodTrial, PrecisionSearch
from excite.views.bars import bar_panel
from excite.views.panels import legend_below
from excite.views.style import (
    BLUE,
    DARK,
    GREY,
    LABEL,
    NOTE,
    ROUND,
    VERMILLION,
    broken,
    column_width,
    columns_that_fit,
    figure_of,
    log_scale,
    panel_width,
    plain,
    significant,
    tidy,
)
from regressors.errors import InputError
from regressors.robot.columns import COULOMB
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


_MOST_RUNS = 200
_MOST_PARAMETERS = 30
_LEAST = 3.0  # width of a panel with its names [in]


def precision_figure(design: Design) -> Figure:
    """Draw robot time against precision, and the half-width of each parameter over the allowed one."""
    _, forecast = _of(design)
    shown = sorted((p for p in forecast.parameters if p.allowed is not None), key=lambda p: -p.use)[:_MOST_PARAMETERS]
    title = f"{design.robot.name}: {_runs(forecast)}, {forecast.robot_seconds:.4g} s of robot time"
    height = max(4.8, 1.6 + 0.2 * len(shown))
    if columns_that_fit(2, _LEAST) == 2:
        figure = figure_of(12.5, height, title, text=height)
        left, right = figure.subplots(1, 2, width_ratios=(1.4, 1.0))
    else:
        figure = figure_of(6.0, 4.8 + height, title, text=height)
        left, right = figure.subplots(2, 1, height_ratios=(3.0, height))
    _draw_front(left, design)
    _draw_parameters(right, forecast, len(shown))
    return figure


def _of(design: Design) -> tuple[PrecisionSearch, PrecisionForecast]:
    if design.precision_search is None or design.precision is None:
        raise InputError("no precision was sought for this design; `design_for_precision` seeks one")
    return design.precision_search, design.precision


def _runs(forecast: PrecisionForecast) -> str:
    return f"{forecast.runs} run{'s' * (forecast.runs > 1)} of {forecast.seconds:.4g} s"


def _draw_front(ax: Axes, design: Design) -> None:
    search, forecast = _of(design)
    tidy(ax)
    longest = max(design.task.objective.max_time, forecast.robot_seconds)
    for trial in search.trials:
        seconds, use = _points(trial, longest)
        ax.plot(seconds, use, "-", color=GREY, alpha=0.4, linewidth=0.8, zorder=1.5)
        ax.plot(seconds, use, ".", color=GREY, markersize=3.0, zorder=1.6)
    times = [point.robot_seconds for point in search.front]
    ax.step([*times, longest], [*(p.use for p in search.front), search.front[-1].use], where="post", color=BLUE)
    ax.axhline(1.0, color=DARK, linewidth=0.8, linestyle="--")
    ax.plot([forecast.robot_seconds], [forecast.worst.use], "D", color=VERMILLION, markersize=6.0, zorder=4.0)
    uses = [point.use for point in search.front]
    log_scale(ax.xaxis, 0.8 * min(times), 1.25 * longest)
    log_scale(ax.yaxis, 0.7 * min(*uses, 1.0), 1.4 * max(*uses, 1.0))
    ax.set_xlabel("robot time [s]", fontsize=LABEL, color=DARK)
    ax.set_ylabel("widest half-width / allowed", fontsize=LABEL, color=DARK)
    text = (
        "front of robot time against precision; below the dashed line the target is met\n"
        "each grey line is a period, the diamond the experiment that was chosen"
    )
    _explain(ax, text)


def _points(trial: PeriodTrial, longest: float) -> tuple[list[float], list[float]]:
    """Robot times and uses of the numbers of runs of a period."""
    most = min(_MOST_RUNS, max(1, int(longest / trial.seconds)))
    runs = np.unique(np.geomspace(1, most, 40).round().astype(int)).tolist()
    return [n * trial.seconds for n in runs], [trial.run.use(n) for n in runs]


def _draw_parameters(ax: Axes, forecast: PrecisionForecast, count: int) -> None:
    asked = sorted((p for p in forecast.parameters if p.allowed is not None), key=lambda p: -p.use)
    shown = asked[:count]
    colours = [VERMILLION if p.use > 1.0 else BLUE for p in shown]
    ax.barh(range(len(shown)), [p.use for p in shown], height=0.62, color=colours)
    ax.axvline(1.0, color=DARK, linewidth=0.8, linestyle="--")
    bar_panel(ax, -0.6, len(shown) - 0.4, range(len(shown)), [p.name for p in shown])
    widest = max(p.use for p in shown)
    if widest > 10.0:
        log_scale(ax.xaxis, 0.5 * min(p.use for p in shown), 1.3 * widest)
    else:
        ax.set_xlim(0.0, 1.15 * max(widest, 1.0))
    ax.set_xlabel("half-width / allowed", fontsize=LABEL, color=DARK)
    left_out = len(asked) - len(shown)
    more = f"; {left_out} more are narrower" if left_out else ""
    text = f"{100 * forecast.level:g} % intervals, with probability {100 * forecast.probability:g} %{more}"
    _explain(ax, text)


def _explain(ax: Axes, text: str) -> None:
    ax.set_title(plain(broken(text, panel_width(ax), "axes.labelsize")), loc="left", y=1.0, fontsize=LABEL, color=DARK)
