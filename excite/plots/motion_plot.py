"""The motion over time: every joint, every other limited function and torque, with its limits and their use."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from constraints.bounds.certificate import LimitUse
from constraints.linear import QUANTITIES, LinearConstraint, linear_limits
from excite.design.design import Design
from excite.design.stated_limits import checked_text, kept_headline
from excite.plots.limit_panel import CURVE, DOT, LimitedTorque, draw_limited, limited_torques, write_use
from excite.plots.panels import Panel, ends, legend_below, panels
from excite.plots.style import (
    BAND,
    BLUE,
    DARK,
    FORBIDDEN,
    LABEL,
    NOTE,
    VERMILLION,
    column_width,
    panel_width,
    plain,
    size_of,
    typeset,
)
from excite.trajectories.sequence import EXCITE
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

_PANEL_WIDTH = 2.65  # [in]
_PANEL = Panel((_PANEL_WIDTH,), 1.2, left=0.8, between=0.68, below=0.9)
_RIGHT, _TITLE_BELOW_TOP = 0.2, 0.12  # [in]
_LINE = 1.33  # height of a line over the size of its font
_TITLE_LETTER, _NOTE_LETTER, _NAME_LETTER = 0.675, 0.66, 0.74  # mean width over the size of the font
_NAME_LINES = 2
_DOT_MEANING = "closest to a limit (100 % used: at the limit, 0 %: in mid-range)"
_NAME_STYLE: dict[str, Any] = {"loc": "left", "y": 1.0, "fontsize": LABEL, "fontweight": "bold", "color": DARK}
_PER_TIME = ("", "/s", "/s^2", "/s^3")


@dataclass(frozen=True)
class Bound:
    """One limit of a function or of one of its derivatives."""

    owner: str  # ``joint NAME`` or ``drive NAME``
    lower: float  # bounds on the limited value
    upper: float
    shift: float  # limited value minus the function as drawn
    use: LimitUse  # use of the limit by the motion

    @property
    def extreme(self) -> float:
        """The extreme value of the function as drawn."""
        return self.use.extreme - self.shift


@dataclass
class MotionFunction:
    """A function ``row q + offset`` of the joint positions, drawn in one row of panels."""

    name: str
    row: Array  # (n,)
    unit: str  # ``rad`` or ``m``
    offset: float = 0.0
    bounds: list[list[Bound]] = field(default_factory=lambda: [[] for _ in QUANTITIES])  # per order of derivative

    def values(self, samples: Samples, derivative: int) -> Array:
        """The function or one of its derivatives at every instant, shape (N,)."""
        motion = (samples.q, samples.dq, samples.ddq, samples.dddq)[derivative]
        return np.asarray(motion @ self.row + (self.offset if derivative == 0 else 0.0))

    def allowed(self, derivative: int) -> tuple[float, float]:
        """Range that all bounds together allow, infinite where there is none."""
        bounds = self.bounds[derivative]
        lower = max((bound.lower - bound.shift for bound in bounds), default=-np.inf)
        return lower, min((bound.upper - bound.shift for bound in bounds), default=np.inf)

    def tightest(self, derivative: int) -> Bound | None:
        """The bound that the motion uses most."""
        return max(self.bounds[derivative], key=lambda bound: bound.use.use, default=None)


def motion_functions(
    robot: Robot, limits: Sequence[LinearConstraint], uses: Sequence[LimitUse]
) -> list[MotionFunction]:
    """Joints, then the other limited functions; limits on the same function of the joints are grouped."""
    use_of = {use.label: use for use in uses}
    functions = {
        tuple(row): MotionFunction(joint.name, row, joint.unit)
        for joint, row in zip(robot.joints, np.eye(robot.n), strict=True)
    }
    joints = set(functions)
    for limit in limits:
        for k, label in enumerate(limit.labels):
            key = tuple(limit.matrix[k] + 0.0)
            if key not in functions:
                functions[key] = MotionFunction(
                    "", limit.matrix[k], limit.units[k].split("/")[0], float(limit.offset[k])
                )
            function, owner = functions[key], label.removesuffix(f" {limit.quantity}")
            shift = float(limit.offset[k]) - function.offset if limit.derivative == 0 else 0.0
            bound = Bound(owner, float(limit.lower[k]), float(limit.upper[k]), shift, use_of[label])
            function.bounds[limit.derivative].append(bound)
    for key, function in functions.items():
        if key not in joints:
            function.name = _name(function, robot)
    return list(functions.values())


def _name(function: MotionFunction, robot: Robot) -> str:
    """Owners of the limits and the limited function, such as ``drives z3, z4: q2 + q3``."""
    owners = list(dict.fromkeys(bound.owner for bounds in function.bounds for bound in bounds))
    names = [owner.removeprefix("drive ") for owner in owners]
    text = ""
    for name, factor in zip(robot.joint_names, function.row, strict=True):
        if factor != 0.0:
            sign = " - " if factor < 0 else " + "
            text += (sign if text or factor < 0 else "") + (f"{abs(factor):g} " if abs(factor) != 1.0 else "") + name
    if function.offset != 0.0:
        text += f" {'-' if function.offset < 0 else '+'} {abs(function.offset):.3g}"
    return f"{'drives' if len(names) > 1 else 'drive'} {', '.join(names)}: {text.strip()}"


def motion_figure(design: Design) -> Figure:
    """Draw position, velocity, acceleration, limited jerk and functions of every joint, and torques."""
    functions = motion_functions(design.moving, linear_limits(design.moving), design.limits)
    columns = 4 if any(function.bounds[3] for function in functions) else 3
    whole, _ = design.sequence.sampled()
    spans = design.sequence.spans()
    torques = limited_torques(design, whole)
    figure, rows = _panels(design, len(functions), columns, len(torques))
    samples, begin = _of_moving_joints(design, whole), spans[EXCITE][0]
    for row, function in zip(rows, functions, strict=False):
        _draw_row(row, function, samples, begin)
    for ax, torque in zip(rows[-1], torques, strict=False):
        _draw_torque(ax, torque, whole.time, begin)
    for ax in figure.axes:
        _shade_transfers(ax, spans)
    _label_times(figure)
    legend_below(figure, _legend(transfers=len(spans) > 1))
    return figure


def _of_moving_joints(design: Design, whole: Samples) -> Samples:
    index = [design.robot.joint_names.index(name) for name in design.moving.joint_names]
    return Samples(whole.time, *(x[:, index] for x in (whole.q, whole.dq, whole.ddq, whole.dddq)))


def _shade_transfers(ax: Axes, spans: dict[str, tuple[float, float]]) -> None:
    for segment, (start, end) in spans.items():
        if segment != EXCITE:
            ax.axvspan(start, end, color=BAND, linewidth=0, zorder=0.4)


def _panels(design: Design, rows: int, columns: int, torques: int) -> tuple[Figure, list[list[Axes]]]:
    """Create the panels, with the title and notes above them."""
    width = min(columns * (_PANEL.left + _PANEL_WIDTH) + _RIGHT, column_width())
    letters = int(72.0 * width / (_NOTE_LETTER * size_of("xtick.labelsize")))
    notes = [line for text in _notes(design, torques=torques > 0) for line in textwrap.wrap(text, letters)]
    letters = int(72.0 * width / (_TITLE_LETTER * size_of("figure.titlesize")))
    title = textwrap.wrap(_title(design), letters)
    title_line, note_line = (_LINE * size_of(f"{what}size") / 72.0 for what in ("figure.title", "xtick.label"))
    above = title_line * (len(title) - 1) + note_line * len(notes)
    panel = replace(_PANEL, widths=(_PANEL_WIDTH,) * columns)
    figure, axes = panels(rows, panel, "\n".join(title), above, torques)
    for ax in figure.axes:
        ax.tick_params(labelbottom=False)
    top = 1.0 - (_TITLE_BELOW_TOP + title_line * len(title)) / figure.get_figheight()
    style: dict[str, Any] = {"ha": "center", "va": "top", "fontsize": NOTE, "color": DARK}
    figure.text(0.5, top, plain("\n".join(notes)), **style)
    return figure, axes


def _title(design: Design) -> str:
    uses = [use for part in (design.limits, *design.transfer_limits.values()) for use in part]
    broken = sum(not use.holds for use in uses)
    plain = "every limit that was checked is kept" if design.unchecked else "every limit is kept"
    kept = kept_headline((each.limit for each in design.unchecked), plain)
    verdict = kept if broken == 0 else f"{broken} of {len(uses)} limits BROKEN"
    whole = "" if design.approach_and_return is None else f", {design.sequence.duration:g} s with approach and return"
    return f"{design.robot.name}: motion of {design.trajectory.duration:g} s{whole}, {verdict}"


def _notes(design: Design, *, torques: bool) -> list[str]:
    """What was checked, what was not and why, which joints rest, and what the torques are."""
    notes = [f"checked, with the number of limits: {checked_text(use.quantity for use in design.limits) or 'nothing'}"]
    if design.unchecked:
        notes.append(f"not checked: {', '.join(map(str, design.unchecked))}")
    resting = [name for name in design.robot.joint_names if name not in design.moving.joint_names]
    if resting:
        notes.append(f"at rest: {', '.join(resting)}")
    if torques:
        notes.append("torques are those of the description without Coulomb friction; limits less this and the reserve")
    return notes


def _draw_row(row: Sequence[Axes], function: MotionFunction, samples: Samples, begin: float) -> None:
    """Draw a function and its derivatives; the exciting motion, whose extremes are marked, starts at ``begin``."""
    lines = 1
    for derivative, ax in enumerate(row):
        bound = function.tightest(derivative)
        closest = None if bound is None else (begin + bound.use.time, bound.extreme, bound.use.holds)
        values = function.values(samples, derivative)
        draw_limited(ax, samples.time, values, function.allowed(derivative), closest)
        unit = typeset(function.unit + _PER_TIME[derivative])
        ax.set_ylabel(f"{QUANTITIES[derivative]} [{unit}]", fontsize=NOTE, color=DARK)
        if bound is None:
            write_use(ax, None, 0.0)
            continue
        owner = "" if bound.owner == f"joint {function.name}" else bound.owner
        lines = max(lines, write_use(ax, bound.use, bound.use.bound - bound.shift, owner))
    _write_name(row[0], function.name, min(len(row) * _PANEL_WIDTH, column_width() - _PANEL.left), lines)


def _write_name(ax: Axes, name: str, width: float, lines: int) -> None:
    """Write a name above the lines on the right of a panel, in a width [in]."""
    letters = int(72.0 * width / (_NAME_LETTER * size_of("axes.labelsize")))
    text = "\n".join(textwrap.wrap(ends(name, _NAME_LINES * letters), letters, break_on_hyphens=False))
    ax.set_title(typeset(text) + lines * "\n", **_NAME_STYLE)


def _draw_torque(ax: Axes, torque: LimitedTorque, time: Array, begin: float) -> None:
    use = torque.use
    closest = begin + use.time, use.extreme, use.holds
    draw_limited(ax, time, torque.values, torque.allowed, closest, far=np.inf)
    ax.set_ylabel(f"{'force' if torque.unit == 'N' else 'torque'} [{torque.unit}]", fontsize=NOTE, color=DARK)
    lines = write_use(ax, use, use.bound)
    _write_name(ax, torque.name, min(_PANEL_WIDTH, panel_width(ax)), lines)


def _label_times(figure: Figure) -> None:
    """Label the lowest panel of each column, whose last row may have some missing."""
    lowest: dict[int, Axes] = {}
    for ax in figure.axes:  # from the top
        place = ax.get_subplotspec()
        assert place is not None
        lowest[place.colspan.start] = ax
    for ax in lowest.values():
        ax.set_xlabel("time [s]", fontsize=LABEL, color=DARK)
        ax.tick_params(labelbottom=True)


def _legend(*, transfers: bool) -> list[Line2D | Patch]:
    return [
        *([Patch(color=BAND, label="approach, return")] if transfers else []),
        Line2D([], [], color=BLUE, linewidth=CURVE, label="planned motion"),
        Line2D([], [], color=VERMILLION, linewidth=1.0, label="limit"),
        Patch(color=FORBIDDEN, label="forbidden"),
        Line2D([], [], color=DARK, marker="o", markersize=DOT, linestyle="", label=_DOT_MEANING),
    ]
