"""Break-away torque of a drive, from a slow ramp of its torque until it moves [KD96] section 5.2."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from excite.friction.points import DriveLog
from excite.friction.rigid import RigidModel
from excite.signals.noise import noise_deviation
from regressors.samples import Array, Samples

_LONGEST, _SHORTEST = 2.0, 0.3  # of the ramp that is looked at before the drive moves [s]
_STRAIGHT = 0.9  # of the torque's variance that a straight line explains
_AVERAGED = 0.02  # of torque, before the drive moves [s]
_FAR = 8.0  # standard deviations of the position that count as motion


@dataclass(frozen=True)
class BreakAway:
    """Where a drive broke loose.

    Parameters
    ----------
    direction : int
        1 or -1.
    torque : float
        Largest friction torque before it moved, with its sign [Nm or N].
    rate : float
        Of the ramp [Nm/s or N/s].
    time : float
        [s]
    log : int
    """

    direction: int
    torque: float
    rate: float
    time: float
    log: int


def break_aways(
    measured: DriveLog, drive: str, least_speed: float, rigid: RigidModel | None, number: int = 0
) -> tuple[BreakAway, ...]:
    """Every slow ramp of torque at rest that ends in motion in its direction.

    A ramp lasts 0.3 s or more at rest, and a straight line explains nine tenths of its torque's variance; where a
    controller just sets off, the torque jumps within less.

    Parameters
    ----------
    measured : DriveLog
    drive : str
    least_speed : float
        Below, the drive rests [rad/s or m/s].
    rigid : RigidModel, optional
        Its torque at rest, gravity, is subtracted.
    number : int
        Of the log.
    """
    log, k = measured.log, measured.names.index(drive)
    assert log.effort is not None
    z, tau = measured.z[:, k], measured.torque(log.effort)[:, k]
    far = max(_FAR * float(noise_deviation(z[:, None])[0]), 1e-9)
    found = []
    for start, moved in _rests(log.time, z, least_speed, far):
        direction = 1 if z[min(moved + 1, z.size - 1)] > z[start : moved + 1].mean() else -1
        begin = max(start, int(np.searchsorted(log.time, log.time[moved] - _LONGEST)))
        time, ramp = log.time[begin:moved], tau[begin:moved]
        if time.size < 8 or time[-1] - time[0] < _SHORTEST:
            continue
        slope = _straight(time, ramp)
        if slope is None or slope * direction <= 0:
            continue
        gravity = 0.0 if rigid is None else _gravity(measured, k, moved, rigid)
        torque = direction * _largest(time, direction * ramp, abs(slope)) - gravity
        found.append(BreakAway(direction, torque, slope, float(log.time[moved]), number))
    return tuple(found)


def _rests(time: Array, z: Array, least_speed: float, far: float) -> list[tuple[int, int]]:
    """Rows from the beginning of each rest to the first one that is away from it, where motion follows."""
    found, start = [], 0
    reference = float(z[0])
    for k in range(z.size):
        if abs(z[k] - reference) <= far:
            continue
        if time[k] - time[start] >= _SHORTEST:
            later = min(int(np.searchsorted(time, time[k] + _SHORTEST)), z.size - 1)
            if abs(z[later] - reference) >= max(2.0 * far, 0.25 * least_speed * _SHORTEST):
                found.append((start, k))
        start, reference = k, float(z[k])
    return found


def _straight(time: Array, tau: Array) -> float | None:
    """Slope of a ramp, None where it is none."""
    t, y = time - time.mean(), tau - tau.mean()
    power = float(y @ y)
    slope = float(t @ y) / float(t @ t)
    explained = slope * float(t @ y) / power if power > 0 else 0.0
    return slope if explained >= _STRAIGHT else None


def _largest(time: Array, ramp: Array, slope: float) -> float:
    """Largest value of a rising ramp: of its mean over a short time, and what it rises in half of that."""
    count = max(1, round(_AVERAGED * (time.size - 1) / float(time[-1] - time[0])))
    mean = np.convolve(ramp, np.ones(count) / count, "valid")
    return float(mean.max()) + slope * 0.5 * (count - 1) * float(time[-1] - time[0]) / (time.size - 1)


def _gravity(measured: DriveLog, k: int, row: int, rigid: RigidModel) -> float:
    log = measured.log
    columns = [log.joints.index(name) for name in rigid.joints]
    q = log.q[row : row + 1, columns]
    still = np.zeros_like(q)
    carried = np.zeros((1, log.q.shape[1]))
    carried[:, columns] = rigid.torque(Samples(log.time[row : row + 1], q, still, still, still))
    return float(measured.torque(carried)[0, k])
