"""Which column says when a row was taken, and the rate and gaps of a recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from excite.logs.gaps import LEAST, STEPS
from excite.logs.mapping import SECONDS
from excite.logs.recordings.column_name import is_clock, parsed_name
from excite.logs.recordings.recording import Contents, Numbers, Recording, Stream, StreamContents
from regressors.samples import Array

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


@dataclass(frozen=True)
class StreamSummary:
    """Columns of a stream that were sampled at the same instants.

    Parameters
    ----------
    stream : str
    columns : tuple of str
    rows : int
    clock : str
        Empty where none was found; then the figures below are zero.
    rate, duration : float
        Mean rate outside the gaps [Hz], [s].
    gaps : int
        Steps longer than 3.5 times the median one and than 20 ms.
    longest_gap : float
        [s]
    """

    stream: str
    columns: tuple[str, ...]
    rows: int
    clock: str = ""
    rate: float = 0.0
    duration: float = 0.0
    gaps: int = 0
    longest_gap: float = 0.0


def summaries(
    contents: Contents, recording: Recording, clocks: Mapping[str, Clock], unit: str
) -> tuple[StreamSummary, ...]:
    """Summaries of all streams, of those that were read with their rates."""
    result: list[StreamSummary] = []
    for stream in contents.streams:
        clock, loaded = clocks.get(stream.name), recording.streams.get(stream.name)
        if clock is None or loaded is None:
            result.append(StreamSummary(stream.name, stream.columns, stream.rows or 0))
            continue
        result += _of_stream(loaded, stream.columns, clock, SECONDS[clock.unit or unit or "s"])
    return tuple(result)


def _of_stream(stream: Stream, names: tuple[str, ...], clock: Clock, second: float) -> Iterator[StreamSummary]:
    values = stream.columns[clock.column]
    time = (values - values[0]).astype(float) * second
    sets: dict[bytes, list[str]] = {}
    there: dict[bytes, NDArray[np.bool_]] = {}
    for name in names:
        if name not in stream.columns or name == clock.column:
            continue
        mask = ~np.isnan(stream.columns[name]) if stream.columns[name].dtype.kind == "f" else np.ones(time.size, bool)
        key = np.packbits(mask).tobytes()
        sets.setdefault(key, []).append(name)
        there[key] = mask
    if len(sets) <= 1:  # one clock for all, also for those that were not read
        mask = next(iter(there.values()), np.ones(time.size, bool))
        yield _summary(stream.name, names, clock.column, time[mask])
        return
    for key, columns in sets.items():
        yield _summary(stream.name, tuple(columns), clock.column, time[there[key]])


def _summary(stream: str, columns: tuple[str, ...], clock: str, time: Array) -> StreamSummary:
    if time.size < 2:
        return StreamSummary(stream, columns, time.size, clock)
    step = np.diff(time)
    median = float(np.median(step))
    gap = (step > STEPS * median) & (step > LEAST)
    long, rest = step[gap], float(step[~gap].sum())
    rate = (step.size - long.size) / rest if rest > 0 else 0.0
    longest = float(long.max()) if long.size else 0.0
    return StreamSummary(stream, columns, time.size, clock, rate, float(time[-1] - time[0]), long.size, longest)
