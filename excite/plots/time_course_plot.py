"""Estimates of several motions over their growing time, side by side [KD96] Fig. 15."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from excite.plots.figure_files import write_figure_files
from excite.plots.panels import Panel, head, legend_below, panels, value_axis
from excite.plots.style import (
    BLUE,
    DARK,
    GREEN,
    NOTE,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    columns_that_fit,
    log_scale,
    plain,
)
from regressors.samples import Array

if TYPE_CHECKING:
    from excite.study.time_study import TimeCourse, TimeStudy

_COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)
_FEW = 24  # parameters, above which panels are smaller
_LEAST = 1.15  # width of a panel with its numbers [in]
_SETTLED = 0.5  # of the time, after which estimates must be in view
_FAINT = 0.25


def estimates_over_time_figure(study: TimeStudy) -> Figure:
    """Draw every estimate over time, each motion in its colour."""
    names = tuple(dict.fromkeys(name for course in study.courses for name in course.names))
    columns = min(columns_that_fit(4 if len(names) <= _FEW else 6, _LEAST), max(len(names), 2))
    panel = Panel((2.5 if len(names) <= _FEW else 1.9,) * columns, 1.25, left=0.72, between=0.45, least=_LEAST)
    count = len(names) + 2
    figure, grid = panels(-(-count // columns), panel, f"{study.robot}: estimates over time")
    flat = [ax for row in grid for ax in row]
    _draw_sizes(flat[0], study, [course.condition_number for course in study.courses], "cond(W)")
    _draw_sizes(flat[1], study, [_largest(course) for course in study.courses], "largest relative deviation")
    for name, ax in zip(names, flat[2:], strict=False):
        _draw_parameter(ax, study, name)
    for ax in flat[count:]:
        ax.remove()
    for ax in flat[max(count - columns, 0) : count]:
        ax.set_xlabel("time [s]", fontsize=NOTE, color=DARK)
    legend_below(figure, _legend(study))
    return figure


def write_time_study_figure(
    study: TimeStudy,
    folder: str | Path,
    *,
    formats: str | Sequence[str] = ("png",),
    width: str = "screen",
) -> list[Path]:
    """Draw a study and write ``estimates_over_time.png`` atomically into an existing folder."""
    return write_figure_files(
        lambda: {"estimates_over_time": estimates_over_time_figure(study)},
        folder,
        "study",
        formats=formats,
        width=width,
    )


def _largest(course: TimeCourse) -> Array:
    seen = np.isfinite(course.values[-1])
    return np.asarray(course.relative_deviation[:, seen].max(axis=1, initial=0.0))


def _colour(k: int) -> str:
    return _COLOURS[k % len(_COLOURS)]


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
        late = course.time >= _SETTLED * course.time[-1]
        ends += [*(value - band)[late], *(value + band)[late], *value[late]]
        if np.isfinite(course.reference[j]) and course.reference_kind == "truth":
            ax.axhline(course.reference[j], color=DARK, linestyle=":", linewidth=1.2, zorder=4)
            ends.append(course.reference[j])
    _set_range(ax, np.array(ends))
    value_axis(ax, "", 4)
    head(ax, f"{name} [{unit}]")


def _set_range(ax: Axes, seen: Array) -> None:
    seen = seen[np.isfinite(seen)]
    if seen.size:
        low, high = float(seen.min()), float(seen.max())
        pad = 0.08 * (high - low) if high > low else max(0.1 * abs(high), 1e-12)
        ax.set_ylim(low - pad, high + pad)


def _legend(study: TimeStudy) -> list[Artist]:
    handles: list[Artist] = [
        Line2D([], [], color=_colour(k), linewidth=1.2, label=plain(course.name))
        for k, course in enumerate(study.courses)
    ]
    if any(course.reference_kind == "truth" for course in study.courses):
        handles.append(Line2D([], [], color=DARK, linestyle=":", linewidth=1.2, label="true value"))
    return handles
