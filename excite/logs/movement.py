"""Which joints of a log move when, judged by their positions."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from excite.logs.log import Log
from excite.logs.noise_level import quantum, quietest_deviation
from regressors.samples import Array, Index

SPAN = 0.1
_SHARE = 0.005
_SLOWEST = 1e-3
_NOISE = 6.0
_BLOCK = 32  # samples
_KNOWN: WeakKeyDictionary[Log, NDArray[np.bool_]] = WeakKeyDictionary()  # several checks of a log ask for it


def span_ends(log: Log) -> tuple[Index, Index]:
    """First and last row of a span of `SPAN` seconds about every row, shorter at the ends; shapes (N,)."""
    half = max(1, round(SPAN / 2 * log.rate))
    row = np.arange(log.count)
    return np.maximum(row - half, 0), np.minimum(row + half, log.count - 1)


def mean_speed(log: Log) -> Array:
    """Mean velocity over the spans, ``(q(b) - q(a)) / (b - a)`` [rad/s or m/s], shape (N, n)."""
    first, last = span_ends(log)
    duration = log.time[last] - log.time[first]
    begin, end = int(np.count_nonzero(first == 0)) - 1, int(np.count_nonzero(last < log.count - 1))
    speed = np.empty(log.q.shape)
    for part in (slice(0, begin), slice(max(begin, end), log.count)):  # shorter spans
        speed[part] = log.q[last[part]] - log.q[first[part]]
    if begin < end:  # the spans between, row by row, without a copy of both of their ends
        np.subtract(log.q[last[begin] : last[end - 1] + 1], log.q[: first[end - 1] + 1], out=speed[begin:end])
    speed /= duration[:, None]
    return speed


def moves(log: Log) -> NDArray[np.bool_]:
    """Whether each joint moves at each instant, shape (N, n).

    It does where its mean speed is above 0.5 % of its greatest, above what noise and rounding of the positions cause at
    rest, and above 1e-3 rad/s or m/s.
    """
    if log not in _KNOWN:
        _KNOWN[log] = _moves(log)
    return _KNOWN[log]


def _moves(log: Log) -> NDArray[np.bool_]:
    speed = np.abs(mean_speed(log))
    noise = np.maximum(_NOISE * np.sqrt(2) * quietest_deviation(log.q, _BLOCK), 2 * quantum(log.q)) / SPAN
    least = np.maximum(_SHARE * speed.max(axis=0), noise)
    moving = np.asarray(speed > np.maximum(least, _SLOWEST))
    moving.flags.writeable = False
    return moving


def runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First row of each run of true flags, and the row after its last."""  # flags (N,)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
