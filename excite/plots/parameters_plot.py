"""Estimated parameters: difference from known values, and width of their intervals."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, NullLocator, SymmetricalLogLocator

from excite.plots.panels import NAME_STYLE, legend_below
from excite.plots.parameter_labels import beside_names, parameter_label, row_places
from excite.plots.style import (
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
    tidy,
    typeset,
)
from regressors.samples import Array

if TYPE_CHECKING:
    from excite.identification.identification import Identification
    from excite.identification.provenance import ReferenceValues

_GROUPS = {"inertial": "Links", "rotor": "Rotors", "friction": "Friction", "other": "Other"}
_ESTIMATE = "estimate ± half-width"
_KINDS = {"truth": "true value", "description": "value of the robot's description"}
_ROW, _ABOVE, _LINE, _BELOW = 0.2, 0.75, 0.15, 1.0  # [in]
_NAMES, _PANEL, _BETWEEN = 3.3, 3.2, 0.4  # widths [in]
_LETTER = 0.6  # mean width over the size of the font
_APART = 12.0  # between columns of numbers [pt]
_EXPRESSION_LENGTH = 46
_HEADINGS = {"truth": "true", "description": "described"}
_LEAST = 5.0  # width of a figure with numbers [in]
_LEAST_PANEL = 2.5  # width of a panel with the names [in]
_NEAR = 3.0  # in half-widths: the scale of the differences is linear up to here
_BEST, _WORST = 1e-3, 300.0  # of the relative half-widths [%]; bars are cut there, with the number in them
_UNTOLD = 1e6  # [%]: larger ones are not written
_UNCLEAR = 100.0  # [%]: from here on the interval holds zero


def parameters_figure(result: Identification, reference: ReferenceValues | None = None) -> Figure:
    """Draw every parameter with its 99 % interval, beside known values where there are any."""
    compared = reference is not None and bool(np.any(np.isfinite(reference.values)))
    table = _Table.of(result)
    numbers = _Numbers.of(result, reference if compared else None)
    count, unseen = len(result.estimate.names), len(result.estimate.unseen)
    title = f"{result.robot.name}: {count} parameter{'s' if count != 1 else ''}, 99 % intervals"
    title += f"; {unseen} not identifiable individually" if unseen else ""
    figure, panels = _layout(table.height, numbers.width, compared, title)
    exact = panels[-1]
    _draw_half_widths(exact, result, table)
    handles: list[Artist] = [Patch(color=BLUE, label="half-width of the 99 % interval over the value")]
    if compared and reference is not None:
        handles = [*_draw_differences(panels[0], result, table, reference), *handles]
    for ax in panels if len(panels) > columns_that_fit(len(panels), _LEAST_PANEL) else panels[:1]:
        _write_names(ax, result, table)
    if column_width() > _LEAST:  # else the numbers have no room
        numbers.write(exact, table)
    handles.append(Patch(color=FORBIDDEN, label="interval contains zero"))
    legend_below(figure, handles)
    return figure


@dataclass(frozen=True)
class _Table:
    """Rows of the figure: titles of groups, and the parameters of each with their labels."""

    titles: tuple[tuple[str, float], ...]  # each with its place from the top, in heights of a row
    rows: tuple[tuple[int, str, float], ...]  # number, label and place of each parameter
    height: float  # of all

    @classmethod
    def of(cls, result: Identification) -> _Table:
        names, base = result.estimate.names, result.target.base
        expressions = dict(zip(base.names, base.expressions, strict=True))
        labels = [
            row if isinstance(row, str) else
            parameter_label(names[row], expressions.get(names[row], names[row]), _EXPRESSION_LENGTH, "result.json")
            for row in _rows(result)
        ]  # fmt: skip
        places, height = row_places(labels)
        placed = list(zip(_rows(result), labels, places.tolist(), strict=True))
        titles = tuple((row, place) for row, _, place in placed if isinstance(row, str))
        rows = tuple((row, label, place) for row, label, place in placed if not isinstance(row, str))
        return cls(titles, rows, height)


def _rows(result: Identification) -> list[int | str]:
    """Group names, each followed by the indices of the group's parameters."""
    groups = {column.name: str(column.group) for column in result.target.model.columns}
    of = [groups.get(name, "other") for name in result.estimate.names]
    rows: list[int | str] = []
    for group, title in _GROUPS.items():
        own = [k for k, name in enumerate(of) if name == group]
        rows += [title, *own] if own else []
    return rows


def _layout(rows: float, numbers: float, compared: bool, title: str) -> tuple[Figure, list[Axes]]:
    """Create the panels, beside room for names and numbers [in]; one below the other where a column has no room."""
    count = 2 if compared else 1
    across = columns_that_fit(count, _LEAST_PANEL)
    width = _NAMES + count * _PANEL + (count - 1) * _BETWEEN + numbers
    height = (count // across) * (_ABOVE + (_LINE if compared else 0.0) + _ROW * rows + _BELOW)
    figure = figure_of(width, height, title, text=height)
    panels = [ax for row in figure.subplots(count // across, across, squeeze=False) for ax in row]
    for ax in panels:
        tidy(ax)
        ax.grid(False, axis="y")
        ax.set_ylim(rows, 0.0)
        ax.tick_params(axis="y", length=0)
        ax.set_yticks([])
    return figure, panels


def _write_names(ax: Axes, result: Identification, table: _Table) -> None:
    style: dict[str, Any] = {"textcoords": "offset points", "ha": "right", "va": "center"}
    style |= {"xytext": (-6, 0), "xycoords": ("axes fraction", "data")}
    for title, place in table.titles:
        ax.annotate(title, (0.0, place), **style, fontsize=LABEL, fontweight="bold", color=DARK)
    for row, label, place in table.rows:
        unseen = result.estimate.names[row] in result.estimate.unseen
        ax.annotate(label, (0.0, place), **style, fontsize=NOTE, color=GREY if unseen else DARK)


def _draw_differences(ax: Axes, result: Identification, table: _Table, reference: ReferenceValues) -> list[Artist]:
    z = differences(result.estimate.values, result.estimate.half_width, reference.values)
    ax.axvspan(-1.0, 1.0, color=BAND, linewidth=0)
    ax.axvline(0.0, color=DARK, linewidth=0.8)
    for row, _, place in table.rows:
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


def _draw_half_widths(ax: Axes, result: Identification, table: _Table) -> None:
    """Bars of the relative half-widths on a logarithmic axis; those beyond its ends have their numbers written."""
    estimate = result.estimate
    with np.errstate(divide="ignore", invalid="ignore"):
        percent = 100.0 * estimate.half_width / np.abs(estimate.values)
    shown = percent[np.isfinite(percent) & (percent > 0)]
    low = float(np.clip(0.5 * shown.min(initial=1.0), _BEST, 0.5))
    ax.axvspan(_UNCLEAR, _WORST, color=FORBIDDEN, linewidth=0, zorder=0.5)
    for row, _, place in table.rows:
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
            ax.annotate(_beyond(float(percent[row])), (_WORST, place), (-4, 0), **_CUT)
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


@dataclass(frozen=True)
class _Numbers:
    """Estimates, half-widths and known values in columns."""

    values: dict[int, str]  # by the parameter's number
    half_widths: dict[int, str]
    known: dict[int, str]
    heading: str  # of the known values; empty where there are none

    @classmethod
    def of(cls, result: Identification, reference: ReferenceValues | None) -> _Numbers:
        estimate = result.estimate
        pairs = [(float(v), float(h)) for v, h in zip(estimate.values, estimate.half_width, strict=True)]
        seen = [k for k, (value, _) in enumerate(pairs) if np.isfinite(value)]
        values = {k: typeset(decimal(*pairs[k])) for k in seen}
        half = {k: typeset(f"± {decimal(pairs[k][1], pairs[k][1])} {estimate.units[k]}") for k in seen}
        if reference is None:
            return cls(values, half, {}, "")
        known = {
            k: typeset(decimal(float(value), pairs[k][1]))
            for k, value in enumerate(reference.values)
            if np.isfinite(value)
        }
        return cls(values, half, known, _HEADINGS.get(reference.kind, reference.kind))

    @property
    def _places(self) -> tuple[float, float]:
        """Right ends of the values and of the known values, from the panel [pt]."""
        middle = _APART + _wide(self.values.values())
        right = max(middle + _wide(self.half_widths.values()), _APART + _LETTER * LABEL * len(_ESTIMATE))
        known = max(_wide(self.known.values()), _LETTER * LABEL * len(self.heading))
        return middle, right + (_APART + known if self.heading else 0.0)

    @property
    def width(self) -> float:
        """Of all columns [in]."""
        return (self._places[1] + _APART) / 72.0

    def write(self, ax: Axes, table: _Table) -> None:
        """Write the columns beside a panel."""
        middle, right = self._places
        style: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points", "va": "center"}
        style |= {"fontsize": NOTE, "color": DARK}
        columns = (self.values, middle, "right"), (self.half_widths, middle + 3, "left"), (self.known, right, "right")
        for row, _, place in table.rows:
            for texts, where, side in columns:
                if row in texts:
                    ax.annotate(texts[row], (1.0, place), (where, 0), ha=side, **style)
        above: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points", "fontsize": LABEL}
        ax.annotate(_ESTIMATE, (1.0, 1.0), (_APART, 6), color=DARK, **above)
        if self.heading:
            ax.annotate(self.heading, (1.0, 1.0), (right, 6), ha="right", color=DARK, **above)


def _wide(texts: Iterable[str]) -> float:
    """Width of the longest of some texts [pt]."""
    return _LETTER * NOTE * max(map(len, texts), default=0)


def decimal(value: float, half_width: float) -> str:
    """A value rounded to the second significant digit of its interval's half-width."""
    if not (np.isfinite(half_width) and half_width > 0):
        return significant(value, 4)
    exponent = int(np.floor(np.log10(half_width)))
    rounded = round(value, 1 - exponent) + 0.0  # no minus before a zero
    if -4 <= exponent < 6:
        return f"{rounded:.{max(0, 1 - exponent)}f}"
    return significant(rounded, 2 + max(0, int(np.floor(np.log10(abs(rounded)))) - exponent)) if rounded else "0"


_HEADING: dict[str, Any] = {**NAME_STYLE, "fontweight": "normal"}
_CUT: dict[str, Any] = {
    "textcoords": "offset points",
    "ha": "right",
    "va": "center",
    "fontsize": NOTE,
    "color": "white",
    "fontweight": "bold",
}
