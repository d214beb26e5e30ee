"""Held rows: the recorder wrote the values of the row before again, under a new time stamp, while the robot moved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from excite.logs.event import HELD, RATE, Event
from excite.logs.excitation import mean_speed, moves, quantum, runs
from excite.logs.log import Log
from regressors.samples import Array, Index

_STEPS = 4.0  # of the encoder that a joint should have moved between two equal rows
_SLOW = 0.05  # share of the steps that are taken for the smallest a joint makes
_CHANGING = 0.02  # a torque that is equal in two successive rows more often is too coarse to tell
_LEAST = 20  # held rows, or as many fresh ones, that show a rate
_STILL, _BEFORE, _JUMP = 3, 20, 2.0  # rows of a standstill, rows before it, times their steps
_EVEN = 1.5  # rows by which fresh ones may be off a straight line
_MOSTLY = 0.8


@dataclass(frozen=True, eq=False)
class Fresh:
    """A log without its held rows."""

    log: Log
    # A lower rate than that of the rows, if there is one; what single rows were held is in `Log.removed`
    events: tuple[Event, ...] = ()


def without_held_rows(log: Log) -> Fresh:
    """Leave out the rows that repeat the row before while the robot moves.

    A row is held if all positions, or all torques, are equal to the last bit to those of the row before, although a
    joint has moved by four steps of its encoder since then, or the torques are otherwise never equal. Where fresh rows
    come at even intervals of two rows or more, or at even intervals in all, the values were updated more slowly than
    they were recorded: that is their rate, and no event.
    """
    held = held_rows(log)
    if not held.any():
        return Fresh(log)
    rate = _slower_rate(log, held)
    if rate is None:
        return Fresh(log.without(HELD, held))
    text = f"values were updated at {rate:.4g} Hz, rows recorded at {log.rate:.4g} Hz: {held.sum()} equal rows not used"
    event = Event(RATE, float(log.time[0]), float(log.time[-1]), _ends(log), text, left_out=False)
    return Fresh(log.without(RATE, held), (event,))


def _ends(log: Log) -> tuple[int, int]:
    return int(log.row_numbers[0]), int(log.row_numbers[-1])


def held_rows(log: Log) -> NDArray[np.bool_]:
    """Which rows are held, shape (N,)."""
    moving = np.any(moves(log), axis=1)
    return np.asarray(moving & ~_standstill(log) & (_held_positions(log) | _held_torques(log, moving)))


def _equal(x: Array) -> NDArray[np.bool_]:
    return np.concatenate([[False], np.all(x[1:] == x[:-1], axis=1)])


def _standstill(log: Log) -> NDArray[np.bool_]:
    """Rows in which all joints stand still: equal positions for three rows or more, left without a jump."""
    still = np.zeros(log.count, dtype=bool)
    step = np.abs(np.diff(log.q, axis=0))
    for a, b in runs(_equal(log.q)):
        if b - a >= _STILL and not (b < log.count and np.any(step[b - 1] > _JUMP * _usual_step(step, a))):
            still[a:b] = True
    return still


def _usual_step(step: Array, row: int) -> Array:
    """Median step of each position before a row, shape (n,)."""
    return np.asarray(np.median(step[max(0, row - _BEFORE) : row], axis=0))


def _held_positions(log: Log) -> NDArray[np.bool_]:
    held = _equal(log.q)
    if not held.any():
        return held
    step = float(np.median(np.diff(log.time)))
    return np.asarray(held & np.any(np.abs(mean_speed(log)) * step > _STEPS * _grain(log.q), axis=1))


def _grain(q: Array) -> Array:
    """Smallest step that each position makes, shape (n,); of coupled encoders it is more than that of its values."""
    steps = [np.abs(np.diff(column)) for column in q.T]
    slow = [np.quantile(step[step > 0], _SLOW) if np.any(step > 0) else 0.0 for step in steps]
    return np.maximum(quantum(q), slow)


def _held_torques(log: Log, moving: NDArray[np.bool_]) -> NDArray[np.bool_]:
    torque = log.effort if log.effort is not None else log.wrench
    if torque is None or torque.shape[1] < 2:  # one alone may be at its limit
        return np.zeros(log.count, dtype=bool)
    equal = _equal(torque)
    fresh = moving & ~equal
    if not equal.any() or not fresh[1:].any():
        return np.zeros(log.count, dtype=bool)
    unchanged = (np.diff(torque, axis=0) == 0)[fresh[1:]].mean(axis=0)
    return np.asarray(equal & bool(np.any(unchanged <= _CHANGING)))


def _slower_rate(log: Log, held: NDArray[np.bool_]) -> float | None:
    """Rate of the fresh rows, where they come at even intervals [Hz]."""
    moving = np.flatnonzero(np.any(moves(log), axis=1))
    part = slice(int(moving[0]), int(moving[-1]) + 1)
    fresh = np.flatnonzero(~held[part])
    if np.count_nonzero(held) < _LEAST or fresh.size < _LEAST or not (_straight(fresh) or _grouped(fresh)):
        return None
    return float(log.rate * fresh.size / (part.stop - part.start))


def _straight(fresh: Index) -> bool:
    order = np.arange(fresh.size)
    line = np.polyval(np.polyfit(order, fresh, 1), order)
    return bool(np.abs(fresh - line).max() <= _EVEN)


def _grouped(fresh: Index) -> bool:
    step = np.diff(fresh)
    usual = int(np.median(step))
    return usual >= 2 and bool(np.mean(step == usual) >= _MOSTLY)
