"""Estimated parameters with their intervals, and how repetitions in simulation scatter beside these."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, NullLocator, SymmetricalLogLocator

from excite.identification.estimator import CONFIDENCE
from excite.identification.identification import Identification
from excite.identification.result import ReferenceValues
from excite.study.repetitions import Repetitions
from excite.views.panels import (
    NAME_STYLE,
    NumberColumn,
    bar_panel,
    beside_names,
    columns_inches,
    legend_below,
    parameter_label,
    row_places,
    write_columns,
)
from excite.views.style import (
    BAND,
    BLUE,
    DARK,
    FORBIDDEN,
    GREY,
    LABEL,
    NOTE,
    VERMILLION,
    column_width,
    columns_that_fit,
    figure_of,
    log_scale,
    significant,
    typeset,
)
from regressors.samples import Array

_GROUPS = {"inertial": "Links", "rotor": "Rotors", "friction": "Friction", "other": "Other"}
_KINDS = {"truth": "true value", "description": "value of the robot's description"}
_ROW, _ABOVE, _LINE, _BELOW = 0.2, 0.75, 0.15, 1.0  # [in]
_NAMES, _PANEL, _BETWEEN = 3.3, 3.2, 0.4  # widths [in]
_EXPRESSION_LENGTH = 46
_HEADINGS = {"truth": "true", "description": "described"}
_LEAST = 5.0  # width of a figure with numbers [in]
_LEAST_PANEL = 2.5  # width of a panel with the names [in]
_NEAR = 3.0  # in half-widths: the scale of the differences is linear up to here
_BEST, _WORST = 1e-3, 300.0  # of the relative half-widths [%]; bars are cut there, with the number in them
_UNTOLD = 1e6  # [%]: larger ones are not written
_UNCLEAR = 100.0  # [%]: from here on the interval holds zero


def parameters_figure(result: Identification) -> Figure:
    """Draw every parameter with its 99 % interval, beside known values where there are any."""
    reference = result.reference
    compared = reference is not None and bool(np.any(np.isfinite(reference.values)))
    rows, height = _rows(result)
    numbers = _numbers(result, [k for k, _, _ in rows if k is not None], reference if compared else None)
    count, unseen = len(result.estimate.names), len(result.estimate.unseen)
    title = f"{result.robot.name}: {count} parameter{'s' if count != 1 else ''}, 99 % intervals"
    title += f"; {unseen} not identifiable individually" if unseen else ""
    figure, panels = _layout(height, columns_inches(numbers), compared, title)
    exact, places = panels[-1], {k: place for k, _, place in rows if k is not None}
    _draw_half_widths(exact, result, places)
    handles = _draw_differences(panels[0], result, places, reference) if compared and reference is not None else []
    for ax in panels if len(panels) > columns_that_fit(len(panels), _LEAST_PANEL) else panels[:1]:
        _write_names(ax, result, rows)
    if column_width() > _LEAST:  # else the numbers have no room
        write_columns(exact, [*places.values()], numbers)
    handles.append(Patch(color=BLUE, label="half-width of the 99 % interval over the value"))
    handles.append(Patch(color=FORBIDDEN, label="interval contains zero"))
    legend_below(figure, handles)
    return figure


Rows = list[tuple[int | None, str, float]]  # number, none of a group's title; label; place from the top, in rows


def _rows(result: Identification) -> tuple[Rows, float]:
    """Titles of groups, each above the parameters of the group, and the height of all."""
    names, base = result.estimate.names, result.target.base
    expressions = dict(zip(base.names, base.expressions, strict=True))
    groups = {column.name: str(column.group) for column in result.target.model.columns}
    rows: list[tuple[int | None, str]] = []
    for group, title in _GROUPS.items():
        own = [(k, name) for k, name in enumerate(names) if groups.get(name, "other") == group]
        rows += [(None, title)] if own else []
        for k, name in own:
            label = parameter_label(name, expressions.get(name, name), _EXPRESSION_LENGTH, "result.json")
            rows.append((k, label))
    places, height = row_places([label for _, label in rows])
    return [(k, label, place) for (k, label), place in zip(rows, places.tolist(), strict=True)], height


def _layout(rows: float, numbers: float, compared: bool, title: str) -> tuple[Figure, list[Axes]]:
    """Create the panels, beside room for names and numbers [in]; one below the other where a column has no room."""
    count = 2 if compared else 1
    across = columns_that_fit(count, _LEAST_PANEL)
    width = _NAMES + count * _PANEL + (count - 1) * _BETWEEN + numbers
    height = (count // across) * (_ABOVE + (_LINE if compared else 0.0) + _ROW * rows + _BELOW)
    figure = figure_of(width, height, title, text=height)
    panels = [ax for row in figure.subplots(count // across, across, squeeze=False) for ax in row]
    for ax in panels:
        bar_panel(ax, 0.0, rows)
    return figure, panels


def _write_names(ax: Axes, result: Identification, rows: Rows) -> None:
    style: dict[str, Any] = {**_ON_THE_LEFT, "xytext": (-6, 0), "xycoords": ("axes fraction", "data")}
    for row, label, place in sorted(rows, key=lambda each: each[0] is not None):  # titles first
        look: dict[str, Any] = {"fontsize": LABEL, "fontweight": "bold", "color": DARK}
        if row is not None:
            unseen = result.estimate.names[row] in result.estimate.unseen
            look = {"fontsize": NOTE, "color": GREY if unseen else DARK}
        ax.annotate(label, (0.0, place), **style, **look)


def _draw_differences(
    ax: Axes, result: Identification, places: Mapping[int, float], reference: ReferenceValues
) -> list[Artist]:
    z = differences(result.estimate.values, result.estimate.half_width, reference.values)
    ax.axvspan(-1.0, 1.0, color=BAND, linewidth=0)
    ax.axvline(0.0, color=DARK, linewidth=0.8)
    for row, place in places.items():
        if not np.isfinite(z[row]):
            continue
        colour = BLUE if abs(z[row]) <= 1.0 else VERMILLION
        ax.plot([0.0, z[row]], [place, place], color=colour, linewidth=1.0)
        face = colour if abs(z[row]) <= 1.0 else "white"  # hollow outside, in print without colours too
        ax.plot([z[row]], [place], "o", color=colour, markerfacecolor=face, markersize=4.5)
    _scale_differences(ax, z[np.isfinite(z)])
    seen, inside = int(np.sum(np.isfinite(z))), int(np.sum(np.abs(z) <= 1.0))
    kind = _KINDS.get(reference.kind, reference.kind)
    text = f"difference from the {kind}\n{inside} of {seen} intervals contain it"
    ax.set_title(beside_names(text, ax), **_HEADING)
    ax.set_xlabel(beside_names("difference / half-width of the interval", ax), fontsize=LABEL, color=DARK)
    dot: dict[str, Any] = {"marker": "o", "markersize": 4.5, "linewidth": 1.0}
    return [
        Line2D([], [], color=BLUE, label=f"{kind} in the interval", **dot),
        Line2D([], [], color=VERMILLION, markerfacecolor="white", label="outside", **dot),
        Patch(color=BAND, label="99 % interval"),
    ]


def differences(values: Array, half_width: Array, reference: Array) -> Array:
    """``(value - reference) / half-width`` of the 99 % interval, NaN where any of them is not known, shape (p,)."""
    known = np.isfinite(values) & np.isfinite(half_width) & (half_width > 0) & np.isfinite(reference)
    return np.asarray(np.divide(values - reference, half_width, out=np.full(values.shape, np.nan), where=known))


def _scale_differences(ax: Axes, z: Array) -> None:
    """Set a linear scale, unless some lie so far off that the interval would not be visible."""
    far = float(np.abs(z).max(initial=1.0))
    if far <= 2 * _NEAR:
        ax.set_xlim(-1.1 * max(far, 1.4), 1.1 * max(far, 1.4))
        return
    ax.set_xscale("symlog", linthresh=1.0, linscale=0.7)
    ax.set_xlim(-2.0 * far, 2.0 * far)
    locator = SymmetricalLogLocator(base=10.0, linthresh=1.0)
    locator.set_params(numticks=9)
    ax.xaxis.set_major_locator(locator)
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: typeset(f"{value:g}")))
    ax.xaxis.set_minor_locator(NullLocator())


def _draw_half_widths(ax: Axes, result: Identification, places: Mapping[int, float]) -> None:
    """Bars of the relative half-widths on a logarithmic axis; those beyond its ends have their numbers written."""
    estimate = result.estimate
    with np.errstate(divide="ignore", invalid="ignore"):
        percent = 100.0 * estimate.half_width / np.abs(estimate.values)
    shown = percent[np.isfinite(percent) & (percent > 0)]
    low = float(np.clip(0.5 * shown.min(initial=1.0), _BEST, 0.5))
    ax.axvspan(_UNCLEAR, _WORST, color=FORBIDDEN, linewidth=0, zorder=0.5)
    for row, place in places.items():
        if not np.isfinite(estimate.values[row]):
            _write_in(ax, place, "not identifiable individually", GREY, "italic")
            continue
        if not percent[row] > 0:  # of an exact value, or of zero without an interval
            continue
        if percent[row] < low:
            _write_in(ax, place, f"less than {low:g} %", DARK, "normal")
            continue
        ax.barh([place], [min(percent[row], _WORST)], height=0.62, color=BLUE)
        if percent[row] > _WORST:
            ax.annotate(_beyond(float(percent[row])), (_WORST, place), (-4, 0), **_ON_THE_LEFT, **_CUT)
    log_scale(ax.xaxis, low, _WORST)
    ax.set_xlabel(beside_names("half-width of the interval / |value| [%]", ax), fontsize=LABEL, color=DARK)
    ax.set_title("relative uncertainty", **_HEADING)


def _write_in(ax: Axes, place: float, text: str, colour: str, style: str) -> None:
    where = ("axes fraction", "data")
    ax.annotate(text, (0.02, place), xycoords=where, fontsize=NOTE, color=colour, style=style, va="center")


def _beyond(percent: float) -> str:
    """The number of a bar that is cut."""
    most = f"over {_UNTOLD:,.0f}" if percent > _UNTOLD else f"{float(significant(percent, 2)):,.0f}"
    return f"{most} % \N{RIGHTWARDS ARROW}"


def _numbers(result: Identification, rows: list[int], reference: ReferenceValues | None) -> list[NumberColumn]:
    """Estimates, half-widths and known values, in the order of the rows."""
    estimate = result.estimate
    units, halves = [estimate.units[k] for k in rows], estimate.half_width[rows].tolist()

    def written(values: Array) -> list[str]:
        pairs = zip(values[rows].tolist(), halves, strict=True)
        return [typeset(decimal(value, half)) if np.isfinite(value) else "" for value, half in pairs]

    estimates = written(estimate.values)
    widths = [
        typeset(f"± {decimal(half, half)} {unit}") if known else ""
        for known, half, unit in zip(estimates, halves, units, strict=True)
    ]
    columns = [NumberColumn("estimate", estimates), NumberColumn("half-width", widths, side="left")]
    if reference is None:
        return columns
    return [*columns, NumberColumn(_HEADINGS.get(reference.kind, reference.kind), written(reference.values))]


def decimal(value: float, half_width: float) -> str:
    """A value rounded to the second significant digit of its interval's half-width."""
    if not (np.isfinite(half_width) and half_width > 0):
        return significant(value, 4)
    exponent = int(np.floor(np.log10(half_width)))
    rounded = round(value, 1 - exponent) + 0.0  # no minus before a zero
    if -4 <= exponent < 6:
        return f"{rounded:.{max(0, 1 - exponent)}f}"
    return significant(rounded, 2 + max(0, int(np.floor(np.log10(abs(rounded)))) - exponent)) if rounded else "0"


_ON_THE_LEFT: dict[str, Any] = {"textcoords": "offset points", "ha": "right", "va": "center"}
_HEADING: dict[str, Any] = {**NAME_STYLE, "fontweight": "normal"}
_CUT: dict[str, Any] = {"fontsize": NOTE, "color": "white", "fontweight": "bold"}


FIGURE = "repetitions"
DOTS = 200  # repetitions drawn one by one; percentiles are of all
_TALL, _TOP, _BOTTOM = 0.24, 0.85, 1.0  # [in]
_WIDE, _NUMBERS = 5.0, 3.6  # widths [in]
_LEAST_NAMES, _NAME_LETTER = 1.2, 0.07  # width of the names, and of a letter [in]
_ENDS = 0.5, 99.5  # percentiles between which 99 % of the estimates are
_FEWEST, _MOST = 1.6, 6.0  # half-widths shown to both sides
_UNLIKELY = 1e-3  # probability below which a coverage is marked


def repetitions_figure(repetitions: Repetitions, robot: str) -> Figure:
    """Draw the error of every estimate over half the width of its predicted interval."""
    count = len(repetitions.names)
    names = max(_LEAST_NAMES, _NAME_LETTER * (2 + max(map(len, repetitions.names), default=0)))
    width, height = (names + _WIDE + _NUMBERS, _TOP + _TALL * count + _BOTTOM)
    title = f"{robot}: {repetitions.count} repetitions in simulation and the predicted intervals"
    figure = figure_of(width, height, title, text=height)
    ax = figure.subplots()
    _draw(ax, relative_errors(repetitions), repetitions.seed)
    bar_panel(ax, -0.5, count - 0.5, range(count), repetitions.names)
    ax.set_xlabel("(estimate less true value) / half-width of the predicted interval", fontsize=LABEL, color=DARK)
    dots = "a repetition" if repetitions.count <= DOTS else f"one of the first {DOTS}"
    if column_width() > _NUMBERS + _LEAST_NAMES:  # else the numbers have no room
        write_columns(ax, range(count), _numbers_of(repetitions))
    meanings = [
        Line2D([], [], color=BLUE, marker=".", markersize=4.0, linestyle="", label=dots),
        Line2D([], [], color=DARK, linewidth=1.4, label="99 % of all"),
        Line2D([], [], color=DARK, marker="|", markersize=9.0, markeredgewidth=1.6, linestyle="", label="mean"),
        Patch(color=BAND, label="predicted 99 % interval"),
    ]
    legend_below(figure, meanings)
    return figure


def relative_errors(repetitions: Repetitions) -> Array:
    """``(estimate - true value) / (t s)``, t s the half-width of a 99 % interval as predicted, shape (R, b)."""
    quantile = scipy.special.stdtrit(repetitions.degrees_of_freedom, 0.5 + CONFIDENCE / 2)
    half = quantile * repetitions.predicted_deviation
    error = repetitions.estimates - repetitions.beta
    return np.asarray(np.divide(error, half, out=np.full(error.shape, np.nan), where=half > 0))


def _draw(ax: Axes, errors: Array, seed: int) -> None:
    ax.axvspan(-1.0, 1.0, color=BAND, linewidth=0.0)
    ax.axvline(0.0, color=DARK, linewidth=0.6)
    known = errors[np.isfinite(errors)]
    most = float(np.clip(1.1 * np.abs(known).max(initial=0.0), _FEWEST, _MOST))
    heights = np.random.default_rng(seed).uniform(-0.3, 0.3, errors[:DOTS].shape)
    for k, column in enumerate(errors.T):
        if not np.all(np.isfinite(column)):
            continue
        ax.plot(np.clip(column[:DOTS], -most, most), k + heights[:, k], ".", color=BLUE, markersize=2.0, alpha=0.5)
        ax.plot(np.clip(np.percentile(column, _ENDS), -most, most), [k, k], color=DARK, linewidth=1.4)
        ax.plot(np.clip([np.mean(column)], -most, most), [k], "|", color=DARK, markersize=9.0, markeredgewidth=1.6)
    ax.set_xlim(-most, most)


def _numbers_of(r: Repetitions) -> list[NumberColumn]:
    few = scipy.special.bdtr(np.round(r.coverage * r.count), r.count, CONFIDENCE) < _UNLIKELY
    deviations = [typeset(f"{significant(float(d), 2)} {unit}") for d, unit in zip(r.deviation, r.units, strict=True)]
    return [
        NumberColumn("predicted", [typeset(significant(float(d), 2)) for d in r.predicted_deviation]),
        NumberColumn("deviation", deviations),
        NumberColumn("contained", [f"{100 * float(share):.1f} %" for share in r.coverage], marked=few.tolist()),
    ]
