"""A sweep: condition numbers of all cells by each option of its grid."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from excite.design.sweeps.sweep_table import SweepRow, SweepTable
from excite.views.panels import Panel, alike, ends, head, legend_below
from excite.views.style import (
    BLUE,
    DARK,
    GREEN,
    GREY,
    LABEL,
    LETTER,
    NOTE,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    log_scale,
    panel_width,
    plain,
    size_of,
)

FIGURE = "campaign"
_MOST_PANELS, _COLUMNS, _MOST_LABELS, _LETTERS = 6, 3, 12, 14
_COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)
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
    shown = list(table.groups)[: len(_COLOURS)]
    handles = [_handle(table.groups[group][0], group) for group in shown]
    if len(table.groups) > len(shown):
        handles.append(Line2D([], [], color=GREY, marker=".", linestyle="", label="other groups"))
    if handles:
        legend_below(figure, handles)
    return figure


def _values(table: SweepTable, name: str) -> list[str]:
    """Values of an option in the order of the table; rows without it have an empty one."""
    return list(dict.fromkeys(_value(row, name) for row in table.rows))


def _value(row: SweepRow, name: str) -> str:
    return row.cell if name == _WHOLE else row.options.get(name, "")


def _draw(ax: Axes, table: SweepTable, name: str) -> None:
    values = _values(table, name)
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
    return _COLOURS[group - 1] if group <= len(_COLOURS) else GREY


def _handle(row: SweepRow, group: int) -> Line2D:
    assert row.facts is not None
    label = f"group {group}: {row.facts.robot}, {row.facts.model}, {row.facts.parameters} parameters"
    return Line2D([], [], color=_colour(group), marker=".", markersize=6.0, linestyle="", label=plain(label))
