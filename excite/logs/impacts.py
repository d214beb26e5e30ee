"""Sudden changes: impacts, resets of an encoder, single wrong readings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TypeAlias

import numpy as np
import scipy
from numpy.typing import NDArray

from excite.logs.event import IMPACT, SPIKE, Event
from excite.logs.excitation import quantum, runs
from excite.logs.log import Log
from regressors.errors import InputError
from regressors.robot.robot import Robot
from regressors.samples import Array

_HALF = 0.03  # [s] on either side of a fit
_FEWEST = 6  # samples on either side
_BLOCKS = 4  # half-widths per block
_QUANTILE = 0.9  # of the blocks: the motion's own corners and reversals
_TIMES = 3.0
_ALONE = 2.0  # times the least jump: one that needs no spike
_LEAST_SPEED, _LEAST_OWN = 0.03, 0.15  # of the fastest joint's speed, of the joint's own
_LEAST_TORQUE = 0.06  # of the range of the joint's torque
_REST, _SLOW = 0.25, 0.4  # of a joint's speed: one that comes to rest or starts, slowly, does so by friction
_FAST = 0.99  # quantile of the speeds that is a joint's own
_TINY = float(np.finfo(np.float32).tiny)
_SETTLING = 0.1  # [s] in which the controller answers an impact
_ENDS = 0.2  # [s] that are cut by the filters anyway


def impacts(log: Log) -> list[tuple[float, int, float]]:
    """Impacts in a log: when [s], the joint whose velocity jumped most, and its jump [rad/s or m/s].

    About each instant, ``q(t) = polynomial of degree 3 + a (t)_+^2 + v t_+`` is fitted over 30 ms, or six samples, on
    either side; v is the jump of the velocity. A spike of the torque is what its running median leaves. Both have to be
    three times what nine of ten blocks of the motion reach and a fair share of the motion's speed and torque; a jump
    twice as large needs no spike, since a blow from outside reaches the motors only through their controller. A joint
    that comes to rest or starts slowly is taken to do so by friction.
    """
    h = float(log.time[1] - log.time[0])
    half = max(_FEWEST, round(_HALF / h))
    if log.effort is None or log.count < 10 * _BLOCKS * half:
        return []
    sharp = _sharpness(log.q, half, h)
    largest = sharp.max(axis=1)
    if largest.max() < 1.0:
        return []
    width = 2 * half + 1
    spike = np.abs(log.effort - scipy.ndimage.median_filter(log.effort, size=(width, 1)))
    span = np.ptp(np.quantile(log.effort, [0.01, 0.99], axis=0), axis=0) + np.finfo(float).tiny
    strong = spike / np.maximum(_TIMES * _usual(spike, half), _LEAST_TORQUE * span)
    felt = scipy.ndimage.maximum_filter1d(strong.max(axis=1), width)
    found = (largest >= 1.0) & ((felt >= 1.0) | (largest >= _ALONE))
    jump = velocity_jumps(log.q, half) / h
    hits = []
    for a, b in runs(scipy.ndimage.binary_closing(found, np.ones(width))):
        row, joint = divmod(int(np.argmax(np.abs(jump[a:b]) * (sharp[a:b] >= 1.0))), sharp.shape[1])
        hits.append((float(log.time[a + row]), joint, float(jump[a + row, joint])))
    return hits


def velocity_jumps(q: Array, half: int) -> Array:
    """Jump of the slope about each sample, per sample time, shape (N, n); zero at the ends."""  # q (N, n)
    i = np.arange(-half, half + 1) / half
    after = i > 0
    basis = np.column_stack([np.ones_like(i), i, i**2, i**3, after * i**2, after * i])
    kernel = np.linalg.pinv(basis)[-1] / half
    jump = scipy.signal.oaconvolve(q, kernel[::-1, None], mode="same", axes=0)
    jump[:half] = jump[-half:] = 0.0
    return np.asarray(jump)


def _sharpness(q: Array, half: int, h: float) -> NDArray[np.float32]:
    """Jumps per least jump that is judged to be an impact, shape (N, n); joint by joint, which takes less memory."""
    sharp: NDArray[np.float32] = np.empty(q.shape, dtype=np.float32)
    fastest = max(float(np.quantile(_speed(column, half, h), _FAST)) for column in q.T)
    ends = max(half, round(_ENDS / h))
    for k, column in enumerate(q.T):
        speed = _speed(column, half, h)
        own = float(np.quantile(speed, _FAST))
        before, after = np.roll(speed, half), np.roll(speed, -half)
        friction = (np.minimum(before, after) < _REST * own) & (np.maximum(before, after) < _SLOW * own)
        jump = np.abs(velocity_jumps(column[:, None], half)) / h
        least = max(_TIMES * float(_usual(jump, half)[0]), _LEAST_SPEED * fastest, _LEAST_OWN * own, _TINY)
        sharp[:, k] = np.where(friction, 0.0, jump[:, 0] / least)
    sharp[:ends] = sharp[-ends:] = 0.0
    return sharp


def _speed(q: Array, half: int, h: float) -> Array:
    return np.asarray(np.abs(scipy.ndimage.uniform_filter1d(np.gradient(q, h), half)))


def _usual(x: Array, half: int) -> Array:
    """What the maxima of most blocks do not exceed, shape (n,)."""
    block = _BLOCKS * half
    count = x.shape[0] // block
    return np.asarray(np.quantile(x[: count * block].reshape(count, block, -1).max(axis=1), _QUANTILE, axis=0))


def impact_events(log: Log, recorded: Log, units: Sequence[str]) -> tuple[Event, ...]:
    """Impacts as events, from just before them until the controller has answered."""
    events = []
    for time, joint, jump in impacts(log):
        begin, end = time - _HALF, time + _SETTLING
        inside = np.searchsorted(recorded.time, [begin, end])
        rows = recorded.row_numbers[np.minimum(inside, recorded.count - 1)]
        text = f"the velocity of joint {log.joints[joint]} jumped by {jump:.2g} {units[joint]}/s at t = {time:.6g} s"
        events.append(Event(IMPACT, begin, end, (int(rows[0]), int(rows[1])), text))
    return tuple(events)


_TIMES_SPEED = 1.5
_TIMES_OWN = 3.0  # the speed of the motion, where the joint has no limit
_NOISE = 12.0
_AROUND = 10  # rows whose median step is the speed about a jump
_BACK = 5  # rows after which a wrong reading is over
_BESIDE = 0.2  # of a jump
_RARE = 0.01  # of the rows: what jumps more often is no jump, but of another unit
_ALIKE = 0.2  # of a jump, by which the jump back may differ


# Of a joint's position that is another from a row on: this row, 0 for the first of the log, and how much it jumps
# beyond the joint's motion [rad or m]
_Jump: TypeAlias = tuple[int, float]


def without_spikes(log: Log, robot: Robot) -> Log:
    """Leave out rows in which a position jumps away and back.

    A position jumps where it changes from one row to the next by 1.5 times more than its velocity limit allows, and by
    12 times its noise. Of a joint without a limit, three times the speed of its motion stands for it.
    """
    lost = np.zeros(log.count, dtype=bool)
    for _, jumps in _all_jumps(log, robot):
        for (row, _), back in _pairs(jumps):
            if back is not None:
                lost[row:back] = True
    return log.without(SPIKE, lost) if lost.any() else log


def check_resets(log: Log, robot: Robot) -> None:
    """Refuse a log whose positions jump and do not come back."""
    for name, jumps in _all_jumps(log, robot):
        for (row, size), back in _pairs(jumps):
            if back is None:
                number, first, last = (int(log.row_numbers[k]) for k in (row, 0, -1))
                unit = robot.joints[robot.joint_index(name)].unit
                raise InputError(
                    f"{log.source}: the position of joint {name} jumps by {size:.3g} {unit} in row {number}, more than "
                    "it can move: its encoder was reset, rows were lost, or two recordings are joined; use "
                    f"the rows before it (`rows='{first}:{number - 1}'`) or from it on (`rows='{number}:{last}'`), "
                    "whichever positions are right"
                )


def _all_jumps(log: Log, robot: Robot) -> Iterator[tuple[str, list[_Jump]]]:
    """Jumps of each joint that the robot has."""
    if log.count < 4 * _AROUND:
        return
    for k, name in enumerate(log.joints):
        if name in robot.joint_names:
            yield name, _jumps(log.time, log.q[:, k], float(robot.limits.velocity[robot.joint_index(name)]))


def _pairs(jumps: list[_Jump]) -> Iterator[tuple[_Jump, int | None]]:
    """Jumps with the rows of those that undo them, where they are undone soon."""
    while jumps:
        (first, size), *jumps = jumps
        near = [k for k, (row, _) in enumerate(jumps) if row - first <= _BACK]
        back = next((k for k in near if abs(size + jumps[k][1]) <= _ALIKE * abs(size)), None)
        yield (first, size), None if back is None else jumps[back][0]
        jumps = jumps if back is None else jumps[back + 1 :]


def _jumps(time: Array, q: Array, fastest: float) -> list[_Jump]:
    usual = float(np.median(np.diff(time)))
    change = np.diff(q)
    if 2.0 * float(np.abs(change).max()) <= _TIMES_SPEED * fastest * usual < np.inf:
        return []  # no change can be that far from the median of others
    motion = scipy.ndimage.median_filter(change, 2 * _AROUND + 1, mode="nearest")
    beyond = change - motion
    if not np.isfinite(fastest):
        fastest = _TIMES_OWN * float(np.abs(motion).max()) / usual
    second = np.diff(change)
    deviation = float(np.median(np.abs(second - np.median(second)))) / 0.6745  # of noise, whatever single changes are
    noise = max(_NOISE * deviation, 3.0 * float(quantum(q[:, None])[0]))
    most = np.maximum(_TIMES_SPEED * fastest * np.maximum(np.diff(time), usual), noise)
    rows = np.flatnonzero((np.abs(beyond) > most) & ~_accompanied(beyond))
    return [] if rows.size > _RARE * q.size + 2 else [(int(k) + 1, float(beyond[k])) for k in rows]


def _accompanied(beyond: Array) -> NDArray[np.bool_]:
    """Whether a change has others like it beside it, as of a joint that was hit and does move so fast."""
    beside = [np.roll(beyond, k) for k in (-2, -1, 1, 2)]
    return np.asarray(np.any([other * np.sign(beyond) > np.abs(beyond) * _BESIDE for other in beside], axis=0))
