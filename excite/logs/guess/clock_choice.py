"""Which column says when a row was taken, by its name and its numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from excite.logs.mapping import SECONDS
from excite.logs.recordings.column_name import is_clock, parsed_name
from excite.logs.recordings.recording import Numbers, Stream, StreamContents

_FEW = 0.01  # of the steps, that may be zero
_ALIKE = 0.01  # of the duration, between two clocks
_FIRST = ("__time", "time", "timestamp", "t")


@dataclass(frozen=True)
class Clock:
    """A clock."""

    column: str
    unit: str  # that the file states; empty if it does not
    why: str  # A sentence, empty where there was nothing to choose
    certain: bool  # whether it is by definition or by name, and not by its numbers alone


def clock_candidates(stream: StreamContents) -> tuple[str, ...]:
    """Columns that may be the clock of a stream, the likeliest first; all where no name says so."""
    if stream.clocks:
        return stream.clocks
    named = [name for name in stream.columns if is_clock(stream.title(name), stream.units.get(name, ""))]
    first = {title: k for k, title in enumerate(_FIRST)}
    named.sort(key=lambda name: first.get(stream.title(name).lower(), len(first)))
    return tuple(named) or stream.columns


def chosen_clock(contents: StreamContents, stream: Stream) -> Clock | None:
    """Clock of a stream; None if no column increases.

    The first of its clocks that increases and agrees in duration with the others, such as the stamps in the headers of
    messages with the times at which these were received.
    """
    candidates = [name for name in clock_candidates(contents) if name in stream.columns]
    certain = bool(contents.clocks) or any(is_clock(contents.title(name)) for name in candidates)
    good = [name for name in candidates if increases(stream.columns[name])]
    agreed = [name for name in good if _agrees(contents, stream, name, good)] if contents.clocks else good
    if not agreed:
        return None
    column = agreed[0]
    passed = [name for name in candidates[: candidates.index(column)] if contents.clocks]
    why = f"{passed[0]} does not increase as {column} does, which is used instead" if passed else ""
    if contents.clocks and not passed and len(candidates) > 1:
        why = f"{column} is used, which increases and agrees with {candidates[1]}"
    if not certain:
        why = f"{'column ' * column.isdigit()}{column} is taken for the time, since it increases"
    unit = contents.units.get(column) or parsed_name(contents.title(column)).unit
    return Clock(column, unit if unit in SECONDS else parsed_name(column, unit).unit, why, certain)


def increases(values: Numbers) -> bool:
    """Whether a clock runs forwards, but for a few steps that are zero."""  # values (N,)
    there = values[~np.isnan(values)] if values.dtype.kind == "f" else values
    if there.size < 3 or not np.all(np.isfinite(there)):
        return False
    step = np.diff(there)
    return bool(np.all(step >= 0) and np.count_nonzero(step == 0) <= _FEW * step.size)


def _agrees(contents: StreamContents, stream: Stream, name: str, others: Sequence[str]) -> bool:
    """Whether a clock lasts as long as the last of the good ones, which is when a message was received."""
    own, last = (_duration(contents, stream, clock) for clock in (name, others[-1]))
    return abs(own - last) <= _ALIKE * max(last, np.finfo(float).tiny)


def _duration(contents: StreamContents, stream: Stream, name: str) -> float:
    values = stream.columns[name]
    return float(values[-1] - values[0]) * SECONDS.get(contents.units.get(name, ""), 1.0)
