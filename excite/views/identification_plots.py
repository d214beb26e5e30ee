"""Figures of identifications: torques, residuals, and estimates over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from excite.identification.estimator import Estimate
from excite.identification.identification import Identification
from excite.identification.prediction import with_measured_side
from excite.identification.result import ReferenceValues
from excite.study.time_study import TimeStudy
from excite.views.panels import Panel, Timeline, alike, fit_panels, head, left_out, legend_below, panels, value_axis
from excite.views.style import (
    BAND,
    BLUE,
    COLOURS,
    DARK,
    GREY,
    LABEL,
    SKY,
    VERMILLION,
    log_scale,
    padded,
    plain,
    significant,
)
from regressors.errors import InputError
from regressors.samples import Array, Index

# light and thick: seen beside the other
MEASURED: dict[str, Any] = {"color": "#BBBBBB", "linewidth": 3.2, "solid_joinstyle": "round"}
PREDICTED: dict[str, Any] = {"color": BLUE, "linewidth": 1.0}
BINS = 400  # at most, over all logs
DENSE = 1600  # values of all logs from which on they are drawn as bands
_FULL = 25  # values in a bin
PERCENTILES = (0.0, 5.0, 50.0, 95.0, 100.0)
_CURVE = 0.8  # width of a curve [pt]
_ALL = "#D9D9D9"
_QUANTITIES = {"Nm": "torque", "N": "force", "J": "work", "N s": "impulse", "Nm s": "angular impulse"}
_LARGE = 0.5  # relative error above which the note is highlighted


Rows = tuple[Array, Index, Array, Array]  # time, log, measured and predicted value of each row of an equation


def fit_figure(
    title: str, logs: Sequence[str], equations: Sequence[tuple[str, str]], rows: Sequence[Rows], label: str
) -> Figure:
    """Draw measured values, predicted ones on top of them, and their difference in a panel below, on its own scale."""
    figure, panels = fit_panels(len(equations), title)
    times, of_logs, *_ = map(np.concatenate, zip(*rows, strict=True))
    timeline = Timeline.of(logs, times, of_logs)
    for (upper, lower), (name, unit), (time, log, measured, predicted) in zip(panels, equations, rows, strict=True):
        upper.plot(*timeline.curve(time, log, measured), **MEASURED)
        upper.plot(*timeline.curve(time, log, predicted), **PREDICTED)
        lower.axhline(0.0, color=GREY, linewidth=0.6)
        draw_values(lower, timeline, time, log, measured - predicted)
        timeline.dress(upper, bottom=False)
        timeline.dress(lower, bottom=lower is panels[-1][1])
        value_axis(upper, f"{_QUANTITIES.get(unit, 'value')} [{unit}]")
        value_axis(lower, f"residual\n[{unit}]", 3)
        head(upper, name, *error_note(measured, predicted, unit))
    both = [Line2D([], [], **MEASURED, label="measured"), Line2D([], [], **PREDICTED, label=label)]
    legend_below(figure, [*both, *values_legend(max(time.size for time, *_ in rows))])
    return figure


def envelope(values: Array, bins: int) -> tuple[Index, Array]:
    """Least value, 5th, 50th and 95th percentile and largest value of each of ``bins`` stretches."""
    width = -(-values.size // bins)
    parts = np.pad(np.where(np.isfinite(values), values, np.nan), (0, -values.size % width), constant_values=np.nan)
    parts = parts.reshape(-1, width)
    known, bands = np.isfinite(parts), np.percentile(parts, PERCENTILES, axis=1)
    for k in np.flatnonzero(known.any(axis=1) & ~known.all(axis=1)):
        bands[:, k] = np.percentile(parts[k, known[k]], PERCENTILES)
    return np.minimum(np.arange(len(parts) + 1) * width, values.size), bands


def draw_values(ax: Axes, timeline: Timeline, time: Array, log: Index, values: Array) -> None:
    """Draw values of several logs: curves, or bands where a log has many."""
    if values.size < DENSE:
        ax.plot(*timeline.curve(time, log, values), color=DARK, linewidth=_CURVE)
        return
    logs = (np.flatnonzero(log == k) for k in range(len(timeline.names)))
    for own in (part for rows in logs for part in np.split(rows, left_out(time[rows]) + 1) if part.size):
        t, v = time[own] + timeline.offsets[log[own]], values[own]
        edges, bands = envelope(v, max(1, min(round(BINS * v.size / values.size), v.size // _FULL)))
        places = np.repeat(np.append(t[edges[:-1]], t[-1]), 2)[1:-1]
        low, lower, middle, upper, high = np.repeat(bands, 2, axis=1)
        ax.fill_between(places, low, high, color=_ALL, linewidth=0.0)
        ax.fill_between(places, lower, upper, color=SKY, linewidth=0.0)
        ax.plot(places, middle, color=DARK, linewidth=_CURVE)


def values_legend(count: int) -> list[Artist]:
    """Entries of a legend for what `draw_values` draws."""
    if count < DENSE:
        return [Line2D([], [], color=DARK, linewidth=_CURVE, label="residual")]
    return [
        Line2D([], [], color=DARK, linewidth=_CURVE, label="median of the residuals"),
        Patch(color=SKY, label="90 % of the residuals"),
        Patch(color=_ALL, label="all of them"),
    ]


def relative_error(measured: Array, predicted: Array) -> str:
    """``||y - y_predicted|| / ||y||`` in percent; a text where all measured values are zero."""
    size = float(np.linalg.norm(measured))
    return f"{significant(100 * float(np.linalg.norm(measured - predicted)) / size, 3)} %" if size > 0 else "undefined"


def error_note(measured: Array, predicted: Array, unit: str) -> tuple[str, str]:
    """Error of one equation as text, and the text's colour."""
    rms, size = (float(np.sqrt(np.mean(x**2))) for x in (measured - predicted, measured))
    if size == 0:
        return f"rms error {significant(rms, 3)} {unit}, measured zero throughout", DARK
    error = f"rms error {significant(rms, 3)} {unit} of {significant(size, 3)} {unit}"
    return f"{error}: {relative_error(measured, predicted)}", VERMILLION if rms > _LARGE * size else DARK


_WHITE = 2.5758  # standard deviations that 99 % of white noise's autocorrelations stay within
_LAGS = 0.1  # of the longest log
_ALIKE = 0.01  # relative; logs whose sample times differ by less share an axis of lags in seconds


def torques_figure(result: Identification) -> Figure:
    """Draw measured and predicted values of the equations over time."""
    c = result.curves
    size = np.asarray(np.bincount(c.equation, c.measured**2, len(result.equations)), dtype=float)
    judged = with_measured_side(result.equations, size)[c.equation]
    error = relative_error(c.measured[judged], c.predicted[judged])
    title = f"{result.robot.name}: measured and predicted, relative error {error} over all equations"
    shown = np.unique(c.equation)  # a joint that rests has no rows
    of_equation = (c.equation == j for j in shown)
    rows = [(c.time[own], c.log[own], c.measured[own], c.predicted[own]) for own in of_equation]
    equations = [result.equations[j] for j in shown]
    return fit_figure(title, result.log_names, equations, rows, "predicted by the estimate")


def residuals_figure(result: Identification) -> Figure:
    """Draw the residuals of the equations over time, and their autocorrelation.

    ``r_k = mean(e_t e_{t+k}) / mean(e_t^2)``, with the residual e of each log divided by its root mean square.
    """
    curves, shown = result.curves, np.unique(result.curves.equation)
    residual = curves.measured - curves.predicted
    timeline = Timeline.of(result.log_names, curves.time, curves.log)
    count = len(shown)
    title = f"{result.robot.name}: residuals, measured less predicted by the estimate"
    figure, rows = panels(count, Panel((7.6, 3.4), 1.3 if count > 1 else 3.0, left=0.85), title)
    lags = max(1, int(_LAGS * min(int(np.bincount(curves.log[curves.equation == j]).max()) for j in shown)))
    for j, (over_time, over_lag) in zip(shown, rows, strict=True):
        (name, unit), own = result.equations[j], curves.equation == j
        time, log, e = curves.time[own], curves.log[own], residual[own]
        over_time.axhline(0.0, color=GREY, linewidth=0.6)
        draw_values(over_time, timeline, time, log, e)
        timeline.dress(over_time, bottom=j == shown[-1])
        value_axis(over_time, f"{_QUANTITIES.get(unit, 'value')} [{unit}]")
        rms, worst = (significant(float(x), 3) for x in (np.sqrt(np.mean(e**2)), np.abs(e).max()))
        head(over_time, name, f"rms {rms} {unit}, largest {worst} {unit}")
        _draw_autocorrelation(over_lag, time, log, e, lags, bottom=j == shown[-1])
    band = Patch(color=BAND, label="99 % of the autocorrelation of white noise")
    legend_below(figure, [*values_legend(int(np.bincount(curves.equation).max())), band])
    return figure


def autocorrelation(residual: Array, log: Index, lags: int) -> Array:
    """Autocorrelation of residuals of one equation within its logs, shape (lags + 1,)."""  # residual (m,); log (m,)
    total = np.zeros(lags + 1)
    for k in np.unique(log):
        e = residual[log == k]
        size = 1 << (e.size + lags).bit_length()
        products = np.fft.irfft(np.abs(np.fft.rfft(e, size)) ** 2, size)[: lags + 1]
        if products[0] > 0:
            total += products / products[0] * e.size
    return np.asarray(total / total[0]) if total[0] > 0 else np.zeros(lags + 1)


def _draw_autocorrelation(ax: Axes, time: Array, log: Index, residual: Array, lags: int, *, bottom: bool) -> None:
    values = autocorrelation(residual, log, lags)
    steps = np.array([np.median(np.diff(time[log == k])) for k in np.flatnonzero(np.bincount(log) > 1)])
    alike = steps.size > 0 and float(np.ptp(steps)) <= _ALIKE * float(steps.min())
    lag = np.arange(lags + 1) * (steps[0] if alike else 1.0)
    white = _WHITE / np.sqrt(residual.size)
    ax.axhspan(-white, white, color=BAND, linewidth=0)
    ax.axhline(0.0, color=DARK, linewidth=0.6)
    ax.plot(lag, values, color=BLUE, linewidth=1.2)
    ax.set_xlim(0.0, float(lag[-1]))
    ax.set_ylim(min(-0.25, 1.1 * float(values.min())), 1.05)
    value_axis(ax, "autocorrelation", 4)
    outside = float(np.mean(np.abs(values[1:]) > white))
    head(ax, "", f"{100 * outside:.0f} % of it outside the band")
    ax.tick_params(labelbottom=bottom)
    if bottom:
        ax.set_xlabel("lag [s]" if alike else "lag [rows]", fontsize=LABEL, color=DARK)


_FEW = 24  # parameters, above which panels are smaller
_LEAST = 1.15  # width of a panel with its numbers [in]
_SETTLED = 0.25  # of the instants, after which an estimate must be in view
_FAR = 6.0  # a reference further off than this many times the height of curve and band is not in view


def estimates_figure(result: Identification) -> Figure:
    """Draw every estimate over time, with its final 99 % interval."""
    estimate, reference = result.estimate, result.reference
    if estimate.history is None:
        raise InputError(f"the estimator {estimate.method} keeps no history of its estimates; recursive does")
    time, path = estimate.history
    pass_number = np.concatenate([[0], np.cumsum(np.diff(time) < 0)])  # times restart with the next log
    timeline = Timeline.of([""] * (int(pass_number[-1]) + 1), time, pass_number)
    count = len(estimate.names)
    panel = Panel((2.5 if count <= _FEW else 1.9,), 1.15, left=0.68, between=0.42, least=_LEAST)
    title = f"{result.robot.name}: estimates over time, {estimate.method}"
    figure, flat, _ = alike(count, 4 if count <= _FEW else 6, panel, title)
    lowest = flat[-len({ax.get_position().x0 for ax in flat}) :]
    known = np.full(count, np.nan) if reference is None else reference.values
    for k, ax in enumerate(flat):
        ax.plot(*timeline.curve(time, pass_number, path[:, k], whole=True), color=BLUE, linewidth=1.1, zorder=3)
        _draw_end(ax, estimate, k, float(known[k]), path[:, k])
        timeline.dress(ax, bottom=ax in lowest, numbers=5)
    legend_below(figure, _legend(reference))
    return figure


def _draw_end(ax: Axes, estimate: Estimate, k: int, known: float, path: Array) -> None:
    """Draw the final value, its interval and the reference, and set the vertical range."""
    value, half = float(estimate.values[k]), float(estimate.half_width[k])
    low, high = settled_range(path, value, half, known)
    note, colour = "", DARK
    if np.isfinite(value):
        ax.axhline(value, color=DARK, linewidth=0.8, zorder=2)
        if np.isfinite(half):
            ax.axhspan(value - half, value + half, color=BAND, linewidth=0, zorder=1)
    else:
        note, colour = "not shown", GREY
    if np.isfinite(known):
        ax.axhline(known, color=VERMILLION, linestyle=":", linewidth=1.3, zorder=2.5)
        if not low <= known <= high:
            arrow = "\N{UPWARDS ARROW}" if known > high else "\N{DOWNWARDS ARROW}"  # out of view
            note, colour = f"{arrow} {significant(known, 3)}", VERMILLION
    ax.set_ylim(low, high)
    value_axis(ax, "", 4)
    head(ax, f"{estimate.names[k]} [{estimate.units[k]}]", note, colour)


def settled_range(path: Array, value: float, half_width: float, known: float) -> tuple[float, float]:
    """Vertical range for an estimate's path."""  # path (k,)
    seen = path[int(_SETTLED * path.size) :]
    low, high = float(seen.min()), float(seen.max())
    if np.isfinite(value) and np.isfinite(half_width):
        low, high = min(low, value - half_width), max(high, value + half_width)
    if np.isfinite(known) and max(low - known, known - high) <= _FAR * (high - low):
        low, high = min(low, known), max(high, known)
    return padded(low, high, 0.1)


def _legend(reference: ReferenceValues | None) -> list[Artist]:
    handles: list[Artist] = [
        Line2D([], [], color=BLUE, linewidth=1.1, label="estimate"),
        Line2D([], [], color=DARK, linewidth=0.8, label="final value"),
        Patch(color=BAND, label="its 99 % interval"),
    ]
    if reference is not None:
        kind = {"truth": "true value"}.get(reference.kind, f"value of the {reference.kind}")
        handles.append(Line2D([], [], color=VERMILLION, linestyle=":", linewidth=1.3, label=kind))
    return handles


_HALF = 0.5  # of the time, after which estimates must be in view
_FAINT = 0.25


def estimates_over_time_figure(study: TimeStudy) -> Figure:
    """Draw every estimate over time, each motion in its colour."""
    names = tuple(dict.fromkeys(name for course in study.courses for name in course.names))
    few, count = len(names) <= _FEW, len(names) + 2
    panel, most = Panel((2.5 if few else 1.9,), 1.25, left=0.72, between=0.45, least=_LEAST), 4 if few else 6
    figure, flat, _ = alike(count, most, panel, f"{study.robot}: estimates over time", "time [s]")
    _draw_sizes(flat[0], study, [course.condition_number for course in study.courses], "cond(W)")
    shown = [course.relative_deviation[:, np.isfinite(course.values[-1])] for course in study.courses]
    _draw_sizes(flat[1], study, [each.max(axis=1, initial=0.0) for each in shown], "largest relative deviation")
    for name, ax in zip(names, flat[2:], strict=True):
        _draw_parameter(ax, study, name)
    motions = enumerate(plain(course.name) for course in study.courses)
    handles: list[Artist] = [Line2D([], [], color=_colour(k), linewidth=1.2, label=name) for k, name in motions]
    if any(course.reference_kind == "truth" for course in study.courses):
        handles.append(Line2D([], [], color=DARK, linestyle=":", linewidth=1.2, label="true value"))
    legend_below(figure, handles)
    return figure


def _colour(k: int) -> str:
    return COLOURS[k % len(COLOURS)]


def _draw_sizes(ax: Axes, study: TimeStudy, sizes: list[Array], title: str) -> None:
    """Draw one logarithmic curve per motion."""
    shown = np.concatenate(sizes)
    shown = shown[np.isfinite(shown) & (shown > 0)]
    for k, (course, size) in enumerate(zip(study.courses, sizes, strict=True)):
        ax.plot(course.time, np.where(np.isfinite(size) & (size > 0), size, np.nan), color=_colour(k), linewidth=1.2)
    if shown.size:
        log_scale(ax.yaxis, 0.8 * float(shown.min()), min(1.25 * float(shown.max()), 1e6 * float(shown.min())))
    head(ax, title)


def _draw_parameter(ax: Axes, study: TimeStudy, name: str) -> None:
    unit, ends = "", []
    for k, course in enumerate(study.courses):
        if name not in course.names:
            continue
        j = course.names.index(name)
        unit, value, half = course.units[j], course.values[:, j], course.half_width[:, j]
        if course.repeated is not None:
            ax.plot(course.time, course.repeated[:, :, j].T, color=_colour(k), linewidth=0.4, alpha=_FAINT, zorder=1)
        band = np.where(np.isfinite(half), half, np.nan)
        ax.fill_between(course.time, value - band, value + band, color=_colour(k), alpha=0.15, linewidth=0, zorder=2)
        ax.plot(course.time, value, color=_colour(k), linewidth=1.2, zorder=3)
        late = course.time >= _HALF * course.time[-1]
        ends += [*(value - band)[late], *(value + band)[late], *value[late]]
        if np.isfinite(course.reference[j]) and course.reference_kind == "truth":
            ax.axhline(course.reference[j], color=DARK, linestyle=":", linewidth=1.2, zorder=4)
            ends.append(course.reference[j])
    seen = np.array(ends)[np.isfinite(ends)]
    if seen.size:
        ax.set_ylim(*padded(float(seen.min()), float(seen.max()), 0.08))
    value_axis(ax, "", 4)
    head(ax, f"{name} [{unit}]")
