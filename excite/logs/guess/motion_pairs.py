"""Positions and velocities among columns without names: a velocity is the rate of change of a position."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regressors.samples import Array

_ALIKE = 0.95  # correlation
_MOST_ROWS = 20_000
_WIDTH = 10  # rows over which a rate of change is taken


@dataclass(frozen=True)
class MotionColumns:
    """Columns of positions, and those of their velocities, 0 for the first."""

    positions: tuple[int, ...]
    velocities: tuple[int, ...]
    seen: int  # of how many joints the motion shows it


def motion_columns(time: Array, values: Array, clock: int) -> MotionColumns | None:
    """Positions and velocities that stand beside each other; None if no column is the rate of change of another."""
    # time (N,); values (N, c)
    some = slice(None, None, max(1, time.size // _MOST_ROWS))
    pairs = _pairs(time[some], values[some], clock)
    if not pairs:
        return None
    apart = [b - a for a, b in pairs]
    offset = max(set(apart), key=apart.count)
    rates = {b for a, b in pairs if b - a == offset}  # of change, whose own is an acceleration
    starts = [a for a, b in pairs if b - a == offset and a not in rates]
    if not starts:
        return None
    first = min(starts)
    if offset == 1:  # q1, dq1, q2, dq2, ...: every second or third column
        stride = min(np.diff(starts), default=2)
        block = tuple(range(first, max(starts) + 1, int(stride)))
    elif max(starts) - first < offset:
        lowest = max(clock + 1 if clock < first else 0, max(starts) - offset + 1)
        begin = lowest if lowest <= first else first
        block = tuple(range(begin, min(begin + offset, values.shape[1] - offset)))
    else:
        block = tuple(sorted(set(starts)))
    return MotionColumns(block, tuple(k + offset for k in block), len(set(starts).intersection(block)))


def _pairs(time: Array, values: Array, clock: int) -> list[tuple[int, int]]:
    """Columns of which the second is the rate of change of the first."""
    area = np.zeros_like(values)
    area[1:] = np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time)[:, None], axis=0)
    moved = _unit(values[_WIDTH:] - values[:-_WIDTH])
    integral = _unit(area[_WIDTH:] - area[:-_WIDTH])
    alike = np.abs(moved.T @ integral)  # (positions, velocities)
    alike[clock] = alike[:, clock] = 0.0
    np.fill_diagonal(alike, 0.0)
    best = [(int(a), int(np.argmax(alike[a]))) for a in range(values.shape[1]) if alike[a].max() > _ALIKE]
    return [(a, b) for a, b in best if int(np.argmax(alike[:, b])) == a]


def _unit(values: Array) -> Array:
    values = values - values.mean(axis=0)
    size = np.linalg.norm(values, axis=0)
    return np.asarray(np.divide(values, size, out=np.zeros_like(values), where=size > 1e-9 * max(1.0, size.max())))
