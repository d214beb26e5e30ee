"""Robot time against precision: what each period reaches with its runs, and the front of all."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from excite.design.design import Design
from excite.information.precision_forecast import PrecisionForecast
from excite.plots.style import (
    BLUE,
    DARK,
    GREY,
    LABEL,
    NOTE,
    VERMILLION,
    broken,
    columns_that_fit,
    figure_of,
    log_scale,
    panel_width,
    plain,
    tidy,
)
from excite.study.period_search import PeriodTrial, PrecisionSearch
from regressors.errors import InputError

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
    tidy(ax)
    ax.grid(False, axis="y")
    colours = [VERMILLION if p.use > 1.0 else BLUE for p in shown]
    ax.barh(range(len(shown)), [p.use for p in shown], height=0.62, color=colours)
    ax.axvline(1.0, color=DARK, linewidth=0.8, linestyle="--")
    ax.set_yticks(range(len(shown)), [plain(p.name) for p in shown], fontsize=NOTE)
    ax.set_ylim(len(shown) - 0.4, -0.6)
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
