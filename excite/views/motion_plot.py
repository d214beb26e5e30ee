"""The motion over time: every joint, every other limited function and torque, with its limits and their use."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from constraints.certificate import LimitUse
from constraints.linear import QUANTITIES, LinearConstraint, linear_limits
from excite.design.design import Design
from excite.design.stated_limits import checked_text, kept_headline
from excite.trajectories.sequence import EXCITE
from excite.views.panels import NAME_STYLE, Panel, ends, legend_below, panels
from excite.views.player_data import of_some_joints
from excite.views.style import (
    BAND,
    BLUE,
    DARK,
    FORBIDDEN,
    GREY,
    LABEL,
    NOTE,
    ROUND,
    VERMILLION,
    broken,
    column_width,
    panel_width,
    plain,
    size_of,
    typeset,
)
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

Range = tuple[float, float]

DOT = 4.5  # [pt]
CURVE = 1.4  # [pt]
_FAR = 6.0
_FLAT = 1e-9  # a curve of less height [SI] counts as flat
_LETTERS = 52  # above a panel
_LEAST_FOR_LIMITS = 5.0  # width of a figure that has room for the limits' values [in]
_TORQUE = " torque"


def draw_limited(
    ax: Axes, time: Array, values: Array, allowed: Range, closest: tuple[float, float, bool] | None, far: float = _FAR
) -> None:
    """Draw a curve, shade what its limits forbid, and mark the value that comes closest to one."""  # time, values (N,)
    view = view_range(values if closest is None else np.append(values, closest[1]), allowed, far)
    shade(allowed, view, ax.axhspan, ax.axhline)
    ax.plot(time, values, color=BLUE, linewidth=CURVE)
    if closest is not None:
        colour = DARK if closest[2] else VERMILLION
        ax.plot(closest[:1], closest[1:2], "o", color=colour, markersize=DOT, clip_on=False, zorder=3)
    ax.set_xlim(time[0], time[-1])
    ax.set_ylim(*view)
    ax.yaxis.set_major_locator(MaxNLocator(5, steps=ROUND))


def view_range(values: Array, allowed: Range, far: float = _FAR) -> Range:
    """Vertical range of a panel: the curve, and each bound that is not so far off as to flatten the curve."""
    low, high = float(values.min()), float(values.max())
    reach = far * (high - low) if high - low > _FLAT else np.inf
    near = [bound for bound in allowed if np.isfinite(bound) and max(low - bound, bound - high) <= reach]
    bottom, top = min(low, *near, high), max(low, *near, high)
    pad = 0.1 * (top - bottom) if top - bottom > _FLAT else 1.0
    return bottom - pad, top + pad


def shade(allowed: Range, view: Range, span: Callable[..., object], line: Callable[..., object]) -> None:
    """Shade the forbidden range, from each bound in view to the panel's edge."""
    for bound, edge in zip(allowed, view, strict=True):
        if view[0] < bound < view[1]:
            span(min(bound, edge), max(bound, edge), color=FORBIDDEN, linewidth=0, zorder=0.5)
            line(bound, color=VERMILLION, linewidth=1.0, zorder=1.5)


def write_use(ax: Axes, use: LimitUse | None, bound: float, owner: str = "") -> int:
    """Write above a panel how much of its limit is used; number of lines."""
    text, colour = "no limit", GREY
    if use is not None:
        low, high = ax.get_ylim()
        where = "" if low < bound < high else " (out of view)"
        limit = f"{owner}, " * bool(owner) + f"limit {float(f'{bound:.4g}'):g}{where}: "
        text = limit * (column_width() > _LEAST_FOR_LIMITS) + f"{100 * use.use:.1f} % used"
        text, colour = (text, DARK) if use.holds else (f"{text}, BROKEN", VERMILLION)
    lines = broken(textwrap.fill(text, _LETTERS, break_on_hyphens=False), panel_width(ax)).split("\n")
    ax.set_title(typeset("\n".join(lines)), loc="right", y=1.0, fontsize=NOTE, color=colour)
    return len(lines)


def limited_torques(design: Design, motion: Samples) -> list[tuple[str, Array, Range, LimitUse]]:
    """Name, values, limits and use of every checked torque, without Coulomb friction and less it, and of balance."""
    shown = (use for use in design.limits if use.label.endswith(_TORQUE) or use.quantity == "balance")
    uses = {use.label: use for use in shown}
    joints = design.robot.joint_names if design.approach_and_return is not None else design.moving.joint_names
    samples = of_some_joints(motion, design.robot, joints)
    torques = []
    known = design.nonlinear if design.approach_and_return is None else design.imposed_on(joints)
    for limit in known if uses else ():
        if not any(label in uses for label in limit.labels):
            continue
        values = limit.shown(limit.values(samples))
        for label in dict.fromkeys(limit.labels):
            if label in uses:
                parts = np.array([each == label for each in limit.labels])  # of what slides, several
                allowed, worst = (float(limit.lower[parts][0]), float(limit.upper[parts][0])), values[:, parts].min(1)
                torques.append((label.removesuffix(_TORQUE).removeprefix("joint "), worst, allowed, uses[label]))
    return torques


_PANEL_WIDTH = 2.65  # [in]
_PANEL = Panel((_PANEL_WIDTH,), 1.2, left=0.8, between=0.68, below=0.9)
_RIGHT, _TITLE_BELOW_TOP = 0.2, 0.12  # [in]
_LINE = 1.33  # height of a line over the size of its font
_TITLE_LETTER, _NOTE_LETTER, _NAME_LETTER = 0.675, 0.66, 0.74  # mean width over the size of the font
_NAME_LINES = 5
_DOT_MEANING = "closest to a limit (100 % used: at the limit, 0 %: in mid-range)"
_PER_TIME = ("", "/s", "/s^2", "/s^3")


@dataclass(frozen=True)
class Bound:
    """One limit of a function or of one of its derivatives."""

    owner: str  # ``joint NAME`` or ``drive NAME``
    lower: float  # bounds on the limited value
    upper: float
    shift: float  # limited value minus the function as drawn
    use: LimitUse  # use of the limit by the motion


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

    def allowed(self, derivative: int) -> Range:
        """Range that all bounds together allow, infinite where there is none."""
        bounds = self.bounds[derivative]
        lower = max((bound.lower - bound.shift for bound in bounds), default=-np.inf)
        return lower, min((bound.upper - bound.shift for bound in bounds), default=np.inf)


def motion_functions(
    robot: Robot, limits: Sequence[LinearConstraint], uses: Sequence[LimitUse]
) -> list[MotionFunction]:
    """Joints, then the other limited functions; limits on the same function of the joints are grouped."""
    use_of = {use.label: use for use in uses}
    functions = {
        tuple(row): MotionFunction(joint.name, row, joint.unit)
        for joint, row in zip(robot.joints, np.eye(robot.n), strict=True)
    }
    for limit in limits:
        for k, label in enumerate(limit.labels):
            new = MotionFunction("", limit.matrix[k], limit.units[k].split("/")[0], float(limit.offset[k]))
            function = functions.setdefault(tuple(limit.matrix[k] + 0.0), new)
            owner = label.removesuffix(f" {limit.quantity}")
            shift = float(limit.offset[k]) - function.offset if limit.derivative == 0 else 0.0
            bound = Bound(owner, float(limit.lower[k]), float(limit.upper[k]), shift, use_of[label])
            function.bounds[limit.derivative].append(bound)
    for function in functions.values():
        function.name = function.name or _name(function, robot)
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
    samples, begin = of_some_joints(whole, design.robot, design.moving.joint_names), spans[EXCITE][0]
    for row, function in zip(rows, functions, strict=False):
        _draw_row(row, function, samples, begin)
    for ax, (name, values, allowed, use) in zip(rows[-1], torques, strict=False):
        draw_limited(ax, whole.time, values, allowed, (begin + use.time, use.extreme, use.holds), far=np.inf)
        what = "force" if use.unit == "N" else "moment" if use.quantity == "balance" else "torque"
        ax.set_ylabel(f"{what} [{use.unit}]", fontsize=NOTE, color=DARK)
        _write_name(ax, name, write_use(ax, use, use.bound))
    for segment, (start, end) in spans.items():
        for ax in figure.axes if segment != EXCITE else ():
            ax.axvspan(start, end, color=BAND, linewidth=0, zorder=0.4)
    for ax in {ax.get_position().x0: ax for ax in figure.axes}.values():  # the lowest of each column comes last
        ax.set_xlabel("time [s]", fontsize=LABEL, color=DARK)
        ax.tick_params(labelbottom=True)
    meanings = [
        *([Patch(color=BAND, label="approach, return")] if len(spans) > 1 else []),
        Line2D([], [], color=BLUE, linewidth=CURVE, label="planned motion"),
        Line2D([], [], color=VERMILLION, linewidth=1.0, label="limit"),
        Patch(color=FORBIDDEN, label="forbidden"),
        Line2D([], [], color=DARK, marker="o", markersize=DOT, linestyle="", label=_DOT_MEANING),
    ]
    legend_below(figure, meanings)
    return figure


def _panels(design: Design, rows: int, columns: int, torques: int) -> tuple[Figure, list[list[Axes]]]:
    """Create the panels, with the title and notes above them."""
    width = min(columns * (_PANEL.left + _PANEL_WIDTH) + _RIGHT, column_width())
    letters = int(72.0 * width / (_NOTE_LETTER * size_of("xtick.labelsize")))
    notes = [line for text in _notes(design) for line in textwrap.wrap(text, letters)]
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


def _notes(design: Design) -> list[str]:
    """What was checked, what was not and why, which joints rest, and what the torques are."""
    notes = [f"checked, with the number of limits: {checked_text(use.quantity for use in design.limits) or 'nothing'}"]
    if design.unchecked:
        notes.append(f"not checked: {', '.join(map(str, design.unchecked))}")
    resting = [name for name in design.robot.joint_names if name not in design.moving.joint_names]
    if resting:
        notes.append(f"at rest: {', '.join(resting)}")
    if any(use.label.endswith(_TORQUE) for use in design.limits):
        notes.append("torques are those of the description without Coulomb friction; limits less this and the reserve")
    return notes


def _draw_row(row: Sequence[Axes], function: MotionFunction, samples: Samples, begin: float) -> None:
    """Draw a function and its derivatives; the exciting motion, whose extremes are marked, starts at ``begin``."""
    lines = 1
    for derivative, ax in enumerate(row):
        bound = max(function.bounds[derivative], key=lambda bound: bound.use.use, default=None)  # used most
        closest = None if bound is None else (begin + bound.use.time, bound.use.extreme - bound.shift, bound.use.holds)
        values = function.values(samples, derivative)
        draw_limited(ax, samples.time, values, function.allowed(derivative), closest)
        unit = typeset(function.unit + _PER_TIME[derivative])
        ax.set_ylabel(f"{QUANTITIES[derivative]} [{unit}]", fontsize=NOTE, color=DARK)
        if bound is None:
            write_use(ax, None, 0.0)
            continue
        owner = "" if bound.owner == f"joint {function.name}" else bound.owner
        lines = max(lines, write_use(ax, bound.use, bound.use.bound - bound.shift, owner))
    _write_name(row[0], function.name, lines)


def _write_name(ax: Axes, name: str, lines: int) -> None:
    """Write a name above the lines on the right of a panel."""
    letters = int(72.0 * min(_PANEL_WIDTH, panel_width(ax)) / (_NAME_LETTER * size_of("axes.labelsize")))
    text = "\n".join(textwrap.wrap(ends(name, _NAME_LINES * letters), letters, break_on_hyphens=False))
    ax.set_title(typeset(text) + lines * "\n", **NAME_STYLE)
