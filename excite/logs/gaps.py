"""Instants that were not recorded: gaps, lost rows, and missing steps of an uneven clock."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from excite.logs.event import DROPPED, GARBAGE, HELD, IMPACT, MISSING, RATE, SPIKE, Event
from excite.logs.log import Log
from regressors.errors import InputError
from regressors.samples import Array

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
