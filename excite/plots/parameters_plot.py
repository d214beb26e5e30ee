"""Estimated parameters: difference from known values, and width of their intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, NullLocator, SymmetricalLogLocator

from excite.plots.drawing_style import column_width
from excite.plots.panels import NAME_STYLE, legend_below
from excite.plots.style import (
    BAND,
    BLUE,
    DARK,
    FORBIDDEN,
    GREY,
    LABEL,
    NOTE,
    TITLE_STYLE,
    VERMILLION,
    log_scale,
    named_sum,
    plain,
    significant,
    tidy,
    typeset,
)
from regressors.samples import Array

if TYPE_CHECKING:
    from excite.identification.identification import Identification
    from excite.identification.reference_values import ReferenceValues

_GROUPS = {"inertial": "Links", "rotor": "Rotors", "friction": "Friction", "other": "Other"}
_KINDS = {"truth": "true value", "description": "value of the robot's description"}
_ROW, _ABOVE, _LINE, _BELOW = 0.2, 0.75, 0.15, 1.0  # [in]
_NAMES, _PANEL, _BETWEEN, _NUMBERS, _KNOWN = 3.3, 3.2, 0.25, 2.0, 1.0  # widths [in]
_EXPRESSION_LENGTH = 46
_LEAST = 5.0  # width of a figure with numbers [in]
_NEAR = 3.0  # in half-widths: the scale of the differences is linear up to here
_WORST = 1e4  # of the relative half-widths [%]; beyond, bars are cut
_UNCLEAR = 100.0  # [%]: from here on the interval holds zero


def parameters_figure(result: Identification, reference: ReferenceValues | None = None) -> Figure:
    """Draw every parameter with its 99 % interval, beside known values where there are any.

    Parameters
    ----------
    result : Identification
    reference : ReferenceValues, optional

    Returns
    -------
    Figure
        One row per parameter, by groups: with a reference, the difference from it over half the interval's width; then
        half the interval's width over the value's magnitude; then both in numbers. Rows of parameters that are not
        identifiable individually are marked.
    """
    rows = _rows(result)
    compared = reference is not None and bool(np.any(np.isfinite(reference.values)))
    figure, panels = _layout(len(rows), compared)
    count, unseen = len(result.estimate.names), len(result.estimate.unseen)
    title = f"{result.robot.name}: {count} parameter{'s' if count != 1 else ''}, 99 % intervals"
    title += f"; {unseen} not identifiable individually" if unseen else ""
    figure.suptitle(plain(title), y=1.0 - 0.12 / figure.get_figheight(), va="top", **TITLE_STYLE)
    exact = panels[-1]
    _draw_half_widths(exact, result, rows)
    handles: list[Artist] = [Patch(color=BLUE, label="half-width of the 99 % interval over the value")]
    if compared and reference is not None:
        handles = [*_draw_differences(panels[0], result, rows, reference), *handles]
    _write_names(panels[0], result, rows)
    if column_width() > _LEAST:  # else the numbers have no room
        _write_numbers(exact, result, rows, reference if compared else None)
    handles.append(Patch(color=FORBIDDEN, label="interval contains zero"))
    legend_below(figure, handles)
    return figure


def _rows(result: Identification) -> list[int | str]:
    """Group names, each followed by the indices of the group's parameters."""
    groups = {column.name: str(column.group) for column in result.target.model.columns}
    of = [groups.get(name, "other") for name in result.estimate.names]
    rows: list[int | str] = []
    for group, title in _GROUPS.items():
        own = [k for k, name in enumerate(of) if name == group]
        rows += [title, *own] if own else []
    return rows


def _layout(rows: int, compared: bool) -> tuple[Figure, list[Axes]]:
    count = 2 if compared else 1
    width = _NAMES + count * _PANEL + (count - 1) * _BETWEEN + _NUMBERS + (_KNOWN if compared else 0.0)
    height = _ABOVE + (_LINE if compared else 0.0) + _ROW * rows + _BELOW
    figure = Figure(figsize=(width, height), facecolor="white")
    bottom, tall = _BELOW / height, _ROW * rows / height
    places = [(_NAMES + k * (_PANEL + _BETWEEN)) / width for k in range(count)]
    panels = [figure.add_axes((left, bottom, _PANEL / width, tall)) for left in places]
    for ax in panels:
        tidy(ax)
        ax.grid(False, axis="y")
        ax.set_ylim(rows - 0.5, -0.5)
        ax.tick_params(axis="y", length=0)
        ax.set_yticks([])
    return figure, panels


def _write_names(ax: Axes, result: Identification, rows: list[int | str]) -> None:
    estimate, base = result.estimate, result.target.base
    expressions = dict(zip(base.names, base.expressions, strict=True))
    style: dict[str, Any] = {"textcoords": "offset points", "ha": "right", "va": "center"}
    for place, row in enumerate(rows):
        where: dict[str, Any] = {"xy": (0.0, place), "xytext": (-6, 0), "xycoords": ("axes fraction", "data")}
        if isinstance(row, str):
            ax.annotate(row, **where, **style, fontsize=LABEL, fontweight="bold", color=DARK)
            continue
        name = estimate.names[row]
        text = named_sum(name, expressions.get(name, name), _EXPRESSION_LENGTH)
        ax.annotate(text, **where, **style, fontsize=NOTE, color=GREY if name in estimate.unseen else DARK)


def _draw_differences(
    ax: Axes, result: Identification, rows: list[int | str], reference: ReferenceValues
) -> list[Artist]:
    z = differences(result.estimate.values, result.estimate.half_width, reference.values)
    ax.axvspan(-1.0, 1.0, color=BAND, linewidth=0)
    ax.axvline(0.0, color=DARK, linewidth=0.8)
    for place, row in enumerate(rows):
        if isinstance(row, str) or not np.isfinite(z[row]):
            continue
        colour = BLUE if abs(z[row]) <= 1.0 else VERMILLION
        ax.plot([0.0, z[row]], [place, place], color=colour, linewidth=1.0)
        ax.plot([z[row]], [place], "o", color=colour, markersize=4.5)
    _scale_differences(ax, z[np.isfinite(z)])
    seen, inside = int(np.sum(np.isfinite(z))), int(np.sum(np.abs(z) <= 1.0))
    kind = _KINDS.get(reference.kind, reference.kind)
    ax.set_title(f"difference from the {kind}\n{inside} of {seen} intervals contain it", **_HEADING)
    ax.set_xlabel("difference / half-width of the interval", fontsize=LABEL, color=DARK)
    dot: dict[str, Any] = {"marker": "o", "markersize": 4.5, "linewidth": 1.0}
    return [
        Line2D([], [], color=BLUE, label=f"{kind} in the interval", **dot),
        Line2D([], [], color=VERMILLION, label="outside", **dot),
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


def _draw_half_widths(ax: Axes, result: Identification, rows: list[int | str]) -> None:
    estimate = result.estimate
    with np.errstate(divide="ignore", invalid="ignore"):
        percent = 100.0 * estimate.half_width / np.abs(estimate.values)
    shown = percent[np.isfinite(percent) & (percent > 0)]
    low = float(np.clip(shown.min(initial=1.0), 1e-6, 1.0)) / 2.0
    high = float(np.clip(2.0 * shown.max(initial=100.0), 200.0, _WORST))
    ax.axvspan(_UNCLEAR, high, color=FORBIDDEN, linewidth=0, zorder=0.5)
    for place, row in enumerate(rows):
        if isinstance(row, str):
            continue
        if not np.isfinite(estimate.values[row]):
            style: dict[str, Any] = {"fontsize": NOTE, "color": GREY, "style": "italic", "va": "center"}
            ax.annotate("not identifiable individually", (0.02, place), xycoords=("axes fraction", "data"), **style)
        elif percent[row] > 0:
            ax.barh([place], [min(percent[row], high)], height=0.62, color=BLUE)
    log_scale(ax.xaxis, low, high)
    ax.set_xlabel("half-width of the interval / |value| [%]", fontsize=LABEL, color=DARK)
    ax.set_title("relative uncertainty", **_HEADING)


def _write_numbers(ax: Axes, result: Identification, rows: list[int | str], reference: ReferenceValues | None) -> None:
    estimate = result.estimate
    style: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points", "va": "center"}
    style |= {"fontsize": NOTE, "color": DARK}
    middle, right = 62, 72.0 * (_NUMBERS + _KNOWN) - 12
    for place, row in enumerate(rows):
        if isinstance(row, str):
            continue
        value, half = float(estimate.values[row]), float(estimate.half_width[row])
        if np.isfinite(value):
            width = typeset(f"± {decimal(half, half)} {estimate.units[row]}")
            ax.annotate(typeset(decimal(value, half)), (1.0, place), (middle, 0), ha="right", **style)
            ax.annotate(width, (1.0, place), (middle + 3, 0), ha="left", **style)
        if reference is not None and np.isfinite(reference.values[row]):
            text = typeset(decimal(float(reference.values[row]), half))
            ax.annotate(text, (1.0, place), (right, 0), ha="right", **style)
    heading: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points", "fontsize": LABEL}
    ax.annotate("estimate ± half-width", (1.0, 1.0), (12, 6), color=DARK, **heading)
    if reference is not None:
        short = {"truth": "true", "description": "described"}.get(reference.kind, reference.kind)
        ax.annotate(short, (1.0, 1.0), (right, 6), ha="right", color=DARK, **heading)


def decimal(value: float, half_width: float) -> str:
    """A value rounded to the second significant digit of its interval's half-width.

    Parameters
    ----------
    value : float
    half_width : float
        Not negative; the value has four digits where this is zero or not finite.
    """
    if not (np.isfinite(half_width) and half_width > 0):
        return significant(value, 4)
    exponent = int(np.floor(np.log10(half_width)))
    rounded = round(value, 1 - exponent) + 0.0  # no minus before a zero
    if -4 <= exponent < 6:
        return f"{rounded:.{max(0, 1 - exponent)}f}"
    return significant(rounded, 2 + max(0, int(np.floor(np.log10(abs(rounded)))) - exponent)) if rounded else "0"


_HEADING: dict[str, Any] = {**NAME_STYLE, "fontweight": "normal"}
