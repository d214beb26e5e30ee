"""Break-away torques as points of a friction curve at speed zero, and their means."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.stats

from excite.friction.fit.breakaway_torque import BreakAway
from excite.friction.fit.points import Point

_LEVEL = 0.995  # quantile of a two-sided 99 % interval


@dataclass(frozen=True)
class MeanBreakAway:
    """Torque at which a drive breaks loose in one direction."""

    direction: int  # 1 or -1
    torque: float  # mean, with its sign [Nm or N]
    # half its 99 % interval, by Student's t of the repeats, no less than the reading error of each [Nm or N]
    interval99: float
    count: int  # of ramps


def mean_break_aways(breaks: Sequence[BreakAway]) -> tuple[MeanBreakAway, ...]:
    """Mean of each direction that there is, the positive one first."""
    return tuple(_mean(side) for side in _sides(breaks) if side)


def _mean(side: Sequence[BreakAway]) -> MeanBreakAway:
    torque, n = np.array([each.torque for each in side]), len(side)
    own = float(np.sqrt(np.mean([each.deviation**2 for each in side])))  # reading errors of repeats are alike
    half = float(scipy.stats.norm.ppf(_LEVEL)) * own
    if n > 1:
        half = max(half, float(scipy.stats.t.ppf(_LEVEL, n - 1) * torque.std(ddof=1) / np.sqrt(n)))
    return MeanBreakAway(side[0].direction, float(torque.mean()), half, n)


def rest_points(breaks: Sequence[BreakAway], *, paired: bool = False) -> tuple[Point, ...]:
    """Points at speed zero; the sign of the zero is that of the direction.

    The deviation of each is the scatter of the repeats, pooled over both directions and widened as Student's t is than
    the normal distribution; no less than its own, which repeats of one log and direction share, so that their mean is
    no better.
    """
    sides = _sides(breaks)
    freedom = sum(max(len(side) - 1, 0) for side in sides)
    scatter = 0.0
    if freedom:
        power = sum(len(side) * float(np.var([each.torque for each in side])) for side in sides if side)
        wider = float(scipy.stats.t.ppf(_LEVEL, freedom) / scipy.stats.norm.ppf(_LEVEL))
        scatter = wider * float(np.sqrt(power / freedom))
    alike = Counter((each.log, each.direction) for each in breaks)
    points = [[_point(each, alike[each.log, each.direction], scatter) for each in side] for side in sides]
    if not paired:
        return (*points[0], *points[1])
    return tuple(
        replace(
            ahead,
            torque=0.5 * (ahead.torque - behind.torque),
            deviation=0.5 * float(np.hypot(ahead.deviation, behind.deviation)),
        )
        for ahead, behind in zip(*points, strict=False)
    )


def _sides(breaks: Sequence[BreakAway]) -> tuple[list[BreakAway], list[BreakAway]]:
    return [x for x in breaks if x.direction > 0], [x for x in breaks if x.direction < 0]


def _point(break_away: BreakAway, repeats: int, scatter: float) -> Point:
    speed, deviation = (
        float(np.copysign(0.0, break_away.direction)),
        max(float(np.sqrt(repeats)) * break_away.deviation, scatter),
    )
    return Point(
        speed,
        break_away.torque,
        deviation,
        break_away.time,
        0.0,
        break_away.log,
        break_away.temperature,
        break_away.load,
    )
