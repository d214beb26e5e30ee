"""Figures of searches: how starts converge, robot time against precision, the cells of a sweep."""

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
from excite.design.sweeps.sweep_table import SweepRow, SweepTable
from excite.information.matrix import CONVENTIONS
from excite.information.precision_forecast import ParameterPrecision, PrecisionForecast, PrecisionSearch
from excite.information.weighting import minimised_text
from excite.logs.log import counted
from excite.registry import name_of
from excite.views.panels import Panel, alike, bar_panel, ends, head, legend_below
from excite.views.style import (
    BLUE,
    COLOURS,
    DARK,
    GREY,
    LABEL,
    LETTER,
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
    size_of,
)
from regressors.errors import InputError
from regressors.robot.columns import COULOMB

_MANY = 12  # number of other starts above which their lines are thinner
_SYMBOLS = {
    "condition": "cond(W)",
    "frobenius": "Frobenius cond(W)",
    "sigma-min": "1 / smallest singular value of W / √N",
    "logdet": "det(W'W / N)^(-1/2b)",
    "trace": "√ tr (W'W / N)^-1",
}
_MEASURES = {  # by the base
    "gautier": "condition_number",
    "pivoted": "condition_number_pivoted",
    "orthonormal": "condition_number_orthonormal",
}


def convergence_figure(design: Design) -> Figure:
    """Draw the objective at every accepted iterate and the best so far, for all starts."""
    unfinished = sum(start.status == RUNNING for start in design.starts)
    title = f"{design.robot.name}: search from {counted(design.number_of_starts, 'start')}"
    figure = figure_of(9.5, 5.4, f"{title} ({unfinished} unfinished)" if unfinished else title, text=1.2)
    ax = figure.subplots()
    best = next(start for start in design.starts if start.index == design.best_start)
    others = [start for start in design.starts if start is not best]
    thin = 1.0 if len(others) <= _MANY else 0.5
    _draw_starts(ax, [start for start in others if start.status != RUNNING], GREY, thin, 2.0)
    _draw_starts(ax, [start for start in others if start.status == RUNNING], GREY, thin, 2.0)
    _draw_starts(ax, [best], BLUE, 2.0, 3.0)
    _name_end(ax, best)
    _scale(ax, design.starts)
    name = name_of(design.task.objective.criterion)
    symbol = _SYMBOLS.get(name, name)
    ax.set_xlabel("accepted iterate", fontsize=LABEL, color=DARK)
    ax.set_ylabel(f"{symbol} in the solver", fontsize=LABEL, color=DARK)
    _explain(ax, _explanation(design, best))
    if column_width() < float("inf"):  # no room in the panel
        legend_below(figure, _legend(design))
    else:
        ax.legend(handles=_legend(design), loc="upper right", fontsize=NOTE, framealpha=0.9)
    return figure


def _draw_starts(ax: Axes, starts: Sequence[StartResult], colour: str, width: float, order: float) -> None:
    """Draw starts that have ended, or have not, as curves with a gap after each start."""
    if not starts:
        return
    histories = [np.append(start.history, np.nan) for start in starts]
    iterate = np.concatenate([np.append(np.arange(each.size - 1.0), np.nan) for each in histories])
    both = np.hstack([[each, np.minimum.accumulate(each)] for each in histories])
    history, lowest = np.where(np.isfinite(both), both, np.nan)
    last = np.cumsum([each.size for each in histories]) - 2
    ax.plot(iterate, history, ":", color=colour, linewidth=0.9, zorder=order - 0.5)
    ax.plot(iterate, lowest, color=colour, linewidth=width, zorder=order)
    dot: dict[str, Any] = {"markersize": 4.5, "markerfacecolor": "white" if starts[0].status == RUNNING else colour}
    ax.plot(iterate[last], lowest[last], "o", color=colour, zorder=order, **dot)


def _name_end(ax: Axes, start: StartResult) -> None:
    """Write the best value below the end of the start's line, where there are few other lines."""
    value = float(np.min(start.history))
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


def _explanation(design: Design, best: StartResult) -> str:
    """Text of what is minimised, and of the best start's final value as reported."""
    objective = design.task.objective
    as_measured = not objective.weighted and objective.prior is None and not objective.after
    plain = as_measured and objective.scale == "unit" and not objective.interest
    measure = _MEASURES.get(objective.base) if plain and name_of(objective.criterion) == "condition" else None
    if measure is None:
        return f"minimised: {minimised_text(design.task)}; best start {significant(best.value, 4)}"
    solver = significant(min(best.history), 4)
    smoothed = any(column.kind == COULOMB for column in design.target.model.standard_columns)
    soft = " (with smoothed friction signs)" if smoothed else ""
    written = f"{significant(design.criteria[measure], 4)} in the written file ({design.task.output.rate:g} Hz)"
    return f"minimised: {CONVENTIONS[measure]}\nbest start: {solver} in the solver{soft}, {written}"


def _legend(design: Design) -> list[Line2D]:
    handles = [Line2D([], [], color=BLUE, linewidth=2.0, label=f"best start (number {design.best_start}): best so far")]
    if len(design.starts) > 1:
        handles.append(Line2D([], [], color=GREY, linewidth=1.0, label="other starts: best so far"))
    handles.append(Line2D([], [], color=DARK, linestyle=":", linewidth=0.9, label="objective at each iterate"))
    if any(start.status == RUNNING for start in design.starts):
        dot: dict[str, Any] = {"marker": "o", "markersize": 4.5, "markerfacecolor": "white", "linestyle": ""}
        handles.append(Line2D([], [], color=DARK, label="unfinished", **dot))
    return handles


_MOST_PARAMETERS = 30
_LEAST = 3.0  # width of a panel with its names [in]


def precision_figure(design: Design) -> Figure:
    """Draw robot time against precision, and the half-width of each parameter over the allowed one."""
    search, forecast = design.precision_search, design.precision
    if search is None or forecast is None:
        raise InputError("no precision was sought for this design; `design_for_precision` seeks one")
    asked = sorted((p for p in forecast.parameters if p.allowed is not None), key=lambda p: -p.use)
    runs = f"{counted(forecast.runs, 'run')} of {forecast.seconds:.4g} s"
    title = f"{design.robot.name}: {runs}, {forecast.robot_seconds:.4g} s of robot time"
    height = max(4.8, 1.6 + 0.2 * min(len(asked), _MOST_PARAMETERS))
    if columns_that_fit(2, _LEAST) == 2:
        figure = figure_of(12.5, height, title, text=height)
        left, right = figure.subplots(1, 2, width_ratios=(1.4, 1.0))
    else:
        figure = figure_of(6.0, 4.8 + height, title, text=height)
        left, right = figure.subplots(2, 1, height_ratios=(3.0, height))
    _draw_front(left, search, forecast, max(design.task.objective.max_time, forecast.robot_seconds))
    _draw_parameters(right, forecast, asked)
    return figure


def _draw_front(ax: Axes, search: PrecisionSearch, forecast: PrecisionForecast, longest: float) -> None:
    for trial in search.trials:
        seconds, use = [n * trial.seconds for n, _ in trial.course], [use for _, use in trial.course]
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


def _draw_parameters(ax: Axes, forecast: PrecisionForecast, asked: Sequence[ParameterPrecision]) -> None:
    shown = asked[:_MOST_PARAMETERS]
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
    _explain(ax, f"{100 * forecast.level:g} % intervals, with probability {100 * forecast.probability:g} %{more}")


def _explain(ax: Axes, text: str) -> None:
    ax.set_title(plain(broken(text, panel_width(ax), "axes.labelsize")), loc="left", y=1.0, fontsize=LABEL, color=DARK)


FIGURE = "campaign"
_MOST_PANELS, _COLUMNS, _MOST_LABELS, _LETTERS = 6, 3, 12, 14
_PANEL = Panel((4.2,), 2.9, between=0.95, below=1.35)
_ROOM = 1.15  # above the largest and below the smallest condition number
_RANGE = 1e3  # of condition numbers that are told apart
_WHOLE = "cell"


def sweep_figure(table: SweepTable) -> Figure:
    """Draw the condition number of every designed cell over the values of each option that varies."""
    names = list(table.often_varied)[:_MOST_PANELS] or [_WHOLE]
    columns = 2 if len(names) == 4 else min(_COLUMNS, len(names))
    designed = sum(bool(row.group) for row in table.rows)
    figure, flat, _ = alike(len(names), columns, _PANEL, f"sweep: {designed} of {len(table.rows)} cells designed")
    for ax, name in zip(flat, names, strict=True):
        _draw(ax, table, name)
    shown = list(table.groups)[: len(COLOURS)]
    handles = [_handle(table.groups[group][0], group) for group in shown]
    if len(table.groups) > len(shown):
        handles.append(Line2D([], [], color=GREY, marker=".", linestyle="", label="other groups"))
    if handles:
        legend_below(figure, handles)
    return figure


def _value(row: SweepRow, name: str) -> str:
    """Value of an option, empty in rows without it."""
    return row.cell if name == _WHOLE else row.options.get(name, "")


def _draw(ax: Axes, table: SweepTable, name: str) -> None:
    values = list(dict.fromkeys(_value(row, name) for row in table.rows))
    place = {value: k for k, value in enumerate(values)}
    groups, conditions = table.groups, [row.condition for row in table.rows if np.isfinite(row.condition)]
    top = _RANGE * min(conditions, default=1.0)
    for k, (group, rows) in enumerate(groups.items()):
        aside = 0.5 * ((k + 0.5) / len(groups) - 0.5)
        x = np.array([place[_value(row, name)] for row in rows], dtype=float)
        y = np.minimum([row.condition for row in rows], top)
        beyond, kept = y >= top, np.isfinite(y)
        spread = np.random.default_rng(0).uniform(-0.2, 0.2, x.size) / len(groups)
        for drawn, marker in ((kept & ~beyond, "."), (kept & beyond, "^")):
            ax.plot((x + aside + spread)[drawn], y[drawn], marker, color=_colour(group), markersize=4.0, alpha=0.6)
        for at in np.unique(x[kept]) if name != _WHOLE else ():
            middle = float(np.median(y[kept & (x == at)]))
            ends_of_dash = [at + aside - 0.25 / len(groups), at + aside + 0.25 / len(groups)]
            ax.plot(ends_of_dash, [middle, middle], color=DARK, linewidth=1.4)
    if conditions:
        log_scale(ax.yaxis, min(conditions) / _ROOM, min(max(conditions), top) * _ROOM)
    ax.set_xlim(-0.5, len(values) - 0.5)
    ax.grid(False, axis="x")
    ax.set_ylabel("condition number", fontsize=LABEL, color=DARK)
    _write_values(ax, table, name, values)
    head(ax, f"by {name}")


def _write_values(ax: Axes, table: SweepTable, name: str, values: list[str]) -> None:
    step = -(-len(values) // _MOST_LABELS)
    missing = {value: sum(not row.group for row in table.rows if _value(row, name) == value) for value in values}
    labels = [
        plain(ends(value or "not given", _LETTERS) + (f"\n{missing[value]} without" if missing[value] else ""))
        for value in values[::step]
    ]
    longest = sum(max(map(len, label.split("\n"))) + 2 for label in labels)
    crowded = longest * LETTER * size_of("xtick.labelsize") > 72.0 * panel_width(ax)
    ax.set_xticks(
        range(0, len(values), step), labels, fontsize=NOTE,
        rotation=30 if crowded else 0, ha="right" if crowded else "center",
    )  # fmt: skip


def _colour(group: int) -> str:
    return COLOURS[group - 1] if group <= len(COLOURS) else GREY


def _handle(row: SweepRow, group: int) -> Line2D:
    assert row.facts is not None
    label = f"group {group}: {row.facts.robot}, {row.facts.model}, {row.facts.parameters} parameters"
    return Line2D([], [], color=_colour(group), marker=".", markersize=6.0, linestyle="", label=plain(label))
