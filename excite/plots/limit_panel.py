"""A panel with a curve, the range that its limit forbids, and the value that comes closest to the limit."""

from __future__ import annotations

import textwrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from constraints.bounds.certificate import LimitUse
from excite.plots.drawing_style import column_width
from excite.plots.style import BLUE, DARK, FORBIDDEN, GREY, NOTE, ROUND, VERMILLION, tidy, typeset
from regressors.samples import Array

DOT = 4.5  # [pt]
CURVE = 1.4  # [pt]
_FAR = 6.0
_FLAT = 1e-9  # a curve of less height [SI] counts as flat
_LETTERS = 52  # above a panel
_LEAST_FOR_LIMITS = 5.0  # width of a figure that has room for the limits' values [in]


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
    lines = textwrap.wrap(text, _LETTERS, break_on_hyphens=False)
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
