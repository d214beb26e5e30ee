"""Impacts: a joint's velocity jumps, and a torque has a spike, as in no other part of the motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.ndimage
import scipy.signal
from numpy.typing import NDArray

from excite.logs.event import IMPACT, Event
from excite.logs.log import Log
from excite.logs.movement import runs
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


@dataclass(frozen=True)
class Impact:
    """One impact."""

    time: float  # [s]
    joint: int  # whose velocity jumped most
    jump: float  # of the velocity [rad/s or m/s]
    torque: float  # height of the largest spike [Nm or N]


def impacts(log: Log) -> list[Impact]:
    """Impacts in a log.

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
    strong = spike / np.maximum(_TIMES * _usual(spike, half), _LEAST_TORQUE * _range(log.effort))
    felt = scipy.ndimage.maximum_filter1d(strong.max(axis=1), width)
    found = (largest >= 1.0) & ((felt >= 1.0) | (largest >= _ALONE))
    jump = velocity_jumps(log.q, half) / h
    hits = []
    for a, b in runs(scipy.ndimage.binary_closing(found, np.ones(width))):
        row, joint = divmod(int(np.argmax(np.abs(jump[a:b]) * (sharp[a:b] >= 1.0))), sharp.shape[1])
        near = slice(max(0, a - half), b + half)
        torque = float(spike[near].flat[int(np.argmax(strong[near]))])
        hits.append(Impact(float(log.time[a + row]), joint, float(jump[a + row, joint]), torque))
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
    sharp[:ends] = 0.0
    sharp[-ends:] = 0.0
    return sharp


def _speed(q: Array, half: int, h: float) -> Array:
    return np.asarray(np.abs(scipy.ndimage.uniform_filter1d(np.gradient(q, h), half)))


def _usual(x: Array, half: int) -> Array:
    """What the maxima of most blocks do not exceed, shape (n,)."""
    block = _BLOCKS * half
    count = x.shape[0] // block
    return np.asarray(np.quantile(x[: count * block].reshape(count, block, -1).max(axis=1), _QUANTILE, axis=0))


def _range(x: Array) -> Array:
    return np.asarray(np.ptp(np.quantile(x, [0.01, 0.99], axis=0), axis=0)) + np.finfo(float).tiny


def impact_events(log: Log, recorded: Log, units: Sequence[str]) -> tuple[Event, ...]:
    """Impacts as events, from just before them until the controller has answered."""
    events = []
    for hit in impacts(log):
        begin, end = hit.time - _HALF, hit.time + _SETTLING
        inside = np.searchsorted(recorded.time, [begin, end])
        rows = recorded.row_numbers[np.minimum(inside, recorded.count - 1)]
        unit = units[hit.joint]
        text = (
            f"the velocity of joint {log.joints[hit.joint]} jumped by {hit.jump:.2g} {unit}/s at t = {hit.time:.6g} s"
        )
        events.append(Event(IMPACT, begin, end, (int(rows[0]), int(rows[1])), text))
    return tuple(events)
