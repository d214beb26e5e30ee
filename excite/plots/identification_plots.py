"""Fit of an estimate to its logs: measured and predicted equations, and residuals."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy.fft
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from excite.plots.estimates_plot import estimates_figure
from excite.plots.figure_files import write_figure_files
from excite.plots.fit_panels import (
    draw_fit,
    draw_values,
    fit_legend,
    fit_panel,
    label_equation,
    relative_error,
    values_legend,
)
from excite.plots.panels import Panel, Timeline, head, legend_below, panels, value_axis
from excite.plots.parameters_plot import parameters_figure
from excite.plots.style import BAND, BLUE, DARK, GREY, LABEL, significant
from regressors.samples import Array, Index

if TYPE_CHECKING:
    from excite.identification.identification import Identification
    from excite.identification.provenance import ReferenceValues

_WHITE = 2.5758  # standard deviations that 99 % of white noise's autocorrelations stay within
_LAGS = 0.1  # of the longest log
_ALIKE = 0.01  # relative; logs whose sample times differ by less share an axis of lags in seconds


def torques_figure(result: Identification) -> Figure:
    """Draw measured and predicted values of the equations over time."""
    curves, equations = result.curves, result.equations
    timeline = Timeline.of(result.log_names, curves.time, curves.log)
    error = relative_error(curves.measured, curves.predicted)
    title = f"{result.robot.name}: measured and predicted, relative error {error} over all equations"
    count = len(equations)
    figure, rows = panels(count, fit_panel(count), title)
    for j, (equation, (ax,)) in enumerate(zip(equations, rows, strict=True)):
        own = curves.equation == j
        time, log, fit = curves.time[own], curves.log[own], (curves.measured[own], curves.predicted[own])
        draw_fit(ax, timeline, time, log, fit, equation, bottom=j == count - 1)
    legend_below(figure, fit_legend(int(np.bincount(curves.equation).max()), "predicted by the estimate"))
    return figure


def residuals_figure(result: Identification) -> Figure:
    """Draw the residuals of the equations over time, and their autocorrelation.

    ``r_k = mean(e_t e_{t+k}) / mean(e_t^2)``, with the residual e of each log divided by its root mean square.
    """
    curves, equations = result.curves, result.equations
    residual = curves.measured - curves.predicted
    timeline = Timeline.of(result.log_names, curves.time, curves.log)
    count = len(equations)
    title = f"{result.robot.name}: residuals, measured less predicted by the estimate"
    figure, rows = panels(count, Panel((7.6, 3.4), 1.3 if count > 1 else 3.0, left=0.85), title)
    for j, ((name, unit), (over_time, over_lag)) in enumerate(zip(equations, rows, strict=True)):
        own = curves.equation == j
        time, log, e = curves.time[own], curves.log[own], residual[own]
        over_time.axhline(0.0, color=GREY, linewidth=0.6)
        draw_values(over_time, timeline, time, log, e)
        timeline.dress(over_time, bottom=j == count - 1)
        label_equation(over_time, unit)
        rms, worst = (significant(float(x), 3) for x in (np.sqrt(np.mean(e**2)), np.abs(e).max()))
        head(over_time, name, f"rms {rms} {unit}, largest {worst} {unit}")
        _draw_autocorrelation(over_lag, time, log, e, bottom=j == count - 1)
    band = Patch(color=BAND, label="99 % of the autocorrelation of white noise")
    legend_below(figure, [*values_legend(int(np.bincount(curves.equation).max()), "residual"), band])
    return figure


def autocorrelation(residual: Array, log: Index, lags: int) -> Array:
    """Autocorrelation of residuals of one equation within its logs, shape (lags + 1,)."""  # residual (m,); log (m,)
    total = np.zeros(lags + 1)
    for k in np.unique(log):
        e = residual[log == k]
        size = scipy.fft.next_fast_len(e.size + lags)
        products = scipy.fft.irfft(np.abs(scipy.fft.rfft(e, size)) ** 2, size)[: lags + 1]
        if products[0] > 0:
            total += products / products[0] * e.size
    return np.asarray(total / total[0]) if total[0] > 0 else np.zeros(lags + 1)


def _draw_autocorrelation(ax: Axes, time: Array, log: Index, residual: Array, *, bottom: bool) -> None:
    counts = np.bincount(log)
    lags = max(1, int(_LAGS * counts.max()))
    values = autocorrelation(residual, log, lags)
    steps = np.array([np.median(np.diff(time[log == k])) for k in np.flatnonzero(counts > 1)])
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


def identification_figures(result: Identification, reference: ReferenceValues | None = None) -> dict[str, Figure]:
    """Draw every figure of an identification."""
    figures = {"parameters": parameters_figure(result, reference)}
    if result.curves.time.size:
        figures = {"torques": torques_figure(result), "residuals": residuals_figure(result), **figures}
    if result.estimate.history is not None:
        figures["estimates"] = estimates_figure(result, reference)
    return figures


def write_identification_figures(
    result: Identification,
    folder: str | Path,
    reference: ReferenceValues | None = None,
    *,
    formats: str | Sequence[str] = ("png",),
    width: str = "screen",
) -> list[Path]:
    """Draw every figure of an identification and write them all at once."""
    draw = partial(identification_figures, result, reference)
    return write_figure_files(draw, folder, "result", formats=formats, width=width)
