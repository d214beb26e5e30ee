"""Rate, duration and gaps of what a recording holds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from excite.logs.gaps import LEAST, STEPS
from excite.logs.guess.clock_choice import Clock
from excite.logs.mapping import SECONDS
from excite.logs.recordings.recording import Contents, Recording, Stream
from regressors.samples import Array


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
