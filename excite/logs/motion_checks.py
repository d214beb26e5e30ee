"""Plausibility checks of the positions and velocities of a log against the robot."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from excite.logs.case import Case, Finding
from excite.logs.excitation import span_ends
from excite.logs.gaps import LONGEST, gaps

DEGREES = 180 / np.pi
_SLOWEST_RATE = 5.0  # [Hz]
_AGREE = 0.1
_ALIKE = 0.8  # correlation
_FAR = 0.1  # of the range of a joint
_MOST_TURNS = 20 * np.pi
_TIMES_SPEED = 3.0
_HINT = "give a mapping with unit: deg, which converts it"


def rates(case: Case) -> Iterator[Finding]:
    """Check the sample rate."""
    if case.log.rate < _SLOWEST_RATE:
        yield Finding(
            True,
            f"{case.log.rate:.3g} samples per second; check that time is in seconds, or "
            "give its unit in a mapping (unit: ms)",
        )


def missing_instants(case: Case) -> Iterator[Finding]:
    """Check for gaps that are too long to be bridged."""
    if intervals := [gap for gap in gaps(case.log) if gap.length > LONGEST]:
        more = f" and {len(intervals) - 3} more" if len(intervals) > 3 else ""
        where = f"gaps of {', '.join(map(str, intervals[:3]))}{more}"
        yield Finding(True, f"{where}; split the log at its gaps, or use the rows between them (`rows`)")


def positions(case: Case) -> Iterator[Finding]:
    """Check positions against the limits; suggest a correction where they exceed them."""
    low, high = case.log.q.min(axis=0), case.log.q.max(axis=0)
    lower, upper = case.limits.lower, case.limits.upper
    over = np.maximum(lower - low, high - upper)
    far = over > _FAR * np.where(np.isfinite(upper - lower), upper - lower, np.inf)
    within = (low / DEGREES > lower) & (high / DEGREES < upper)
    if np.any(far & case.revolute) and np.all(within[case.revolute]):
        worst = int(np.argmax(np.where(case.revolute & far, np.maximum(-low, high), 0.0)))
        yield Finding(
            True,
            f"{case.log.joints[worst]}.position from {low[worst]:.4g} to {high[worst]:.4g} rad looks like degrees "
            f"(limits {lower[worst]:.4g} to {upper[worst]:.4g} rad); {_HINT}",
        )
        return
    for k in np.flatnonzero(np.isinf(upper - lower) & case.revolute & (np.maximum(-low, high) > _MOST_TURNS)):
        turns = f"{case.log.joints[k]}.position reaches {max(-low[k], high[k]):.4g} rad, many turns"
        yield Finding(False, f"{turns}; if these are degrees: {_HINT}")
    for k in np.flatnonzero(over > 0):
        unit = "rad" if case.revolute[k] else "m"
        limits = f"limits {lower[k]:.4g} to {upper[k]:.4g} {unit} of {case.robot.name}"
        what = f"{case.log.joints[k]}.position from {low[k]:.4g} to {high[k]:.4g} {unit}"
        if far[k]:
            yield Finding(True, f"{what} is far beyond the {limits}; check robot, unit and zero")
        else:
            yield Finding(False, f"{what} slightly exceeds the {limits}")


def speeds(case: Case) -> Iterator[Finding]:
    """Check the slope of the positions against the velocity limits."""
    fastest = np.abs(case.speed).max(axis=0)
    for k in np.flatnonzero(fastest > _TIMES_SPEED * case.limits.velocity):
        unit = "rad/s" if case.revolute[k] else "m/s"
        yield Finding(
            True,
            f"{case.log.joints[k]} moves at up to {fastest[k]:.4g} {unit} by its positions, but its limit is "
            f"{case.limits.velocity[k]:.4g} {unit}; check the units of position (degrees?) and of time",
        )


def velocities(case: Case) -> Iterator[Finding]:
    """Check velocities against the slope of the positions: ``q(b) - q(a) = int_a^b dq dt`` over short spans."""
    if case.log.dq is None:
        return
    first, last = span_ends(case.log)
    step = np.diff(case.log.time)[:, None]
    path = np.vstack([np.zeros(case.log.dq.shape[1]), np.cumsum((case.log.dq[1:] + case.log.dq[:-1]) / 2 * step, 0)])
    mean = (path[last] - path[first]) / (case.log.time[last] - case.log.time[first])[:, None]
    for k in np.flatnonzero(case.moved):
        slope, velocity = case.speed[:, k], mean[:, k]
        ratio = float(slope @ velocity / (slope @ slope))
        alike = abs(ratio) * np.linalg.norm(slope) / max(float(np.linalg.norm(velocity)), np.finfo(float).tiny)
        if alike < _ALIKE:
            text = "does not follow the position: its column may belong to another joint, or be empty"
            yield Finding(True, f"{case.log.joints[k]}.velocity {text}")
        elif abs(ratio - 1) > _AGREE:
            yield Finding(True, f"{case.log.joints[k]}.velocity {_relation(ratio)}")


def _relation(ratio: float) -> str:
    cases = {
        DEGREES: f"is {ratio:.3g} times the slope of the position: it looks like degrees per second; "
        "give a mapping with unit: deg/s, which converts it",
        1 / DEGREES: f"is {ratio:.3g} times the slope of the position: the position looks like degrees; {_HINT}",
        -1.0: "has the opposite sign of the slope of the position; give a mapping with sign: -1 for one of them",
    }
    for value, text in cases.items():
        if abs(ratio - value) <= _AGREE * abs(value):
            return text
    return f"is {ratio:.3g} times the slope of the position; correct columns, ratio or unit in a mapping"


def resting_joints(case: Case) -> Iterator[Finding]:
    """Check that the joints that should move do so."""
    resting = [name for name, moved in zip(case.log.joints, case.moved, strict=True) if not moved]
    if len(resting) == len(case.log.joints) and case.should_move != ():
        yield Finding(True, "no joint moves")
    elif wrong := [name for name in resting if name in (case.should_move or ())]:
        yield Finding(True, f"{', '.join(wrong)} should move, but the position does not change")
    elif resting:
        yield Finding(False, f"{', '.join(resting)}: not moved")
