"""The motion over time: every joint, every other limited function and torque, with its limits and their use."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from constraints.bounds.certificate import LimitUse
from constraints.linear import QUANTITIES, LinearConstraint, linear_limits
from excite.design.design import Design
from excite.design.unchecked import checked_text, kept_headline
from excite.plots.limit_panel import CURVE, DOT, draw_limited, write_use
from excite.plots.style import (
    BAND,
    BLUE,
    DARK,
    FORBIDDEN,
    LABEL,
    NOTE,
    TITLE_STYLE,
    VERMILLION,
    plain,
    typeset,
)
from excite.plots.timeline import ends
from excite.plots.torque_panels import LimitedTorque, limited_torques
from excite.trajectories.sequence import EXCITE
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

# Layout [in]: panels of equal size, with room for the text around them. matplotlib's own layout takes seconds for it.
_PANEL_WIDTH, _PANEL_HEIGHT = 2.65, 1.2
_LEFT, _BELOW, _ABOVE, _RIGHT, _BETWEEN = 0.8, 0.9, 0.7, 0.2, 0.68
_TITLE_BELOW_TOP, _LEGEND_ABOVE_BOTTOM, _LABEL_LEFT = 0.12, 0.08, 0.46
_TITLE_LINE, _NOTE_LINE = 0.24, 0.15
_TITLE_LETTERS, _NOTE_LETTERS, _NAME_LETTERS = 8.2, 13.5, 10.8  # per inch
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
    heading = _Heading.of(design, columns * (_LEFT + _PANEL_WIDTH) + _RIGHT, torques=bool(torques))
    figure, panels = _panels(len(functions), -(-len(torques) // columns), columns, heading)
    samples, begin = _of_moving_joints(design, whole), spans[EXCITE][0]
    for row, function in zip(panels, functions, strict=False):
        _draw_row(row, function, samples, begin)
    flat = [ax for row in panels[len(functions) :] for ax in row]
    for ax, torque in zip(flat, torques, strict=False):
        _draw_torque(ax, torque, whole.time, begin)
    for ax in flat[len(torques) :]:
        ax.remove()
    for ax in figure.axes:
        _shade_transfers(ax, spans)
    _label_times(panels, len(flat) - len(torques))
    _legend_below(figure, transfers=len(spans) > 1)
    return figure


def _of_moving_joints(design: Design, whole: Samples) -> Samples:
    index = [design.robot.joint_names.index(name) for name in design.moving.joint_names]
    return Samples(whole.time, *(x[:, index] for x in (whole.q, whole.dq, whole.ddq, whole.dddq)))


def _shade_transfers(ax: Axes, spans: dict[str, tuple[float, float]]) -> None:
    for segment, (start, end) in spans.items():
        if segment != EXCITE:
            ax.axvspan(start, end, color=BAND, linewidth=0, zorder=0.4)


@dataclass(frozen=True)
class _Heading:
    """Lines above the panels."""

    title: tuple[str, ...]
    notes: tuple[str, ...]

    @classmethod
    def of(cls, design: Design, width: float, *, torques: bool) -> _Heading:
        letters = int(width * _NOTE_LETTERS)
        notes = [line for text in _notes(design, torques=torques) for line in textwrap.wrap(text, letters)]
        return cls(tuple(textwrap.wrap(_title(design), int(width * _TITLE_LETTERS))), tuple(notes))

    @property
    def height(self) -> float:
        """All lines [in]."""
        return _TITLE_LINE * len(self.title) + _NOTE_LINE * len(self.notes)

    def write(self, figure: Figure) -> None:
        height, top = figure.get_figheight(), _TITLE_BELOW_TOP
        figure.suptitle(plain("\n".join(self.title)), y=1.0 - top / height, va="top", **TITLE_STYLE)
        top += _TITLE_LINE * len(self.title)
        style: dict[str, Any] = {"ha": "center", "va": "top", "fontsize": NOTE, "color": DARK}
        figure.text(0.5, 1.0 - top / height, plain("\n".join(self.notes)), **style)


def _panels(functions: int, torque_rows: int, columns: int, heading: _Heading) -> tuple[Figure, list[list[Axes]]]:
    """Create a figure with panels of the same size for any number of them, and room for the text."""
    rows, above = functions + torque_rows, _ABOVE + heading.height
    width = columns * (_LEFT + _PANEL_WIDTH) + _RIGHT
    height = above + rows * _PANEL_HEIGHT + (rows - 1) * _BETWEEN + _BELOW
    figure = Figure(figsize=(width, height), facecolor="white")
    figure.subplots_adjust(
        left=_LEFT / width,
        right=1.0 - _RIGHT / width,
        bottom=_BELOW / height,
        top=1.0 - above / height,
        wspace=_LEFT / _PANEL_WIDTH,
        hspace=_BETWEEN / _PANEL_HEIGHT,
    )
    panels = figure.subplots(rows, columns, squeeze=False).tolist()
    for ax in figure.axes:
        ax.tick_params(labelbottom=False)
        ax.yaxis.set_label_coords(-_LABEL_LEFT / _PANEL_WIDTH, 0.5)
    heading.write(figure)
    return figure, panels


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
    _write_name(row[0], function.name, len(row) * _PANEL_WIDTH, lines)


def _write_name(ax: Axes, name: str, width: float, lines: int) -> None:
    """Write a name above the lines on the right of a panel, in a width [in]."""
    letters = int(width * _NAME_LETTERS)
    text = "\n".join(textwrap.wrap(ends(name, _NAME_LINES * letters), letters, break_on_hyphens=False))
    ax.set_title(typeset(text) + lines * "\n", **_NAME_STYLE)


def _draw_torque(ax: Axes, torque: LimitedTorque, time: Array, begin: float) -> None:
    use = torque.use
    closest = begin + use.time, use.extreme, use.holds
    draw_limited(ax, time, torque.values, torque.allowed, closest, far=np.inf)
    ax.set_ylabel(f"{'force' if torque.unit == 'N' else 'torque'} [{torque.unit}]", fontsize=NOTE, color=DARK)
    lines = write_use(ax, use, use.bound)
    _write_name(ax, torque.name, _PANEL_WIDTH, lines)


def _label_times(panels: Sequence[Sequence[Axes]], missing: int) -> None:
    """Label the lowest panel of each column, whose last row may have some missing."""
    columns = len(panels[-1])
    for k, ax in enumerate(panels[-1]):
        lowest = ax if k < columns - missing else panels[-2][k]
        lowest.set_xlabel("time [s]", fontsize=LABEL, color=DARK)
        lowest.tick_params(labelbottom=True)


def _legend_below(figure: Figure, *, transfers: bool) -> None:
    place = (0.5, _LEGEND_ABOVE_BOTTOM / figure.get_figheight())
    handles = _legend(transfers)
    figure.legend(
        handles=handles, loc="lower center", bbox_to_anchor=place, ncols=len(handles), fontsize=LABEL, frameon=False
    )


def _legend(transfers: bool) -> list[Line2D | Patch]:
    return [
        *([Patch(color=BAND, label="approach, return")] if transfers else []),
        Line2D([], [], color=BLUE, linewidth=CURVE, label="planned motion"),
        Line2D([], [], color=VERMILLION, linewidth=1.0, label="limit"),
        Patch(color=FORBIDDEN, label="forbidden"),
        Line2D([], [], color=DARK, marker="o", markersize=DOT, linestyle="", label=_DOT_MEANING),
    ]
