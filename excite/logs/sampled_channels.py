"""Columns of recordings as samples of the channels of a log, each with the instants at which it was taken."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from excite.logs.layout import Layout, listed
from excite.logs.mapping import SECONDS, LogMapping
from excite.logs.mapping_sections import ChannelSection, Column
from excite.logs.recordings.recording import Contents, Numbers, Recording, RecordingFormat, StreamContents
from excite.logs.table import Table
from regressors.errors import InputError, UnknownName
from regressors.quoting import cut
from regressors.samples import Array, Index


class Unusable(Exception):
    """Why a column cannot be used."""


@dataclass(frozen=True, eq=False)
class Sampled:
    """One column of a channel."""

    channel: str  # of `excite.logs.log.Log`, such as ``q``
    place: int  # column of the channel
    stream: str  # stream, or column of a table, for messages
    time: Array  # (N,) [s]
    values: Array  # (N,) [SI], finite
    rows: Index  # (N,) rows of the stream, 1 for the first


@dataclass(frozen=True, eq=False)
class SampledChannels:
    """What a mapping names of one recording."""

    columns: tuple[Sampled, ...]
    notes: tuple[str, ...]
    zero: float = 0.0  # what was subtracted from all times [s]


def samples_of_table(source: str, layout: Layout, table: Table, zero: float | None = None) -> SampledChannels:
    """Columns of a table in text, whose cells may be NaN, in SI."""
    place = {column: k for k, column in enumerate(layout.used)}
    time = table.values[:, place[layout.time]] * layout.second
    own = zero is None
    zero = whole_seconds(float(time[0])) if zero is None else zero
    time -= zero
    columns = []
    for name, channel in layout.channels.items():
        label = layout.names[channel.columns[0]] + " ..." * (len(channel.columns) > 1)
        cells = np.ascontiguousarray(table.values[:, [place[column] for column in channel.columns]].T)
        for k, column in enumerate(channel.columns):
            values = channel.scale[k] * (cells[k] - channel.zero[k])
            try:
                columns.append(_there(name, k, label, time, values, table.lines - layout.first))
            except Unusable as error:
                raise InputError(f"{source}, column {cut(layout.names[column])}: {error}") from error
    counted = (zero_note(zero),) if zero and own else ()
    return SampledChannels(tuple(columns), (*table.left_out, *counted), zero)


def _there(channel: str, place: int, column: str, time: Array, values: Array, rows: Index) -> Sampled:
    """Samples of a column in the rows that have one."""
    if np.isinf(values).any() or np.isinf(time).any():
        row = int(rows[np.argmax(np.isinf(values) | np.isinf(time))])
        raise Unusable(f"row {row} is infinite, which is not a measurement")
    there = np.flatnonzero(~(np.isnan(values) | np.isnan(time)))
    if there.size < 2:
        raise Unusable(f"{there.size} values; a log has two or more")
    if there.size == time.size:
        return Sampled(channel, place, column, time, values, rows)
    return Sampled(channel, place, column, time[there], values[there], rows[there])


@dataclass(frozen=True)
class _Wanted:
    channel: str
    place: int
    column: str
    stream: StreamContents
    clock: str
    second: float


def sampled_channels(
    form: RecordingFormat, path: Path, mapping: LogMapping, file: str | None = None, zero: float | None = None
) -> SampledChannels:
    """Columns that a mapping names, in SI."""
    contents = form.contents(path)
    sections = {name: section for name, section in mapping.sections.items() if section.file == file}
    wanted = [one for name, section in sections.items() for one in _wanted(contents, mapping, name, section)]
    recording = form.read(path, _columns(wanted))
    own = zero is None
    zero = _zero(recording, wanted) if zero is None else zero
    notes = [*contents.notes, *(note for note in recording.notes if note not in contents.notes)]
    columns = []
    for one in wanted:
        section = sections[one.channel]
        columns.append(_sampled(recording, one, section, zero))
    if zero and own:
        notes.append(zero_note(zero))
    return SampledChannels(tuple(columns), tuple(notes), zero)


def _wanted(contents: Contents, mapping: LogMapping, channel: str, section: ChannelSection) -> list[_Wanted]:
    time = section.time or mapping.time
    result = []
    for place, column in enumerate(section.columns):
        name = _name(contents, column)
        stream = _stream_of(contents, name, str(time.column))
        clock, second = _clock(contents, stream, time.column, SECONDS[time.unit])
        result.append(_Wanted(channel, place, name, stream, clock, second))
    return result


def _name(contents: Contents, column: Column) -> str:
    """Name of a column, which may be given by its number where there is one stream."""
    names = contents.columns
    if isinstance(column, int):
        if len(contents.streams) > 1:
            raise InputError(f"{contents.source} has {len(contents.streams)} streams; name the column, not its number")
        if column > len(names):
            raise InputError(f"{contents.source} has {len(names)} columns, the mapping asks for number {column}")
        return names[column - 1]
    if column not in names:
        raise UnknownName(f"column in {contents.source}", column, names)
    return column


def _stream_of(contents: Contents, column: str, clock: str) -> StreamContents:
    """Stream of a column; that with the given clock where several have the column."""
    streams = contents.streams_of(column)
    return next((stream for stream in streams if clock in stream.columns), streams[0])


def _clock(contents: Contents, stream: StreamContents, given: Column, second: float) -> tuple[str, float]:
    """Clock of a stream: the given one, else the stream's own of the same kind, else the one it prefers."""
    name = _name(contents, given)
    if name in stream.columns:
        stated = stream.units.get(name) if name in stream.clocks else None
        return name, SECONDS.get(stated or "", second)
    if not stream.clocks:
        raise InputError(
            f"{contents.source}: {stream.name} has no time of its own, and {name} is of another stream; give the "
            f"quantity a time of {stream.name} in the mapping; columns: {listed(stream.columns)}"
        )
    kind = name.rsplit("/", 1)[-1]
    own = next((clock for clock in stream.clocks if clock.rsplit("/", 1)[-1] == kind), stream.clocks[0])
    return own, SECONDS.get(stream.units.get(own, ""), second)


def _columns(wanted: Sequence[_Wanted]) -> Mapping[str, list[str]]:
    columns: dict[str, dict[str, None]] = {}
    for one in wanted:
        columns.setdefault(one.stream.name, {}).update({one.clock: None, one.column: None})
    return {stream: list(names) for stream, names in columns.items()}


def _zero(recording: Recording, wanted: Sequence[_Wanted]) -> float:
    first = wanted[0]
    values = recording.streams[first.stream.name].columns[first.clock]
    there = values[~np.isnan(values)] if values.dtype.kind == "f" else values
    if not there.size:
        return 0.0
    return whole_seconds(int(there[0]) * first.second if there.dtype.kind in "iu" else float(there[0]) * first.second)


_LARGE = 1e6  # [s]


def whole_seconds(first: float) -> float:
    """Seconds to count times from: none, or the first ones of a clock that counts so many that a float loses digits."""
    return float(int(first)) if np.isfinite(first) and abs(first) > _LARGE else 0.0


def zero_note(zero: float) -> str:
    """Note that times are not counted from where their clock does."""
    return f"time is counted from {zero:.0f} s of its clock"


def _sampled(recording: Recording, one: _Wanted, section: ChannelSection, zero: float) -> Sampled:
    stream = recording.streams[one.stream.name]
    channel = section.channel(tuple(range(len(section.columns))))
    values = np.asarray(stream.columns[one.column], dtype=float)
    time = seconds_of(stream.columns[one.clock], one.second, zero)
    k = one.place
    converted = channel.scale[k] * (values - channel.zero[k])
    try:
        return _there(one.channel, k, stream.name, time, converted, np.arange(1, time.size + 1))
    except Unusable as error:
        raise InputError(f"{recording.source}, {one.column}: {error}") from error


def seconds_of(clock: Numbers, second: float, zero: float) -> Array:
    """Times of a clock less a zero [s]."""  # clock (N,)
    if clock.dtype.kind in "iu" and zero:
        return np.asarray((clock - clock.dtype.type(round(zero / second))) * second, dtype=float)
    return np.asarray(clock, dtype=float) * second - zero
