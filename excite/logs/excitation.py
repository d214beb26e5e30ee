"""The exciting stretch of a log: without idling, approach and return."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from excite.logs.log import Log
from excite.logs.movement import mean_speed, moves, runs
from regressors.errors import InputError

PAUSE = 0.5
REST = 0.1
_SHARE = 0.2
_FEWEST = 10


@dataclass(frozen=True)
class Stretch:
    """Rows from ``start`` to before ``stop`` in which some joint moves; ``single`` if no joint reverses."""

    start: int
    stop: int
    single: bool


def exciting_rows(log: Log) -> tuple[slice, str]:
    """Select the rows of a log with the exciting motion, and summarise the choice.

    Stretches of motion are separated by pauses of half a second or more. The rows are those from the first to the last
    stretch that lasts at least a fifth of the longest and is not a point-to-point motion, in which no joint reverses;
    where all stretches are point-to-point motions, only their length counts. A tenth of a second of rest is kept at
    both ends.
    """
    stretches = _stretches(log) if log.count >= _FEWEST else []
    if not stretches:
        raise InputError(f"{log.source}: no joint moves in its {log.count} rows ({log.duration:.3g} s)")
    candidates = [s for s in stretches if not s.single] or stretches
    longest = max(_seconds(log, s.start, s.stop) for s in candidates)
    chosen = [s for s in candidates if _seconds(log, s.start, s.stop) >= _SHARE * longest]
    start, stop = _with_rest(log, stretches, chosen[0].start, chosen[-1].stop)
    return slice(start, stop), _summary(log, stretches, start, stop)


def _with_rest(log: Log, stretches: list[Stretch], start: int, stop: int) -> tuple[int, int]:
    """Add a short rest at both ends, where motion is too slow to be detected, but no other motion."""
    first = max([s.stop for s in stretches if s.stop <= start], default=0)
    last = min([s.start for s in stretches if s.start >= stop], default=log.count)
    early = int(np.searchsorted(log.time, log.time[start] - REST))
    late = int(np.searchsorted(log.time, log.time[stop - 1] + REST, side="right"))
    return max(first, early), min(last, late)


def _stretches(log: Log) -> list[Stretch]:
    moving = moves(log)
    speed = np.where(moving, mean_speed(log), 0.0)
    joined: list[tuple[int, int]] = []
    for start, stop in runs(np.any(moving, axis=1)):
        if joined and log.time[start] - log.time[joined[-1][1] - 1] < PAUSE:
            start = joined.pop()[0]
        joined.append((start, stop))
    return [Stretch(a, b, not _turns_back(speed[a:b])) for a, b in joined]


def _turns_back(speed: NDArray[np.float64]) -> bool:
    return bool(np.any((speed > 0).any(axis=0) & (speed < 0).any(axis=0)))


def _seconds(log: Log, start: int, stop: int) -> float:
    return float(log.time[stop - 1] - log.time[start])


def _summary(log: Log, stretches: list[Stretch], start: int, stop: int) -> str:
    first, last, end = (log.row_numbers[k] for k in (start, stop - 1, -1))
    text = f"rows {first} to {last} of {end} excite ({_seconds(log, start, stop):.3g} s)"
    left = [
        _side(log, "before", 0, start, [s for s in stretches if s.stop <= start]),
        _side(log, "after", stop, log.count, [s for s in stretches if s.start >= stop]),
    ]
    return "; ".join([text, *filter(None, left)])


def _side(log: Log, where: str, start: int, stop: int, moved: list[Stretch]) -> str:
    """Summary of the rows left out, such as ``left out before them: 620 rows (6.2 s) with motion of 0.48 s``."""
    if start == stop:
        return ""
    lengths = [f"{_seconds(log, s.start, s.stop):.2g} s" for s in moved]
    kind = "no motion" if not lengths else f"motion of {', '.join(lengths)}"
    return f"left out {where} them: {stop - start} rows ({_seconds(log, start, stop):.3g} s) with {kind}"
