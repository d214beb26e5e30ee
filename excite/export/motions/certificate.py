"""Limits of a motion, certified once more for what a controller makes of its samples."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from constraints.bounds.certificate import LimitUse, limit_uses, worst_of_each
from constraints.bounds.extrema import Extrema
from constraints.bounds.hulled_pieces import hulled_extrema
from constraints.linear import LinearConstraint, linear_limits
from excite.errors import BrokenLimitError
from excite.export.motions.sampled_design import SampledDesign
from excite.simulation.played_limits import broken_limits
from excite.simulation.source import MotionSource
from excite.trajectories.transfer import Transfer
from regressors.samples import Array

_ROUNDING = 1e-9  # of a limit that a formula may touch
_INTERPOLATED = 1e-4  # the same of what is interpolated


class Interpolation(Enum):
    """What a controller makes of samples, as the text of a note; the value says what is certified."""

    QUINTIC = "quintics through positions, velocities and accelerations, whose extrema are exact"
    LINEAR = "straight lines between positions; velocities, accelerations and jerks are differences of the samples"
    NOT_DOCUMENTED = "the design's formula; what the controller makes of the samples is not documented"
    NONE = "the design's formula; what a program makes of the samples between them is not known"


@dataclass(frozen=True)
class Certificate:
    """Limits of what is played.

    Parameters
    ----------
    uses : tuple of LimitUse
        Of each limit the use that comes closest, the closest first.
    broken : tuple of LimitUse
        Those beyond the limit by more than is allowed for interpolation.
    """

    uses: tuple[LimitUse, ...]
    broken: tuple[LimitUse, ...]


def check_formula(motion: SampledDesign) -> None:
    """Refuse a design whose own motion breaks a limit: exact over continuous time, of approach and return too.

    Torques are looked at in 4000 instants; of tool, obstacles and torques on approach and return the certificate of the
    design counts.

    Parameters
    ----------
    motion : SampledDesign

    Raises
    ------
    BrokenLimitError
        The message names the limit.
    """
    design = motion.design
    source = MotionSource(design.robot, design.task, design.trajectory, None, None, {"friction_plan": None})
    broken = [*broken_limits(source), *_broken_transfers(motion)]
    if broken:
        _refuse(broken[0], len(broken) - 1, "design it again within the limits")
    if design.broken:
        raise BrokenLimitError(
            f"the design does not keep its limits: {design.broken[0]}"
            + (f" and {len(design.broken) - 1} more" if len(design.broken) > 1 else "")
            + "; design it again within the limits"
        )


def _broken_transfers(motion: SampledDesign) -> list[LimitUse]:
    transfers = [piece.motion for piece in motion.sequence.pieces if isinstance(piece.motion, Transfer)]
    limits = linear_limits(motion.robot)
    uses = [use for transfer in transfers for limit in limits for use in limit_uses(limit, transfer.extrema(limit))]
    return [use for use in uses if use.margin < -_ROUNDING * abs(use.bound)]


def certify(motion: SampledDesign, interpolation: Interpolation) -> Certificate:
    """Certificate of the limits of joints and drives for what is interpolated.

    Parameters
    ----------
    motion : SampledDesign
        With the numbers that are written.
    interpolation : Interpolation
    """
    uses = []
    for limit in linear_limits(motion.robot):
        extrema = _EXTREMA[interpolation](motion, limit)
        uses += limit_uses(limit, extrema)
    worst = sorted(worst_of_each(uses), key=lambda use: -use.use)
    broken = (use for use in worst if use.margin < -_INTERPOLATED * abs(use.bound))
    return Certificate(tuple(worst), tuple(broken))


def deviation(motion: SampledDesign, interpolation: Interpolation) -> float | None:
    """Largest distance of what is interpolated from the design, in the middle of the steps [rad or m].

    None where it is not known what is interpolated.
    """
    if interpolation not in (Interpolation.QUINTIC, Interpolation.LINEAR):
        return None
    half = 0.5 * np.diff(motion.time)
    exact = motion.sequence.at(motion.time[:-1] + half)[0].q
    q = motion.samples.q
    lines = 0.5 * (q[1:] + q[:-1])
    if interpolation is Interpolation.LINEAR:
        return float(np.abs(lines - exact).max())
    powers = half[:, None] ** np.arange(5.0, -1.0, -1.0)[:, None, None]
    return float(np.abs((quintic_pieces(motion) * powers).sum(axis=0) - exact).max())


def check_interpolated(certificate: Certificate, interpolation: Interpolation) -> None:
    """Raise `BrokenLimitError` where what is interpolated breaks a limit."""
    if certificate.broken:
        worst, more = certificate.broken[0], len(certificate.broken) - 1
        _refuse(worst, more, f"that is of {interpolation.value}; raise `rate`")


def _refuse(worst: LimitUse, more: int, remedy: str) -> None:
    others = f"; {more} more limits are broken" if more else ""
    raise BrokenLimitError(
        f"the motion breaks a limit: {worst.label} is {worst.extreme:.6g} {worst.unit} at {worst.time:.3f} s, beyond "
        f"{worst.bound:.6g} {worst.unit}{others}; {remedy}"
    )


def _of_samples(motion: SampledDesign, limit: LinearConstraint) -> Extrema:
    return _extremes(limit.values(motion.samples), motion.time)


def _of_quintics(motion: SampledDesign, limit: LinearConstraint) -> Extrema:
    pieces = quintic_pieces(motion)
    for _ in range(limit.derivative):
        pieces = pieces[:-1] * np.arange(pieces.shape[0] - 1, 0, -1.0)[:, None, None]
    functions = pieces @ limit.matrix.T
    functions[-1] += limit.offset
    return hulled_extrema(motion.time, functions)


def quintic_pieces(motion: SampledDesign) -> Array:
    """Coefficients of the quintics between the samples, shape (6, N - 1, n), highest power first.

    On the step of length h from sample k, ``q = a0 + a1 t + ... + a5 t^5`` with the positions, velocities and
    accelerations of both ends; those of ros2_control's joint_trajectory_controller (`Trajectory::
    interpolate_between_points`).
    """
    samples = motion.samples
    h = np.diff(samples.time)[:, None]
    q, v, a = samples.q[:-1], samples.dq[:-1], samples.ddq[:-1]
    rise = samples.q[1:] - q - h * v - h**2 / 2 * a
    slope = samples.dq[1:] - v - h * a
    bend = samples.ddq[1:] - a
    a3 = (10 * rise - 4 * h * slope + h**2 / 2 * bend) / h**3
    a4 = (-15 * rise + 7 * h * slope - h**2 * bend) / h**4
    a5 = (6 * rise - 3 * h * slope + h**2 / 2 * bend) / h**5
    return np.stack([a5, a4, a3, a / 2, v, q])


def _of_lines(motion: SampledDesign, limit: LinearConstraint) -> Extrema:
    """Differences of the samples; the robot rests before the first and after the last."""
    z = motion.samples.q @ limit.matrix.T + limit.offset
    if limit.derivative == 0:
        return _extremes(z, motion.time)
    h, order = 1.0 / motion.rate, limit.derivative
    resting = np.concatenate([np.repeat(z[:1], order, axis=0), z, np.repeat(z[-1:], order, axis=0)])
    values = np.diff(resting, n=order, axis=0) / h**order
    return _extremes(values, np.asarray(h * np.arange(values.shape[0]), dtype=float))


def _extremes(values: Array, time: Array) -> Extrema:
    columns = np.arange(values.shape[1])
    low, high = values.argmin(axis=0), values.argmax(axis=0)
    return Extrema(values[low, columns], values[high, columns], time[low], time[high])


_EXTREMA = {
    Interpolation.QUINTIC: _of_quintics,
    Interpolation.LINEAR: _of_lines,
    Interpolation.NOT_DOCUMENTED: _of_samples,
    Interpolation.NONE: _of_samples,
}
