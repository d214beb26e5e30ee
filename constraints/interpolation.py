"""Limits of what a controller makes of samples: polynomials between them, with exact extrema.

Between two samples, h apart, a controller lays a line through the positions, the cubic with the velocities too, or the
quintic with the accelerations as well (that of ros2_control's joint_trajectory_controller, `Trajectory::
interpolate_between_points`). Where a file has no velocities or accelerations, cubics and quintics are splines through
its positions, at rest at both ends. Velocities, accelerations and jerks of lines are divided differences of the
samples, each a mean of that derivative of any smooth motion through them [de Boor 2001, ch. IX].
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from math import factorial

import numpy as np
import scipy

from constraints.certificate import Extrema, LimitUse, limit_uses, worst_of_each
from constraints.enclosure import hulled_extrema
from constraints.linear import LinearConstraint
from regressors.errors import percent
from regressors.samples import Array, Samples

ALLOWED = 1e-6  # of a bound, that may be passed between samples
_ROUNDING = 1e-12  # rad or m, for bounds at zero


class Curve(Enum):
    """What passes through samples; the value is its name in the plural."""

    LINES = "lines"
    CUBICS = "cubics"
    QUINTICS = "quintics"


@dataclass(frozen=True)
class InterpolatedLimits:
    """Use of the limits by a curve through samples."""

    curve: Curve
    uses: tuple[LimitUse, ...]  # of each limit the use that comes closest, the closest first

    @property
    def broken(self) -> tuple[LimitUse, ...]:
        """Limits that are passed by more than 1e-6 of the bound."""
        return tuple(use for use in self.uses if use.margin < -ALLOWED * abs(use.bound) - _ROUNDING)

    def to_dict(self) -> dict[str, object]:
        """Curve, verdict, and the limit that is used most, for JSON."""
        closest = {"closest": self.uses[0].label, "use": self.uses[0].use} if self.uses else {}
        return {"curve": self.curve.value, "holds": not self.broken, **closest}


def interpolated_limits(
    limits: Iterable[LinearConstraint], samples: Samples, curve: Curve, given: int = 2
) -> InterpolatedLimits:
    """Certificate of limits for a curve through samples."""
    if curve is Curve.LINES:
        extrema = [(limit, _of_lines(samples, limit)) for limit in limits]
    else:
        pieces = curve_pieces(samples, curve, given)
        extrema = [(limit, _of_pieces(samples.time, pieces, limit)) for limit in limits]
    worst = worst_of_each(use for limit, reached in extrema for use in limit_uses(limit, reached))
    return InterpolatedLimits(curve, tuple(sorted(worst, key=lambda use: -use.use)))


def curve_pieces(samples: Samples, curve: Curve, given: int = 2) -> Array:
    """Coefficients of a curve between samples, shape (d + 1, N - 1, n), highest power of ``t - t_k`` first."""
    h = np.diff(samples.time)[:, None]
    q, rise = samples.q[:-1], np.diff(samples.q, axis=0)
    if curve is Curve.LINES:
        return np.stack([rise / h, q])
    degree, needed = (3, 1) if curve is Curve.CUBICS else (5, 2)
    if given < needed:
        still = np.zeros(samples.q.shape[1])
        ends = [(order, still) for order in range(1, degree // 2 + 1)]
        spline = scipy.interpolate.make_interp_spline(samples.time, samples.q, degree, bc_type=(ends, ends))
        return np.stack([spline(samples.time[:-1], nu=p) / factorial(p) for p in range(degree, -1, -1)])
    v = samples.dq[:-1]
    rise, slope = rise - h * v, np.diff(samples.dq, axis=0)
    if curve is Curve.CUBICS:
        return np.stack([(h * slope - 2 * rise) / h**3, (3 * rise - h * slope) / h**2, v, q])
    a, bend = samples.ddq[:-1], np.diff(samples.ddq, axis=0)
    rise, slope = rise - h**2 / 2 * a, slope - h * a
    a3 = (10 * rise - 4 * h * slope + h**2 / 2 * bend) / h**3
    a4 = (-15 * rise + 7 * h * slope - h**2 * bend) / h**4
    a5 = (6 * rise - 3 * h * slope + h**2 / 2 * bend) / h**5
    return np.stack([a5, a4, a3, a / 2, v, q])


def curves_text(certified: Sequence[InterpolatedLimits]) -> str:
    """By which curves the limits are kept, and which of the others passes what, and by how much of it."""
    kept = [each.curve.value for each in certified if not each.broken]
    first = [(each.curve.value, each.broken[0]) for each in certified if each.broken]
    passed = [f"{curve} pass {use.label} by {percent(use.use - 1.0)}" for curve, use in first]
    return "; ".join([*([f"kept by {' and '.join(', '.join(kept).rsplit(', ', 1))}"] if kept else []), *passed])


def _of_pieces(time: Array, pieces: Array, limit: LinearConstraint) -> Extrema:
    for _ in range(limit.derivative):
        pieces = pieces[:-1] * np.arange(pieces.shape[0] - 1, 0, -1.0)[:, None, None]
    functions = pieces @ limit.matrix.T
    functions[-1] += limit.offset
    return hulled_extrema(time, functions)


def _of_lines(samples: Samples, limit: LinearConstraint) -> Extrema:
    """Positions, or divided differences; the robot rests before the first sample and after the last."""
    order, time = limit.derivative, samples.time
    first, last = time[1] - time[0], time[-1] - time[-2]
    before, after = np.arange(-order, 0.0), np.arange(1.0, order + 1.0)
    at = np.concatenate([time[0] + first * before, time, time[-1] + last * after])
    values = np.pad(samples.q @ limit.matrix.T + limit.offset, ((order, order), (0, 0)), mode="edge")
    for k in range(1, order + 1):
        values = k * np.diff(values, axis=0) / (at[k:] - at[:-k])[:, None]
    instants = np.clip(at[: len(values)], time[0], time[-1])
    return Extrema.among(values.T, [instants] * values.shape[1])
