"""Limits between the samples of ``trajectory.csv``, for every curve that a program may lay through them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from constraints.bounds.interpolation import Curve, InterpolatedLimits, curves_text, interpolated_limits
from constraints.linear import linear_limits
from excite.design.designed_motion import DesignedMotion
from regressors.samples import Samples

_FASTER = (2, 5, 10)  # times the rate, that may be enough for quintics
_MOST = 20_000  # samples that are tried for it
_JUMP = 0.01  # of a limit: more is a jump of the jerk between two samples, which no rate takes away


def between_samples(design: DesignedMotion) -> tuple[InterpolatedLimits, ...]:
    """Certificates of lines, cubics and quintics through the samples of ``trajectory.csv``, to 1e-6 of the bounds."""
    return _certified(design, design.sequence.sampled()[0], tuple(Curve))


def between_samples_text(design: DesignedMotion, certified: Sequence[InterpolatedLimits]) -> str:
    """One sentence: by which curves the limits are kept, which are passed by how much, and what helps."""
    return f"trajectory.csv, between its samples: limits {curves_text(certified)}{_remedy(design, certified)}"


def _certified(design: DesignedMotion, samples: Samples, curves: Sequence[Curve]) -> tuple[InterpolatedLimits, ...]:
    limits = linear_limits(design.task.limits.applied(design.robot))
    return tuple(interpolated_limits(limits, samples, curve) for curve in curves)


def _remedy(design: DesignedMotion, certified: Sequence[InterpolatedLimits]) -> str:
    """Quintics, or a rate at which they keep the limits, or an export that has samples where the jerk jumps."""
    passed = {each.curve: each.broken[0].use - 1.0 for each in certified if each.broken}
    if Curve.QUINTICS not in passed:
        return "; interpolate by quintics" if passed else ""
    if passed[Curve.QUINTICS] >= _JUMP:
        return "; its jerk jumps between samples: an export as ros2-yaml has samples there"
    for rate in (times * design.task.output.rate for times in _FASTER):
        time = np.arange(round(design.sequence.duration * rate) + 1) / rate
        if time.size <= _MOST and not _certified(design, design.sequence.at(time)[0], (Curve.QUINTICS,))[0].broken:
            return f"; `rate` {rate:g} keeps quintics within them"
    return ""
