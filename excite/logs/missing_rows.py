"""Instants of a log between rows that were recorded, but are not here: lost, left out, or held."""

from __future__ import annotations

import numpy as np

from excite.logs.event import DROPPED, GARBAGE, HELD, IMPACT, MISSING, RATE, SPIKE, Event
from excite.logs.gaps import LEAST, STEPS
from excite.logs.log import Log
from regressors.samples import Array

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
