"""Where a log contains the torque ramps of a friction plan, and of which drive.

A plan's ramps rise at rates of their own, ``a(t) = rate (t - start)``, until the drive breaks loose. The torque m(t) of
a drive, less its mean, is compared with their first parts, an eighth to all of each, at every shift d on a grid: the
share ``1 - sum (m(t + d) - a(t))^2 / sum a(t)^2`` is near one for the drive whose ramps they are, where it had not
broken loose by then, and smaller for all others.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.signal

from excite.friction.fit.plan_match import PlannedRuns
from excite.friction.fit.points import DriveLog
from regressors.samples import Array

_GRID = 0.02  # [s]
_PARTS = (1.0, 0.5, 0.25, 0.125)  # of each ramp
_SHARE = 0.8
_NEAR = 0.05  # rad or m, from the pose
_AFTER = 0.2  # [s], largest lag of a robot behind the plan


@dataclass(frozen=True)
class Ramped:
    """Torque ramps of a plan in a log."""

    seconds: float  # when the plan begins, since the log's first sample [s]
    spans: tuple[tuple[float, float], ...]  # begin and end of the ramps, since its first sample [s]
    share: float  # share of the planned torque that the log contains, at most one


def match_ramps(measured: DriveLog, plan: Mapping[str, PlannedRuns]) -> tuple[str, Ramped] | None:
    """The drive whose planned ramps a log contains, and where; None where it contains those of no drive."""
    matches = [
        (name, ramps)
        for name, runs in plan.items()
        if name in measured.names and runs.ramps and _near(measured, runs) and (ramps := _ramps_of(measured, runs))
    ]
    return max(matches, key=lambda each: each[1].share, default=None)


def _near(measured: DriveLog, runs: PlannedRuns) -> bool:
    """Whether the robot rests near the pose."""
    pose = [runs.pose[name] for name in measured.log.joints]
    return bool(np.all(np.abs(np.median(measured.log.q, axis=0) - pose) <= _NEAR))


def _ramps_of(measured: DriveLog, runs: PlannedRuns) -> Ramped | None:
    log = measured.log
    assert log.effort is not None
    since = log.time - log.time[0]
    torque = measured.torque(log.effort)[:, measured.names.index(runs.drive)]
    grid = np.arange(0.0, since[-1] + _GRID, _GRID)
    m = np.interp(grid, since, torque - np.median(torque))
    best = (_SHARE, 0.0)
    for part in _PARTS:
        share, shift = _largest_share(m, runs, part)
        best = max(best, (share, shift))
    share, shift = best
    if share <= _SHARE:
        return None
    return Ramped(shift, tuple((r.start + shift, r.end + shift + _AFTER) for r in runs.ramps), share)


def _largest_share(m: Array, runs: PlannedRuns, part: float) -> tuple[float, float]:
    """Largest share of the first part of each ramp, and the shift at which it is [s]."""
    at = np.arange(0.0, max(ramp.end for ramp in runs.ramps) + _GRID, _GRID)
    asked, within = np.zeros((2, at.size))
    for ramp in runs.ramps:
        rows = (at >= ramp.start) & (at <= ramp.start + part * (ramp.end - ramp.start))
        asked[rows], within[rows] = ramp.rate * (at[rows] - ramp.start), 1.0
    power = float(asked @ asked)
    mean = scipy.signal.correlate(m, within) / within.sum()
    left = scipy.signal.correlate(m**2, within) - within.sum() * mean**2
    share = (2.0 * scipy.signal.correlate(m, asked) - left) / power
    k = int(np.argmax(share))
    return float(share[k]), float((k - (at.size - 1)) * _GRID)
