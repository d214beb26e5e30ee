"""Steps of an even clock that passed without a row, where time stamps are too uneven to show which."""

from __future__ import annotations

import numpy as np
import scipy.ndimage

from excite.logs.log import Log
from regressors.samples import Array, Index

_LEVEL = 50  # rows on either side of a shift of the stamps
_SHIFT = 0.5  # of a step, that the stamps are later from a row on
_BESIDE = 5  # rows before and behind the stamps' shift that are tried
_HALF = 6  # rows on either side of a fit
_DEGREE = 3
_BETTER = 1.5  # times smoother with the steps than without
_ROUGHER = 2.0  # times the usual residual, without them


def missed_steps(log: Log, step: float) -> Index:
    """Steps that passed without a row before each row, beyond those that the numbers of the rows leave out, shape (N,).

    Candidates are rows after which the stamps are later for good; a number of steps is believed where the positions
    about a row are smoother with them than without, by cubics.
    """
    numbers = log.row_numbers
    late = (log.time - log.time[0]) / step - (numbers - numbers[0])
    usual = float(np.median([_roughness(log, row, 0) for row in _sampled(log.count)]))
    missed = np.zeros(log.count, dtype=np.intp)
    row = _LEVEL
    shift = _shifts(late)
    while row < log.count - _LEVEL:
        if shift[row] <= _SHIFT:
            row += 1
            continue
        stop = row + 1
        while stop < log.count - _LEVEL and shift[stop] > _SHIFT:
            stop += 1
        where, steps = _best(
            log, range(row - _BESIDE, stop + _BESIDE), max(1, round(float(shift[row:stop].max()))), usual
        )
        missed[where + 1 :] += steps
        row = stop
    return missed


def _sampled(count: int) -> Index:
    return np.linspace(_LEVEL, count - _LEVEL - 1, min(500, count)).astype(np.intp)


def _shifts(late: Array) -> Array:
    """By how many steps the stamps after each row are later than those up to it, shape (N,)."""
    level = scipy.ndimage.median_filter(late, _LEVEL, mode="nearest")
    half = _LEVEL // 2
    shift = np.zeros(late.size)
    shift[half : -half - 1] = level[2 * half + 1 :] - level[: -2 * half - 1]
    return shift


def _best(log: Log, rows: range, most: int, usual: float) -> tuple[int, int]:
    """Row after which steps are missing, and how many; none where the positions do not show it."""
    found, gain = (0, 0), _BETTER
    for row in rows:
        without = _roughness(log, row, 0)
        if without < _ROUGHER * usual:
            continue
        for steps in range(1, most + 2):
            better = without / max(_roughness(log, row, steps), np.finfo(float).tiny)
            if better > gain:
                found, gain = (row, steps), better
    return found


def _roughness(log: Log, row: int, steps: int) -> float:
    """What cubics over row numbers leave of the positions about a row, after which some steps are missing."""
    part = slice(max(0, row + 1 - _HALF), row + 1 + _HALF)
    x = log.row_numbers[part].astype(float) - float(log.row_numbers[row])
    x[x > 0] += steps
    basis = np.linalg.qr((x / np.abs(x).max())[:, None] ** np.arange(_DEGREE + 1))[0]
    q = log.q[part]
    return float(np.linalg.norm(q - basis @ (basis.T @ q)))
