"""The torque at which a drive breaks away from rest.

Before a drive breaks loose it creeps, by microns: bristles or teeth yield along the path of Dahl's model,
``x = -d ln(1 - tau / Fs)``. So motion is what is large compared with the path before it, and it begins where the speed,
which grows as a power of time with an exponent between one and two, extrapolates to zero. Where the torque is commanded
and continues to rise, the ramp's straight line is evaluated at that instant; where a position controller produces the
ramp, its torque has a maximum there.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from excite.friction.constant_speed_windows import longest_step, position_noise, unbroken
from excite.friction.points import DriveLog, Point, RigidModel, half_difference, rigid_torque, temperature_of
from regressors.samples import Array

_SHORTEST = 0.3  # of rest before, and of motion after, that is evaluated [s]
_LENGTHS = (2.0, 1.4, 1.0, 0.7, 0.5, 0.3)  # of the ramp's end for a line fit; the first straight one is used [s]
_BINS = 12
_STRAIGHT = 0.9  # of the variance of the torque's means that a straight line explains
_CURVED = 4.0  # standard deviations: largest curvature of a straight ramp
_STILL = 0.5  # largest path before, relative to the path after
_CREEP = 10.0  # times as far: motion before such a motion is creep
_FAR = 12.0  # standard deviations of the position noise that count as motion
_SPEED, _LEVELS = 0.8, 2.0  # share of the largest speed after that is at speed; and ratio of the levels below
_SPAN, _SMOOTH = (0.008, 0.1), (0.02, 0.2)  # over which speeds are taken, and the maximum of a torque is averaged [s]
_MISSING = 0.07  # of the ramp's rise from onset to speed: mean deficit of the torque; 1/2 where it stops rising


@dataclass(frozen=True)
class BreakAway:
    """Break-away of a drive."""

    direction: int  # 1 or -1
    torque: float  # friction torque at break-away, with its sign [Nm or N]
    # its standard deviation, from the noise of the torque and the uncertainty of the instant [Nm or N]
    deviation: float
    rate: float  # of the ramp [Nm/s or N/s]
    time: float  # [s]
    log: int
    temperature: float | None = None  # [deg C]
    load: float | None = None  # size of the torque that the drive carries, by the model [Nm or N]


def break_aways(
    measured: DriveLog,
    drive: str,
    gravity: RigidModel | Callable[[Array], Array] | None,
    spans: Sequence[tuple[float, float]] | None = None,
    *,
    controlled: bool | None = None,
    alone: bool = False,
) -> tuple[BreakAway, ...]:
    """Find every slow, straight ramp of torque, 0.3 s or more at rest, that ends in motion in its direction."""
    log, k = measured.log, measured.names.index(drive)
    assert log.effort is not None
    if log.count < 3 or log.duration < 2 * _SHORTEST:
        return ()
    every, tau = measured.z, measured.torque(log.effort)[:, k]
    z, others = every[:, k], np.delete(every, k, axis=1)
    noise = position_noise(log.time, others) if alone else np.zeros(others.shape[1])
    breaks = []
    longest = longest_step(log.time)
    for row in _onsets(log.time, z, spans):
        if not unbroken(log.time[_around(log.time, row)], longest):
            continue
        direction = _direction(log.time, z, row)
        begun = _begun(log.time, direction * z, row)
        rested = _rested(log.time, z, row)
        if alone and not _still(log.time, z, others, noise, row, rested):
            continue
        read = None if begun is None else _read(log.time, direction * tau, row, rested, begun, controlled)
        if read is None:
            continue
        torque, deviation, slope, at = read
        row = min(int(np.searchsorted(log.time, at)), log.count - 1)
        warmth, load, carried = temperature_of(measured, drive, slice(row, row + 1)), None, 0.0
        if isinstance(gravity, RigidModel):
            carried = float(rigid_torque(measured, drive, slice(row, row + 1), gravity, 0.0, 0.0)[0])
            load = abs(carried)
        elif gravity is not None:
            carried = float(gravity(z[row]))
        friction, rate = direction * torque - carried, direction * slope
        breaks.append(BreakAway(direction, friction, deviation, rate, at, measured.number, warmth, load))
    return tuple(breaks)


def _onsets(time: Array, z: Array, spans: Sequence[tuple[float, float]] | None) -> list[int]:
    """Rows at which a drive that hardly moved begins to move: corners of its path, without those that are creep."""
    step = float(np.median(np.diff(time)))
    count = max(2, round(_SHORTEST / step))
    extremes = scipy.ndimage.maximum_filter1d, scipy.ndimage.minimum_filter1d
    highest, lowest = (extreme(z, count, origin=-(count // 2), mode="nearest") for extreme in extremes)  # from each row
    before = np.roll(highest - lowest, count - 1)
    before[: count - 1] = np.inf
    sharp = np.maximum(highest - z, z - lowest) - before / _STILL
    sharp[-count:] = -np.inf
    if spans is not None:
        since = time - time[0]
        sharp[~np.any([(a <= since) & (since <= b) for a, b in spans], axis=0)] = -np.inf
    moving = np.flatnonzero(sharp > _FAR * float(position_noise(time, z[:, None])[0]))
    if moving.size == 0:
        return []
    groups = np.split(moving, np.flatnonzero(np.diff(time[moving]) > _SHORTEST) + 1)
    rows = [int(group[np.argmax(sharp[group])]) for group in groups]
    return [
        row
        for row in rows
        if not any(0 < time[k] - time[row] < _LENGTHS[0] and sharp[k] > _CREEP * sharp[row] for k in rows)
    ]


def _around(time: Array, row: int) -> slice:
    """Least range of rows from which an onset of motion is evaluated."""
    return slice(*(int(np.searchsorted(time, time[row] + sign * _SHORTEST)) for sign in (-1.0, 1.0)))


def _direction(time: Array, z: Array, row: int) -> int:
    later = z[row : int(np.searchsorted(time, time[row] + _SHORTEST))] - z[row]
    return 1 if later.max() > -later.min() else -1


def _begun(time: Array, z: Array, row: int) -> tuple[float, float, float] | None:
    """Onset of the motion, time at which it is at speed, and uncertainty of the onset [s].

    The two differences of the times at which a quarter, half and all of a level are first exceeded determine the power.
    """
    a, b = (int(np.searchsorted(time, time[row] + sign * _SHORTEST)) for sign in (-1.0, 1.0))
    noise = float(position_noise(time, z[:, None])[0])
    step = float(np.median(np.diff(time)))
    wide = _speeds(time, z, a, b, max(_SPAN[1], 2 * step))
    level = _SPEED * float(wide.max())
    if level <= 0:
        return None
    speed = _speeds(time, z, a, b, float(np.clip(40.0 * noise / level, max(_SPAN[0], 4 * step), _SPAN[1])))
    level = _SPEED * float(speed.max())
    last = int(np.argmax(speed >= level))
    times = [_exceeded(time[a:b], speed, level / _LEVELS**part, last) for part in (2, 1, 0)]
    first, second = max(times[1] - times[0], 1e-9), max(times[2] - times[1], 1e-9)
    square = float(np.sqrt(_LEVELS))
    if second < square * first:  # the lowest of the speeds contains creep: take speed as growing with time squared
        begun, doubt = times[1] - second / (square - 1.0), 0.4 * second + 0.2 * (first - second / square)
    else:  # as a power of time with an exponent between one and two
        begun, doubt = times[0] - first / (min(second / first, _LEVELS) - 1.0), 0.4 * first
    return max(begun, float(time[a])), times[2], doubt + step


def _rested(time: Array, z: Array, row: int) -> float:
    """Time since which the drive has hardly moved compared with its motion soon after."""
    later = z[row : int(np.searchsorted(time, time[row] + _SHORTEST))]
    away = np.flatnonzero(np.abs(z[:row] - z[row]) > _STILL * np.abs(later - z[row]).max())
    return float(time[away[-1] + 1]) if away.size else float(time[0])


def _still(time: Array, z: Array, others: Array, noise: Array, row: int, rested: float) -> bool:
    """Whether the others hardly move in a ramp, and at its end move less than this one, which they might drag along."""
    begin = max(rested, float(time[row]) - _LENGTHS[0])
    first, last = (int(np.searchsorted(time, at)) for at in (begin, time[row] + _SHORTEST))
    own = _STILL * float(np.abs(z[row:last] - z[row]).max())
    before, after = (np.ptp(part, axis=0) for part in (others[first : row + 1], others[row:last]))
    return bool(np.all(before <= np.maximum(_FAR * noise, own)) and np.all(after <= np.maximum(_FAR / 2 * noise, own)))


def _speeds(time: Array, z: Array, a: int, b: int, span: float) -> Array:
    """Central differences of the rows a to before b."""
    ahead = np.interp(time[a:b] + 0.5 * span, time, z)
    return np.asarray((ahead - np.interp(time[a:b] - 0.5 * span, time, z)) / span)


def _exceeded(time: Array, speed: Array, level: float, last: int) -> float:
    """Time at which the speed finally exceeds a level, before the row at which it exceeds the largest one."""
    below = np.flatnonzero(speed[: last + 1] < level)
    if below.size == 0 or below[-1] == last:
        return float(time[last])
    k = int(below[-1])
    return float(np.interp(level, speed[k : k + 2], time[k : k + 2]))


def _read(
    time: Array, tau: Array, row: int, rested: float, onset: tuple[float, float, float], controlled: bool | None
) -> tuple[float, float, float, float] | None:
    """Break-away torque, its standard deviation, the ramp's rate, and the time; None without a ramp."""
    begun, reached, doubt = onset
    ramp = _line(time, tau, rested, begun)
    if ramp is None or ramp[2] <= 0:
        return None
    value, deviation, slope = ramp
    a, b = (int(np.searchsorted(time, at)) for at in (begun, time[row] + _SHORTEST))
    noise = 1.4826 * float(np.median(np.abs(np.diff(tau[a:b])))) / np.sqrt(2.0)  # a jump is not noise
    step = float(np.median(np.diff(time)))
    width = float(np.clip((8.0 * noise * np.sqrt(step) / slope) ** (2.0 / 3.0), *_SMOOTH))
    count = max(1, round(width / step))
    means = scipy.ndimage.uniform_filter1d(tau, count)[max(a - count, 0) : b]
    k = int(np.argmax(means))
    peak, top = float(time[max(a - count, 0) + k]), float(means[k])
    if controlled is None:
        until = slice(a, max(int(np.searchsorted(time, reached)), a + 2))
        missing = float(np.mean(value + slope * (time[until] - begun) - tau[until]))
        doubtful = float(np.hypot(deviation, noise / np.sqrt(until.stop - a)))
        controlled = missing > max(_MISSING * slope * float(time[until.stop - 1] - begun), 2.0 * doubtful)
    if not controlled:
        return value, float(np.hypot(deviation, slope * doubt)), slope, begun
    return top, float(np.hypot(noise * np.sqrt(step / width), slope * width / 8.0)), slope, peak


def _line(time: Array, tau: Array, rested: float, end: float) -> tuple[float, float, float] | None:
    """Value at the end of a ramp, its deviation, and the slope, of the longest straight part of its end."""
    last = int(np.searchsorted(time, end, side="right"))
    for length in _LENGTHS:
        first = int(np.searchsorted(time, end - length))
        if end - length < rested or time[first] > end - 0.9 * length or last - first < 3 * _BINS // 2:
            continue
        t, y = (time[first:last] - end) / length, tau[first:last]
        Q, R = np.linalg.qr(np.column_stack([np.ones_like(t), t, t**2]))
        parts = Q.T @ y
        left = y - Q @ parts
        sigma = float(np.sqrt(left @ left / max(t.size - 3, 1)))
        if abs(parts[2]) > _CURVED * sigma and length > _LENGTHS[-1]:
            continue
        at_end, slope = np.linalg.solve(R[:2, :2], parts[:2])
        if length == _LENGTHS[0] or slope * length > 0:
            means, times = (np.array([part.mean() for part in np.array_split(x, _BINS)]) for x in (y, t))
            explained = np.corrcoef(means, times)[0, 1] ** 2 if np.ptp(means) > 0 else 0.0
            deviation = float(np.linalg.norm(np.linalg.solve(R[:2, :2].T, [1.0, 0.0]))) * sigma
            if explained >= _STRAIGHT:
                return float(at_end), deviation, float(slope) / length
    return None


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
    half = float(scipy.special.ndtri(_LEVEL)) * own
    if n > 1:
        half = max(half, float(scipy.special.stdtrit(n - 1, _LEVEL) * torque.std(ddof=1) / np.sqrt(n)))
    return MeanBreakAway(side[0].direction, float(torque.mean()), half, n)


def rest_points(breaks: Sequence[BreakAway], *, paired: bool = False) -> tuple[Point, ...]:
    """Points at speed zero; the sign of the zero is that of the direction.

    The deviation of each is the scatter of the repeats, pooled over both directions and widened as Student's t is than
    the normal distribution; no less than its own, which repeats of one log and direction share, and their mean has too.
    """
    sides = _sides(breaks)
    freedom = sum(max(len(side) - 1, 0) for side in sides)
    scatter = 0.0
    if freedom:
        power = sum(len(side) * float(np.var([each.torque for each in side])) for side in sides if side)
        wider = float(scipy.special.stdtrit(freedom, _LEVEL) / scipy.special.ndtri(_LEVEL))
        scatter = wider * float(np.sqrt(power / freedom))
    alike = Counter((each.log, each.direction) for each in breaks)
    points = [[_point(each, alike[each.log, each.direction], scatter) for each in side] for side in sides]
    if not paired:
        return (*points[0], *points[1])
    return tuple(half_difference(*both) for both in zip(*points, strict=False))


def _sides(breaks: Sequence[BreakAway]) -> tuple[list[BreakAway], list[BreakAway]]:
    return [x for x in breaks if x.direction > 0], [x for x in breaks if x.direction < 0]


def _point(break_away: BreakAway, repeats: int, scatter: float) -> Point:
    b, rest = break_away, float(np.copysign(0.0, break_away.direction))
    deviation = max(float(np.sqrt(repeats)) * b.deviation, scatter)
    return Point(rest, b.torque, deviation, b.time, 0.0, b.log, b.temperature, b.load)
