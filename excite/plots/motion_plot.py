"""The motion over time: every joint and every other limited function, with its limits and their use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from constraints.bounds.certificate import LimitUse
from constraints.linear import QUANTITIES, LinearConstraint, linear_limits
from excite.design.design import Design
from excite.design.unchecked import Unchecked
from excite.plots.drawing_style import column_width
from excite.plots.style import (
    BAND,
    BLUE,
    DARK,
    FORBIDDEN,
    GREY,
    LABEL,
    NOTE,
    ROUND,
    TITLE_STYLE,
    VERMILLION,
    plain,
    shortened,
    tidy,
    typeset,
)
from excite.trajectories.sequence import EXCITE
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

# Layout [in]: panels of equal size, with room for the text around them. matplotlib's own layout takes seconds for it.
_PANEL_WIDTH, _PANEL_HEIGHT = 2.65, 1.2
_LEFT, _BELOW, _ABOVE, _RIGHT, _BETWEEN = 0.8, 0.9, 0.95, 0.2, 0.55
_TITLE_BELOW_TOP, _NOTE_BELOW_TOP, _LEGEND_ABOVE_BOTTOM, _LABEL_LEFT = 0.12, 0.36, 0.08, 0.46
_NAME_LENGTH = 90
_LEAST_FOR_LIMITS = 5.0  # width of a figure that has room for the limits' values [in]
_DOT = 4.5  # [pt]
_DOT_MEANING = "closest to a limit (100 % used: at the limit, 0 %: in mid-range)"
_NAME_STYLE: dict[str, Any] = {"loc": "left", "fontsize": LABEL, "fontweight": "bold", "color": DARK}
_FAR = 6.0  # a bound further from the curve than this many times the curve's height is not in view
_FLAT = 1e-9  # a curve of less height [SI] counts as flat
_PER_TIME = ("", "/s", "/s^2", "/s^3")


@dataclass(frozen=True)
class Bound:
    """One limit of a function or of one of its derivatives.

    Parameters
    ----------
    owner : str
        ``joint NAME`` or ``drive NAME``.
    lower, upper : float
        Bounds on the limited value.
    shift : float
        Limited value minus the function as drawn.
    use : LimitUse
        Use of the limit by the motion.
    """

    owner: str
    lower: float
    upper: float
    shift: float
    use: LimitUse

    @property
    def extreme(self) -> float:
        """The extreme value of the function as drawn."""
        return self.use.extreme - self.shift


@dataclass
class MotionFunction:
    """A function ``row q + offset`` of the joint positions, drawn in one row of panels.

    Parameters
    ----------
    name : str
    row : ndarray, shape (n,)
    unit : str
        ``rad`` or ``m``.
    offset : float
    bounds : list of list of Bound
        Per order of derivative.
    """

    name: str
    row: Array
    unit: str
    offset: float = 0.0
    bounds: list[list[Bound]] = field(default_factory=lambda: [[] for _ in QUANTITIES])

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
    """Joints, then the other limited functions; limits on the same function of the joints are grouped.

    Parameters
    ----------
    robot : Robot
        Robot with the moving joints only.
    limits : sequence of LinearConstraint
    uses : sequence of LimitUse
        One for each label.
    """
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
    """Draw position, velocity, acceleration (and jerk, where limited) of every joint and limited function.

    Parameters
    ----------
    design : Design

    Returns
    -------
    Figure
        One row of panels per joint, and per drive coordinate with limits that is not a joint's; one column per
        quantity. The forbidden range is shaded; a dot marks the value over continuous time that comes closest to a
        limit, and the number above the panel is the fraction of the distance from mid-range to the limit that the
        exciting motion uses. Approach and return are shaded too.
    """
    limits = linear_limits(design.moving)
    functions = motion_functions(design.moving, limits, design.limits)
    columns = 4 if any(function.bounds[3] for function in functions) else 3
    figure, panels = _panels(len(functions), columns)
    height = figure.get_figheight()
    figure.suptitle(plain(_title(design)), y=1.0 - _TITLE_BELOW_TOP / height, va="top", **TITLE_STYLE)
    if design.unchecked:
        figure.text(
            0.5,
            1.0 - _NOTE_BELOW_TOP / height,
            _not_checked(design.unchecked),
            ha="center",
            va="top",
            fontsize=NOTE,
            color=DARK,
        )
    samples, spans = _whole_motion(design)
    for row, function in zip(panels, functions, strict=True):
        for derivative, ax in enumerate(row):
            _draw(ax, function, derivative, samples, spans[EXCITE][0])
            _shade_transfers(ax, spans)
        row[0].set_title(typeset(shortened(function.name, _NAME_LENGTH)) + "\n", **_NAME_STYLE)  # a line higher
    for ax in panels[-1]:
        ax.set_xlabel("time [s]", fontsize=LABEL, color=DARK)
    place = (0.5, _LEGEND_ABOVE_BOTTOM / figure.get_figheight())
    handles = _legend(len(spans) > 1)
    figure.legend(
        handles=handles, loc="lower center", bbox_to_anchor=place, ncols=len(handles), fontsize=LABEL, frameon=False
    )
    return figure


def _whole_motion(design: Design) -> tuple[Samples, dict[str, tuple[float, float]]]:
    """Motion of the moving joints with approach and return, and the segments' times."""
    sequence = design.sequence
    whole, _ = sequence.sampled()
    index = [design.robot.joint_names.index(name) for name in design.moving.joint_names]
    return Samples(whole.time, *(x[:, index] for x in (whole.q, whole.dq, whole.ddq, whole.dddq))), sequence.spans()


def _shade_transfers(ax: Axes, spans: dict[str, tuple[float, float]]) -> None:
    for segment, (start, end) in spans.items():
        if segment != EXCITE:
            ax.axvspan(start, end, color=BAND, linewidth=0, zorder=0.4)


def _panels(rows: int, columns: int) -> tuple[Figure, list[list[Axes]]]:
    """Create a figure with panels of the same size for any number of them, and room for the text."""
    width = columns * (_LEFT + _PANEL_WIDTH) + _RIGHT
    height = _ABOVE + rows * _PANEL_HEIGHT + (rows - 1) * _BETWEEN + _BELOW
    figure = Figure(figsize=(width, height), facecolor="white")
    figure.subplots_adjust(
        left=_LEFT / width,
        right=1.0 - _RIGHT / width,
        bottom=_BELOW / height,
        top=1.0 - _ABOVE / height,
        wspace=_LEFT / _PANEL_WIDTH,
        hspace=_BETWEEN / _PANEL_HEIGHT,
    )
    panels = figure.subplots(rows, columns, sharex=True, squeeze=False).tolist()
    for ax in figure.axes:
        ax.yaxis.set_label_coords(-_LABEL_LEFT / _PANEL_WIDTH, 0.5)
    return figure, panels


def _not_checked(unchecked: Sequence[Unchecked]) -> str:
    return plain(f"not checked: {', '.join(each.limit for each in unchecked)}")


def _title(design: Design) -> str:
    uses = [use for part in (design.limits, *design.transfer_limits.values()) for use in part]
    broken = sum(not use.holds for use in uses)
    kept = "every limit that was checked is kept" if design.unchecked else "every limit is kept"
    verdict = kept if broken == 0 else f"{broken} of {len(uses)} limits BROKEN"
    resting = [name for name in design.robot.joint_names if name not in design.moving.joint_names]
    rest = f"; {shortened(', '.join(resting), 60)} rest{'s' if len(resting) == 1 else ''}" if resting else ""
    whole = "" if design.approach_and_return is None else f", {design.sequence.duration:g} s with approach and return"
    return f"{design.robot.name}: motion of {design.trajectory.duration:g} s{whole}, {verdict}{rest}"


def _draw(ax: Axes, function: MotionFunction, derivative: int, samples: Samples, begin: float) -> None:
    """Draw the function over time; the exciting motion, whose extremes are marked, starts at ``begin``."""
    values = function.values(samples, derivative)
    bound = function.tightest(derivative)
    allowed = function.allowed(derivative)
    view = view_range(np.append(values, bound.extreme) if bound is not None else values, allowed)
    tidy(ax)
    _shade(ax, allowed, view)
    ax.plot(samples.time, values, color=BLUE, linewidth=1.4)
    if bound is not None:
        colour = DARK if bound.use.holds else VERMILLION
        ax.plot([begin + bound.use.time], [bound.extreme], "o", color=colour, markersize=_DOT, clip_on=False, zorder=3)
    ax.set_xlim(samples.time[0], samples.time[-1])
    ax.set_ylim(*view)
    ax.yaxis.set_major_locator(MaxNLocator(5, steps=ROUND))
    unit = typeset(function.unit + _PER_TIME[derivative])
    ax.set_ylabel(f"{QUANTITIES[derivative]} [{unit}]", fontsize=NOTE, color=DARK)
    text, text_colour = _used(function, bound, view)
    ax.set_title(typeset(text), loc="right", fontsize=NOTE, color=text_colour)


def view_range(values: Array, allowed: tuple[float, float]) -> tuple[float, float]:
    """Vertical range of a panel: the curve, and each bound that is not so far off as to flatten the curve.

    Parameters
    ----------
    values : ndarray
        Values that must be in view.
    allowed : (float, float)
        Lower and upper bound.
    """
    low, high = float(values.min()), float(values.max())
    reach = _FAR * (high - low) if high - low > _FLAT else np.inf
    near = [bound for bound in allowed if np.isfinite(bound) and max(low - bound, bound - high) <= reach]
    bottom, top = min(low, *near, high), max(low, *near, high)
    pad = 0.1 * (top - bottom) if top - bottom > _FLAT else 1.0
    return bottom - pad, top + pad


def _shade(ax: Axes, allowed: tuple[float, float], view: tuple[float, float]) -> None:
    """Shade the forbidden range, from each bound in view to the panel's edge."""
    for bound, edge in zip(allowed, view, strict=True):
        if view[0] < bound < view[1]:
            ax.axhspan(min(bound, edge), max(bound, edge), color=FORBIDDEN, linewidth=0, zorder=0.5)
            ax.axhline(bound, color=VERMILLION, linewidth=1.0, zorder=1.5)


def _used(function: MotionFunction, bound: Bound | None, view: tuple[float, float]) -> tuple[str, str]:
    """Use of a limit as text, and the text's colour."""
    if bound is None:
        return "no limit", GREY
    value = bound.use.bound - bound.shift
    whose = "" if bound.owner == f"joint {function.name}" else f"{bound.owner}, "
    where = "" if view[0] < value < view[1] else " (out of view)"
    text = f"{100 * bound.use.use:.1f} % used"
    if column_width() > _LEAST_FOR_LIMITS:
        text = f"{whose}limit {float(f'{value:.4g}'):g}{where}: {text}"
    return (text, DARK) if bound.use.holds else (f"{text}, BROKEN", VERMILLION)


def _legend(transfers: bool) -> list[Line2D | Patch]:
    return [
        *([Patch(color=BAND, label="approach, return")] if transfers else []),
        Line2D([], [], color=BLUE, linewidth=1.4, label="planned motion"),
        Line2D([], [], color=VERMILLION, linewidth=1.0, label="limit"),
        Patch(color=FORBIDDEN, label="forbidden"),
        Line2D([], [], color=DARK, marker="o", markersize=_DOT, linestyle="", label=_DOT_MEANING),
    ]
