"""Instants that were not recorded: gaps, lost rows, and missing steps of an uneven clock."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy.ndimage

from excite.logs.event import DROPPED, GARBAGE, HELD, IMPACT, MISSING, RATE, SPIKE, Event
from excite.logs.log import Log
from regressors.errors import InputError
from regressors.samples import Array, Index

STEPS = 3.5  # three samples missing or more
LEAST = 0.02  # [s]; less is bridged well by interpolation
SHORTEST = 1.0
LONGEST = 1.0  # [s]; what is left out of a motion, but does not end it


@dataclass(frozen=True)
class Gap:
    """A time step that is too long."""

    row: int  # row after which it is, 0 for the first
    number: int  # its number in what was recorded
    time: float  # where it begins, and how long it is [s]
    length: float

    def __str__(self) -> str:
        return f"{self.length:.3g} s after t = {self.time:.6g} s (row {self.number})"


def gaps(log: Log) -> tuple[Gap, ...]:
    """Time steps longer than 3.5 times the median one and than 20 ms."""
    step = np.diff(log.time)
    if not step.size:
        return ()
    long = np.flatnonzero((step > STEPS * np.median(step)) & (step > LEAST))
    return tuple(Gap(int(k), int(log.row_numbers[k]), float(log.time[k]), float(step[k])) for k in long)


def segments(log: Log, shortest: float = SHORTEST) -> tuple[Log, ...]:
    """Parts of a log between its gaps."""
    if not (intervals := gaps(log)):
        return (log,)
    ends = [0, *(gap.row + 1 for gap in intervals), log.count]
    parts = [log.rows(slice(a, b)) for a, b in pairwise(ends)]
    kept = [part for part in parts if part.count > 1 and part.duration >= shortest]
    if not kept:
        raise InputError(
            f"{log.source}: gaps leave no part of {shortest:g} s or more: {'; '.join(map(str, intervals))}"
        )
    lost = log.count - sum(part.count for part in kept)
    left_out = (
        (*log.left_out, f"{lost} rows in parts shorter than {shortest:g} s between gaps") if lost else log.left_out
    )
    return tuple(replace(part, left_out=left_out) for part in kept)


_TEXT = {
    MISSING: "{ms} without a row",
    GARBAGE: "lines that hold no row of numbers",
    DROPPED: "rows dropped as asked",
    HELD: "rows that repeat the row before",
    SPIKE: "a wrong reading of a position",
    IMPACT: "rows about an impact",
}
_TWO = 1.75  # steps: a row is missing
_EVEN, _MOSTLY = 0.25, 0.9  # most steps are within a quarter of the median one, if time is regular
_INSIDE = 0.01  # of a step: an instant so near a row is measured


def missing_rows(log: Log) -> tuple[Event, ...]:
    """Where rows are missing: numbers of rows that jump, and time steps of 1.75 times the median one or more.

    Where time steps are irregular, only those longer than 3.5 times the median one count.
    """
    if log.count < 3:
        return ()
    step, jump = np.diff(log.time), np.diff(log.row_numbers)
    usual = float(np.median(step / jump))
    long = (jump > 1) | (step > _most(step / jump, usual) * usual)
    kinds = {int(number): part.kind for part in log.removed for number in part.numbers}
    events = []
    for k in np.flatnonzero(long):
        first, last = int(log.row_numbers[k]), int(log.row_numbers[k + 1])
        kind = kinds.get(first + 1, MISSING)
        if kind == RATE:
            continue
        rows = (first + 1, last - 1) if last > first + 1 else (first, last)
        begin, end = float(log.time[k]) + _INSIDE * usual, float(log.time[k + 1]) - _INSIDE * usual
        events.append(Event(kind, begin, end, rows, _TEXT[kind].format(ms=f"{1e3 * step[k]:.3g} ms")))
    return tuple(events)


def _most(step: Array, usual: float) -> float:
    regular = np.mean(np.abs(step - usual) < _EVEN * usual) >= _MOSTLY
    return _TWO if regular else max(STEPS, LEAST / usual)


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
