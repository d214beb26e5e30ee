"""Gaps of a log: instants that were not recorded."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from excite.logs.log import Log
from regressors.errors import InputError

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
