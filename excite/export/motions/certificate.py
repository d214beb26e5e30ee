"""Limits of a motion, certified once more for what a controller makes of its samples."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from constraints.certificate import LimitUse, limit_uses
from constraints.interpolation import (
    Curve,
    InterpolatedLimits,
    curve_pieces,
    curves_text,
    interpolated_limits,
)
from constraints.linear import linear_limits
from excite.errors import BrokenLimitError
from excite.export.motions.sampled_design import SampledDesign
from excite.tasks.reference import MotionSource, broken_limits
from excite.trajectories.transfer import Transfer

_ROUNDING = 1e-9  # of a limit that a formula may touch


class Interpolation(Enum):
    """What a controller makes of samples, as the text of a note; where it is not known, every curve is certified."""

    QUINTIC = "quintics through positions, velocities and accelerations, whose extrema are exact"
    LINEAR = "straight lines between positions; velocities, accelerations and jerks are differences of the samples"
    NOT_DOCUMENTED = "what the controller makes of the samples is not documented"
    NONE = "what a program makes of the samples between them is not known"

    @property
    def curves(self) -> tuple[Curve, ...]:
        """Curves that may pass through the samples."""
        return {Interpolation.QUINTIC: (Curve.QUINTICS,), Interpolation.LINEAR: (Curve.LINES,)}.get(self, tuple(Curve))


@dataclass(frozen=True)
class Certificate:
    """Limits of what is played."""

    curves: tuple[InterpolatedLimits, ...]  # of every curve that a controller may lay through the samples

    @property
    def uses(self) -> tuple[LimitUse, ...]:
        """Uses of the limits by every curve, the closest first."""
        return _closest_first(use for each in self.curves for use in each.uses)

    @property
    def broken(self) -> tuple[LimitUse, ...]:
        """Those beyond the limit by more than 1e-6 of it."""
        return _closest_first(use for each in self.curves for use in each.broken)

    @property
    def text(self) -> str:
        """By which curves the limits are kept, and by which they are passed, and by how much."""
        return curves_text(self.curves)


def _closest_first(uses: Iterable[LimitUse]) -> tuple[LimitUse, ...]:
    return tuple(sorted(uses, key=lambda use: -use.use))


def check_formula(motion: SampledDesign) -> None:
    """Refuse a design whose own motion breaks a limit: exact over continuous time, of approach and return too.

    Torques are looked at in 4000 instants; of tool, obstacles and torques on approach and return the certificate of the
    design counts.
    """
    design = motion.design
    source = MotionSource(design.robot, design.task, design.trajectory, None, None, {"friction_plan": None})
    transfers = [piece.motion for piece in motion.sequence.pieces if isinstance(piece.motion, Transfer)]
    limits = linear_limits(motion.robot)
    uses = [use for transfer in transfers for limit in limits for use in limit_uses(limit, transfer.extrema(limit))]
    broken = [*broken_limits(source), *(use for use in uses if use.margin < -_ROUNDING * abs(use.bound))]
    remedy = "design it again within the limits"
    if broken:
        _refuse(broken, remedy)
    if design.broken:
        more = f" and {len(design.broken) - 1} more" if len(design.broken) > 1 else ""
        raise BrokenLimitError(f"the design does not keep its limits: {design.broken[0]}{more}; {remedy}")


def certify(motion: SampledDesign, interpolation: Interpolation, given: int = 2) -> Certificate:
    """Certificate of the limits of joints and drives for what is interpolated, to 1e-6 of their bounds."""
    limits = linear_limits(motion.robot)
    return Certificate(
        tuple(interpolated_limits(limits, motion.samples, curve, given) for curve in interpolation.curves)
    )


def deviation(motion: SampledDesign, interpolation: Interpolation) -> float | None:
    """Largest distance of what is interpolated from the design, in the middle of the steps [rad or m].

    None where it is not known what is interpolated.
    """
    if len(interpolation.curves) > 1:
        return None
    half = 0.5 * np.diff(motion.time)
    exact = motion.sequence.at(motion.time[:-1] + half)[0].q
    pieces = curve_pieces(motion.samples, interpolation.curves[0])
    powers = half[:, None] ** np.arange(len(pieces) - 1.0, -1.0, -1.0)[:, None, None]
    return float(np.abs((pieces * powers).sum(axis=0) - exact).max())


def check_interpolated(certificate: Certificate, interpolation: Interpolation) -> None:
    """Raise `BrokenLimitError` where what is interpolated breaks a limit."""
    if certificate.broken:
        worst = certificate.broken[0]
        much = f"by {100 * (worst.use - 1.0):.2g} %, of {interpolation.value}"
        remedy = f"raise `rate`, or design it again with a lower `{worst.quantity}`"
        _refuse(certificate.broken, f"that is {much}; {remedy}")


def _refuse(broken: Sequence[LimitUse], remedy: str) -> None:
    worst, more = broken[0], len(broken) - 1
    others = f"; {more} more limits are broken" if more else ""
    raise BrokenLimitError(
        f"the motion breaks a limit: {worst.label} is {worst.extreme:.6g} {worst.unit} at {worst.time:.3f} s, beyond "
        f"{worst.bound:.6g} {worst.unit}{others}; {remedy}"
    )
