"""Plausibility checks of the torques of a log, and of its channels in general."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from excite.logs.case import Case, Finding
from excite.logs.saturation import plateaus

_TIMES_TORQUE = 3.0


def constant_channels(case: Case) -> Iterator[Finding]:
    """Check that no channel is constant while its joint moves."""
    for name, channel in (("velocity", case.log.dq), ("effort", case.log.effort)):
        if channel is None:
            continue
        for k in np.flatnonzero((np.ptp(channel, axis=0) == 0) & case.moved):
            yield Finding(True, f"{case.log.joints[k]}.{name} is constant at {channel[0, k]:.4g} while the joint moves")


def torques(case: Case) -> Iterator[Finding]:
    """Check torques against the limits of the robot."""
    if case.log.effort is None:
        return
    largest = np.abs(case.log.effort).max(axis=0)
    for k in np.flatnonzero(largest > case.limits.torque):
        unit = "Nm" if case.revolute[k] else "N"
        far = bool(largest[k] > _TIMES_TORQUE * case.limits.torque[k])
        text = (
            f"{case.log.joints[k]}.effort reaches {largest[k]:.4g} {unit}, but its limit is {case.limits.torque[k]:.4g}"
        )
        yield Finding(far, f"{text}; check its unit, gain and ratio" if far else text)


def saturated_torques(case: Case) -> Iterator[Finding]:
    """Find torques that stay at their extreme value after a sudden change."""
    if case.log.effort is None:
        return
    for k in np.flatnonzero(np.ptp(case.log.effort, axis=0) > 0):
        tau = case.log.effort[:, k]
        for extreme in (tau.min(), tau.max()):
            count = sum(b - a for a, b in plateaus(tau, extreme, case.moving))
            if count:
                yield Finding(
                    False,
                    f"{case.log.joints[k]}.effort is held at {extreme:.4g} in {count} rows, so it may be saturated",
                )
