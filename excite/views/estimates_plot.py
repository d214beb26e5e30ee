"""Estimates over time, of the recursive method [KD96] Figs. 5 and 15, and of several motions side by side."""

from __future__ import annotations

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from excite.identification.estimate import Estimate
from excite.identification.identification import Identification
from excite.identification.result import ReferenceValues
from excite.study.time_study import TimeCourse, TimeStudy
from excite.views.panels import Panel, Timeline, alike, head, legend_below, value_axis
from excite.views.style import (
    BAND,
    BLUE,
    DARK,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    log_scale,
    plain,
    significant,
)
from regressors.errors import InputError
from regressors.samples import Array

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
        ax.plot(*timeline.curve(time, pass_number, path[:, k]), color=BLUE, linewidth=1.1, zorder=3)
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
    pad = 0.1 * (high - low) if high > low else max(0.1 * abs(high), 1e-12)
    return low - pad, high + pad


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


_COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)
_HALF = 0.5  # of the time, after which estimates must be in view
_FAINT = 0.25


def estimates_over_time_figure(study: TimeStudy) -> Figure:
    """Draw every estimate over time, each motion in its colour."""
    names = tuple(dict.fromkeys(name for course in study.courses for name in course.names))
    few, count = len(names) <= _FEW, len(names) + 2
    panel, most = Panel((2.5 if few else 1.9,), 1.25, left=0.72, between=0.45, least=_LEAST), 4 if few else 6
    figure, flat, _ = alike(count, most, panel, f"{study.robot}: estimates over time", "time [s]")
    _draw_sizes(flat[0], study, [course.condition_number for course in study.courses], "cond(W)")
    _draw_sizes(flat[1], study, [_largest(course) for course in study.courses], "largest relative deviation")
    for name, ax in zip(names, flat[2:], strict=True):
        _draw_parameter(ax, study, name)
    legend_below(figure, _legend_of_study(study))
    return figure


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
        late = course.time >= _HALF * course.time[-1]
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


def _legend_of_study(study: TimeStudy) -> list[Artist]:
    handles: list[Artist] = [
        Line2D([], [], color=_colour(k), linewidth=1.2, label=plain(course.name))
        for k, course in enumerate(study.courses)
    ]
    if any(course.reference_kind == "truth" for course in study.courses):
        handles.append(Line2D([], [], color=DARK, linestyle=":", linewidth=1.2, label="true value"))
    return handles
