"""When the torque of a joint or of a drive was at its limit while a log was recorded."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from excite.logs.excitation import moves, quantum, runs
from excite.logs.log import Log
from regressors.robot.robot import Robot
from regressors.samples import Array

Spans = tuple[tuple[float, float], ...]  # first and last instant of each [s]
_HELD = 5  # samples at an extreme
_AT_LIMIT = 0.999  # of the limit: rounding, and the tolerance of a drive's own limiter


@dataclass(frozen=True)
class Saturation:
    """One limited torque, and when it was at its limit.

    Parameters
    ----------
    label : str
        Such as ``joint q2`` or ``drive z2``.
    limit : float
        [unit]
    unit : str
    rows : int
        Number of samples at the limit.
    spans : tuple of (float, float)
        First and last instant of each stretch of them [s].
    """

    label: str
    limit: float
    unit: str
    rows: int
    spans: Spans = field(repr=False)


def saturation_of(label: str, limit: float, unit: str, time: Array, at_limit: NDArray[np.bool_]) -> Saturation:
    """Saturation at flagged instants."""  # time (N,); at_limit (N,)
    spans = tuple((float(time[a]), float(time[b - 1])) for a, b in runs(at_limit))
    return Saturation(label, float(limit), unit, int(np.count_nonzero(at_limit)), spans)


def within(time: Array, spans: Spans, begin: Array | None = None) -> NDArray[np.bool_]:
    """Which instants lie in one of the spans, or which time windows meet one."""  # time (N,); begin (N,)
    if not spans:
        return np.zeros(time.size, dtype=bool)
    first, last = np.array(joined_spans(spans)).T
    begun = np.searchsorted(first, time, side="right")  # spans that have begun by then
    start = time if begin is None else begin
    return np.asarray((begun > 0) & (start <= last[np.maximum(begun - 1, 0)]))


def measured_saturation(log: Log, robot: Robot) -> tuple[Saturation, ...]:
    """Torques of a log that are held at the limits of their joints.

    A torque counts where it keeps its extreme value for five samples or more while the robot moves, has come there at
    speed, and that value is 0.999 of the joint's limit or more. Extremes below are never taken for the limit, whatever
    they look like, and with noise on the torque no value is kept.
    """
    if log.effort is None:
        return ()
    saturated = []
    moving = np.any(moves(log), axis=1)
    for k, name in enumerate(log.joints):
        j = robot.joint_index(name)
        limit, tau = float(robot.limits.torque[j]), log.effort[:, k]
        at_limit = np.zeros(tau.size, dtype=bool)
        for extreme in (tau.min(), tau.max()):
            if abs(extreme) >= _AT_LIMIT * limit:
                for a, b in plateaus(tau, extreme, moving):
                    at_limit[a:b] = True
        if at_limit.any():
            unit = "Nm" if robot.joints[j].kind == "revolute" else "N"
            saturated.append(saturation_of(f"joint {name}", limit, unit, log.time, at_limit))
    return tuple(saturated)


def plateaus(tau: Array, extreme: float, moving: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """First row, and row after, of each stretch in which a torque keeps an extreme that it reached at speed."""
    # tau (N,); moving (N,)
    least = 4 * float(quantum(tau[:, None])[0])
    for a, b in runs((tau == extreme) & moving):
        if b - a >= _HELD and _sudden(tau, a, b, least):
            yield a, b


def _sudden(tau: Array, start: int, stop: int, least: float) -> bool:
    """Whether the signal was away from the plateau by more than rounding two samples before or after it."""
    beside = [tau[k] for k in (start - 2, stop + 1) if 0 <= k < tau.size]
    return any(abs(value - tau[start]) > least for value in beside)


def spans_of(saturated: Sequence[Saturation]) -> Spans:
    """Spans of several torques together, joined where they overlap."""
    return joined_spans(span for one in saturated for span in one.spans)


def joined_spans(spans: Iterable[tuple[float, float]]) -> Spans:
    """Spans in the order of time, joined where they overlap."""
    joined: list[tuple[float, float]] = []
    for first, last in sorted(spans):
        if joined and first <= joined[-1][1]:
            joined[-1] = joined[-1][0], max(last, joined[-1][1])
        else:
            joined.append((first, last))
    return tuple(joined)
