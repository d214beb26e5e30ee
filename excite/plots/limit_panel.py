"""Panels with a curve, the range that its limit forbids, and the value closest to the limit; torques with limits."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from constraints.bounds.certificate import LimitUse
from constraints.nonlinear import NonlinearConstraint
from excite.design.design import Design
from excite.design.imposed_limits import nonlinear_limits
from excite.design.stated_limits import StatedWorld, stated_limits
from excite.plots.style import (
    BLUE,
    DARK,
    FORBIDDEN,
    GREY,
    NOTE,
    ROUND,
    VERMILLION,
    broken,
    column_width,
    panel_width,
    tidy,
    typeset,
)
from regressors.samples import Array, Samples

DOT = 4.5  # [pt]
CURVE = 1.4  # [pt]
_FAR = 6.0
_FLAT = 1e-9  # a curve of less height [SI] counts as flat
_LETTERS = 52  # above a panel
_LEAST_FOR_LIMITS = 5.0  # width of a figure that has room for the limits' values [in]
_TORQUE = " torque"


def draw_limited(
    ax: Axes,
    time: Array,
    values: Array,
    allowed: tuple[float, float],
    closest: tuple[float, float, bool] | None,
    far: float = _FAR,
) -> None:
    """Draw a curve, shade what its limits forbid, and mark the value that comes closest to one."""  # time, values (N,)
    view = view_range(values if closest is None else np.append(values, closest[1]), allowed, far)
    tidy(ax)
    _shade(ax, allowed, view)
    ax.plot(time, values, color=BLUE, linewidth=CURVE)
    if closest is not None:
        colour = DARK if closest[2] else VERMILLION
        ax.plot(closest[:1], closest[1:2], "o", color=colour, markersize=DOT, clip_on=False, zorder=3)
    ax.set_xlim(time[0], time[-1])
    ax.set_ylim(*view)
    ax.yaxis.set_major_locator(MaxNLocator(5, steps=ROUND))


def view_range(values: Array, allowed: tuple[float, float], far: float = _FAR) -> tuple[float, float]:
    """Vertical range of a panel: the curve, and each bound that is not so far off as to flatten the curve."""
    low, high = float(values.min()), float(values.max())
    reach = far * (high - low) if high - low > _FLAT else np.inf
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


def write_use(ax: Axes, use: LimitUse | None, bound: float, owner: str = "") -> int:
    """Write above a panel how much of its limit is used; number of lines."""
    text, colour = _used(use, bound, owner, ax.get_ylim())
    lines = broken(textwrap.fill(text, _LETTERS, break_on_hyphens=False), panel_width(ax)).split("\n")
    ax.set_title(typeset("\n".join(lines)), loc="right", y=1.0, fontsize=NOTE, color=colour)
    return len(lines)


def _used(use: LimitUse | None, bound: float, owner: str, view: tuple[float, float]) -> tuple[str, str]:
    """Use of a limit as text, and the text's colour."""
    if use is None:
        return "no limit", GREY
    whose = f"{owner}, " if owner else ""
    where = "" if view[0] < bound < view[1] else " (out of view)"
    used = f"{100 * use.use:.1f} % used"
    text = f"{whose}limit {float(f'{bound:.4g}'):g}{where}: {used}" if column_width() > _LEAST_FOR_LIMITS else used
    return (text, DARK) if use.holds else (f"{text}, BROKEN", VERMILLION)


@dataclass(frozen=True, eq=False)
class LimitedTorque:
    """Torque of a joint or a drive over the whole motion."""

    name: str  # of the joint, or ``drive NAME``
    unit: str
    values: Array  # (N,) without Coulomb friction [Nm or N]
    allowed: tuple[float, float]  # limits, less the reserve and Coulomb friction [Nm or N]
    use: LimitUse  # use of the limit by the exciting motion


def limited_torques(design: Design, motion: Samples) -> list[LimitedTorque]:
    """Every limited torque of a design; none where its torques are not checked."""
    uses = {use.label: use for use in design.limits if use.label.endswith(_TORQUE)}
    joints = design.robot.joint_names if design.approach_and_return is not None else design.moving.joint_names
    index = [design.robot.joint_names.index(name) for name in joints]
    samples = Samples(motion.time, *(x[:, index] for x in (motion.q, motion.dq, motion.ddq, motion.dddq)))
    torques = []
    for limit in _constraints(design, joints) if uses else ():
        if not any(label in uses for label in limit.labels):
            continue
        values = limit.shown(limit.values(samples))
        for k, label in enumerate(limit.labels):
            if label in uses:
                allowed = float(limit.lower[k]), float(limit.upper[k])
                name = label.removesuffix(_TORQUE).removeprefix("joint ")
                torques.append(LimitedTorque(name, limit.units[k], values[:, k], allowed, uses[label]))
    return torques


def _constraints(design: Design, joints: tuple[str, ...]) -> tuple[NonlinearConstraint, ...]:
    """Nonlinear limits as functions of some joints: of all, where approach and return move them."""
    if design.approach_and_return is None:
        return design.nonlinear
    stated = stated_limits(design.robot, joints, design.task, StatedWorld(design.shape))
    return (*nonlinear_limits(design.robot, joints, design.task), *stated.constraints)
