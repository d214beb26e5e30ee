"""The exciting stretch of a log, which joints move, and the noise of a signal."""

from __future__ import annotations

import math
from typing import TypeAlias
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from excite.logs.log import Log
from regressors.errors import InputError
from regressors.samples import Array, Index

PAUSE = 0.5
REST = 0.1
_SHARE = 0.2
_FEWEST = 10


def exciting_rows(log: Log) -> tuple[slice, str]:
    """Select the rows of a log with the exciting motion, and summarise the choice.

    Stretches of motion are separated by pauses of half a second or more. The rows are those from the first to the last
    stretch that lasts at least a fifth of the longest and is not a point-to-point motion, in which no joint reverses;
    where all stretches are point-to-point motions, only their length counts. 0.1 s of rest is kept at both ends.
    """
    stretches, reversing = _stretches(log) if log.count >= _FEWEST else ([], [])
    if not stretches:
        raise InputError(f"{log.source}: no joint moves in its {log.count} rows ({log.duration:.3g} s)")
    candidates = reversing or stretches
    longest = max(_seconds(log, *s) for s in candidates)
    chosen = [s for s in candidates if _seconds(log, *s) >= _SHARE * longest]
    start, stop = _with_rest(log, stretches, chosen[0][0], chosen[-1][1])
    return slice(start, stop), _summary(log, stretches, start, stop)


_Rows: TypeAlias = tuple[int, int]  # the first, and the one after the last


def _with_rest(log: Log, stretches: list[_Rows], start: int, stop: int) -> _Rows:
    """Add a short rest at both ends, where motion is too slow to be detected, but no other motion."""
    first = max([end for _, end in stretches if end <= start], default=0)
    last = min([begin for begin, _ in stretches if begin >= stop], default=log.count)
    early = int(np.searchsorted(log.time, log.time[start] - REST))
    late = int(np.searchsorted(log.time, log.time[stop - 1] + REST, side="right"))
    return max(first, early), min(last, late)


def _stretches(log: Log) -> tuple[list[_Rows], list[_Rows]]:
    """Rows in which some joint moves, and those of them in which one reverses."""
    moving = moves(log)
    speed = np.where(moving, mean_speed(log), 0.0)
    joined: list[_Rows] = []
    for start, stop in runs(np.any(moving, axis=1)):
        if joined and log.time[start] - log.time[joined[-1][1] - 1] < PAUSE:
            start = joined.pop()[0]
        joined.append((start, stop))
    return joined, [(a, b) for a, b in joined if np.any((speed[a:b] > 0).any(axis=0) & (speed[a:b] < 0).any(axis=0))]


def _seconds(log: Log, start: int, stop: int) -> float:
    return float(log.time[stop - 1] - log.time[start])


def _summary(log: Log, stretches: list[_Rows], start: int, stop: int) -> str:
    first, last, end = (log.row_numbers[k] for k in (start, stop - 1, -1))
    text = f"rows {first} to {last} of {end} are used ({_seconds(log, start, stop):.3g} s)"
    for where, a, b in (("before", 0, start), ("after", stop, log.count)):
        if a < b:
            lengths = [f"{_seconds(log, *s):.2g} s" for s in stretches if a <= s[0] and s[1] <= b]
            kind = "no motion" if not lengths else f"motion of {', '.join(lengths)}"
            text += f"; left out {where} them: {b - a} rows ({_seconds(log, a, b):.3g} s) with {kind}"
    return text


SPAN = 0.1
_LEAST_SHARE = 0.005
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
    if log in _KNOWN:
        return _KNOWN[log]
    speed = np.abs(mean_speed(log))
    noise = np.maximum(_NOISE * np.sqrt(2) * quietest_deviation(log.q, _BLOCK), 2 * quantum(log.q)) / SPAN
    least = np.maximum(_LEAST_SHARE * speed.max(axis=0), noise)
    _KNOWN[log] = moving = np.asarray(speed > np.maximum(least, _SLOWEST))
    moving.flags.writeable = False
    return moving


def runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First row of each run of true flags, and the row after its last."""  # flags (N,)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


_ORDERS = range(2, 9)


def noise_deviation(x: Array) -> Array:
    """Standard deviation of white noise on smooth signals.

    White noise of deviation s has k-th differences of deviation ``s sqrt((2 k)! / (k!)^2)``, and motion only adds to
    them: the least estimate over k = 2 ... 8 is taken, no less than that of rounding, ``quantum / sqrt(12)``.
    """  # x (N, n)
    orders = [k for k in _ORDERS if k < x.shape[0]]
    estimates = [np.sqrt(np.mean(np.diff(x, k, axis=0) ** 2, axis=0) / math.comb(2 * k, k)) for k in orders]
    return np.asarray(np.maximum(np.min(estimates, axis=0), quantum(x) / np.sqrt(12)))


def quietest_deviation(x: Array, block: int) -> Array:
    """Standard deviation of noise in the quietest tenth of the blocks of a signal."""  # x (N, n)
    squares = np.diff(x, 2, axis=0) ** 2 / math.comb(4, 2)
    count = squares.shape[0] // block
    if count == 0:
        return np.zeros(x.shape[1])
    blocks = squares[: count * block].reshape(count, block, -1).mean(axis=1)
    return np.asarray(np.sqrt(np.quantile(blocks, 0.1, axis=0)))


def quantum(x: Array) -> Array:
    """Least difference of two different values, shape (n,); zero where all are equal."""  # x (N, n)
    steps = (np.diff(np.unique(column)) for column in x.T)
    return np.array([step.min() if step.size else 0.0 for step in steps])
