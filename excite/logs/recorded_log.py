"""Logs from recordings: streams of different rates aligned by their time stamps, on the rows of the positions.

The columns that a mapping names are samples of the channels of a log, each with the instants at which it was taken.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256 as digest_of
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from excite.logs.event import DROPPED, STEPS
from excite.logs.layout import Channel, Layout, listed
from excite.logs.log import Log, Removed, counted, held_values
from excite.logs.mapping import SECONDS, Column, LogMapping, TimeSection
from excite.logs.recordings.formats import binary_format, recording_sha256
from excite.logs.recordings.recording import Contents, Numbers, RecordingFormat, StreamContents
from excite.logs.table import Table, in_nanoseconds, later_rows, table_of
from excite.logs.text import text_of
from regressors.errors import InputError, check_names, cut
from regressors.samples import Array, Index


@dataclass(frozen=True, eq=False)
class Sampled:
    """One column of a channel."""

    channel: str  # of `excite.logs.log.Log`, such as ``q``
    place: int  # column of the channel
    stream: str  # stream, or column of a table, for messages
    time: Array  # (N,) [s]
    values: Array  # (N,) [SI], finite
    rows: Index  # (N,) rows of the stream, 1 for the first


# What a mapping names of one recording: its columns, notes on them, and what was subtracted from all times [s]
Samples: TypeAlias = tuple[list[Sampled], list[str], float]


def samples_of_table(source: str, layout: Layout, table: Table, zero: float | None = None) -> Samples:
    """Columns of a table in text, whose cells may be NaN, in SI."""
    place = {column: k for k, column in enumerate(layout.used)}
    time = table.clock * layout.second
    notes = list(table.left_out)
    if zero is None:
        zero = whole_seconds(float(time[0]))
        notes += [zero_note(zero)] * bool(zero)
    time -= zero
    columns = []
    for name, channel in layout.channels.items():
        label = layout.names[channel.columns[0]] + " ..." * (len(channel.columns) > 1)
        cells = np.ascontiguousarray(table.values[:, [place[column] for column in channel.columns]].T)
        for k, column in enumerate(channel.columns):
            values = channel.scale[k] * (cells[k] - channel.zero[k])
            where = f"{source}, column {cut(layout.names[column])}"
            columns.append(_there(name, k, label, time, values, table.lines - layout.first, where))
    return columns, notes, zero


def _there(channel: str, place: int, column: str, time: Array, values: Array, rows: Index, where: str) -> Sampled:
    """Samples of a column in the rows that have one."""
    if np.isinf(values).any() or np.isinf(time).any():
        row = int(rows[np.argmax(np.isinf(values) | np.isinf(time))])
        raise InputError(f"{where}: row {row} is infinite, which is not a measurement")
    there = np.flatnonzero(~(np.isnan(values) | np.isnan(time)))
    if there.size < 2:
        raise InputError(f"{where}: {there.size} values; a log has two or more")
    if there.size == time.size:
        return Sampled(channel, place, column, time, values, rows)
    return Sampled(channel, place, column, time[there], values[there], rows[there])


def sampled_channels(
    form: RecordingFormat, path: Path, mapping: LogMapping, file: str | None = None, zero: float | None = None
) -> Samples:
    """Columns that a mapping names, in SI."""
    contents = form.contents(path)
    wanted: list[tuple[str, int, Channel, str, str, tuple[str, ...], float]] = []
    columns: dict[str, dict[str, None]] = {}
    for channel, section in mapping.sections.items():
        if section.file != file:
            continue
        time, conversion = section.time or mapping.time, section.channel(tuple(range(len(section.columns))))
        for k, given in enumerate(section.columns):
            name = _name(contents, given)
            streams = [stream for stream in contents.streams if name in stream.columns]
            stream = next((each for each in streams if str(time.column) in each.columns), streams[0])
            clock, second = _clock(contents, stream, time)
            columns.setdefault(stream.name, {}).update(dict.fromkeys((*clock, name)))
            wanted.append((channel, k, conversion, name, stream.name, clock, second))
    recording = form.read(path, {stream: list(names) for stream, names in columns.items()})
    notes = [*contents.notes, *(note for note in recording.notes if note not in contents.notes)]
    if zero is None:
        *_, home, clock, second = wanted[0]
        zero = _zero(_stamps(recording.streams[home].columns, clock), second) if clock else 0.0
        notes += [zero_note(zero)] * bool(zero)
    samples = []
    for channel, k, conversion, name, home, clock, second in wanted:
        loaded = recording.streams[home].columns
        rows = np.arange(1, len(loaded[name]) + 1)
        times = (
            seconds_of(_stamps(loaded, clock), second, zero) if clock else second * np.asarray(rows - 1.0, dtype=float)
        )
        values = conversion.scale[k] * (np.asarray(loaded[name], dtype=float) - conversion.zero[k])
        samples.append(_there(channel, k, home, times, values, rows, f"{recording.source}, {name}"))
    return samples, notes, zero


def _name(contents: Contents, column: Column) -> str:
    """Name of a column, which may be given by its number where there is one stream."""
    names = contents.columns
    if isinstance(column, str):
        check_names(f"column in {contents.source}", [column], names)
        return column
    if len(contents.streams) > 1:
        raise InputError(f"{contents.source} has {len(contents.streams)} streams; name the column, not its number")
    if column > len(names):
        raise InputError(f"{contents.source} has {len(names)} columns, the mapping asks for number {column}")
    return names[column - 1]


def _clock(contents: Contents, stream: StreamContents, time: TimeSection) -> tuple[tuple[str, ...], float]:
    """Clock of a stream: the given one, else the stream's own of the same kind, else the one it prefers; or no name."""
    if time.column is None:
        return (), time.second
    name = _name(contents, time.column)
    if time.nanoseconds is not None:
        return (name, _name(contents, time.nanoseconds)), time.second
    if name in stream.columns:
        stated = stream.units.get(name) if name in stream.clocks else None
        return (name,), SECONDS.get(stated or "", time.second)
    if not stream.clocks:
        raise InputError(
            f"{contents.source}: {stream.name} has no time of its own, and {name} is of another stream; give the "
            f"quantity a time of {stream.name} in the mapping; columns: {listed(stream.columns)}"
        )
    kind = name.rsplit("/", 1)[-1]
    own = next((clock for clock in stream.clocks if clock.rsplit("/", 1)[-1] == kind), stream.clocks[0])
    return (own,), SECONDS.get(stream.units.get(own, ""), time.second)


def _stamps(columns: Mapping[str, Numbers], clock: Sequence[str]) -> Numbers:
    """Times of a clock, which may be one column, or one of seconds and one of nanoseconds."""
    return in_nanoseconds(*(columns[name] for name in clock)) if len(clock) == 2 else columns[clock[0]]


def _zero(clock: Numbers, second: float) -> float:
    there = clock[~np.isnan(clock)]
    return whole_seconds(there[0].item() * second) if there.size else 0.0


_LARGE = 1e6  # [s]


def whole_seconds(first: float) -> float:
    """Seconds to count times from: none, or the first ones of a clock that counts so many that a float loses digits."""
    return float(int(first)) if np.isfinite(first) and abs(first) > _LARGE else 0.0


def zero_note(zero: float) -> str:
    """Note that times are not counted from where their clock does."""
    return f"time is counted from {zero:.0f} s of its clock"


def seconds_of(clock: Numbers, second: float, zero: float) -> Array:
    """Times of a clock less a zero [s]."""  # clock (N,)
    if clock.dtype.kind in "iu" and zero:
        return np.asarray((clock - clock.dtype.type(round(zero / second))) * second, dtype=float)
    return np.asarray(clock, dtype=float) * second - zero


_QUANTITIES = {
    "q": "positions", "dq": "velocities", "effort": "efforts", "temperature": "temperatures", "wrench": "wrench",
    "command": "commands", "base": "motion of the base",
}  # fmt: skip
_HELD = "command"  # the channel whose values hold until the next one


def recorded_log(
    source: str,
    sha256: str,
    samples: Samples,
    joints: tuple[str, ...],
    drop: frozenset[str],
    only: tuple[int, int] | None = None,
) -> Log:
    """Log of a recording whose streams have clocks of their own.

    The rows are those of the positions; everything else is interpolated linearly onto them, but not over its gaps.
    Commands hold until the next one.
    """
    columns, notes, _ = samples
    base = max((one for one in columns if one.channel == "q"), key=lambda one: one.time.size)
    keep, removed = _kept(source, base, drop, only, notes)
    others = [one if one is base else _in_order(source, one, drop) for one in columns]
    inside = _inside(source, base.time[keep], others)
    if outside := int(np.count_nonzero(~inside)):
        notes.append(f"{counted(outside, 'row')} before or after what other streams recorded not used")
    rows = keep[inside]
    time, numbers = base.time[rows], base.rows[rows]
    there = replace(base, time=base.time[keep], values=base.values[keep])
    values = _aligned(time, [there if one is base else one for one in others])
    notes += _rates(base, others)
    bridged = _bridged(time, [one for one in others if not np.array_equal(one.time, base.time)])
    log = Log(source, sha256, joints, time, **values, left_out=tuple(notes), numbers=numbers, removed=removed)
    return log.without(DROPPED, bridged) if bridged.any() else log


def _kept(
    source: str, base: Sampled, drop: frozenset[str], only: tuple[int, int] | None, notes: list[str]
) -> tuple[Index, tuple[Removed, ...]]:
    """Which samples of the positions are read, in the order of time."""
    asked = np.arange(base.time.size)
    if only is not None:
        if only[1] > base.rows[-1]:
            raise InputError(
                f"{source}: rows: given {only[0]}:{only[1]}, but {base.stream} has {base.rows[-1]} rows of positions"
            )
        asked = np.flatnonzero((base.rows >= only[0]) & (base.rows <= only[1]))
    if asked.size < 2:
        raise InputError(f"{source}: fewer than two rows are left")
    later = later_rows(base.time[asked], lambda k: f"{source}, {base.stream}, row {base.rows[asked[k]]}", drop)
    if repeated := int(np.sum(~later)):
        notes.append(f"{counted(repeated, 'row')} with time repeated")
        return asked[later], (Removed(DROPPED, base.rows[asked[~later]]),)
    return asked, ()


def _in_order(source: str, one: Sampled, drop: frozenset[str]) -> Sampled:
    later = later_rows(one.time, lambda k: f"{source}, {one.stream}, row {one.rows[k]}", drop)
    return one if later.all() else replace(one, time=one.time[later], values=one.values[later], rows=one.rows[later])


def _inside(source: str, time: Array, others: Sequence[Sampled]) -> NDArray[np.bool_]:
    """Which instants all columns were recorded around."""
    inside = np.ones(time.size, dtype=bool)
    for one in others:
        within = (time >= one.time[0]) & (time <= one.time[-1])
        if np.count_nonzero(inside & within) < 2:
            raise InputError(
                f"{source}: {_QUANTITIES[one.channel]} of {one.stream} were recorded from {one.time[0]:.6g} to "
                f"{one.time[-1]:.6g} s, the positions from {time[0]:.6g} to {time[-1]:.6g} s; one clock should have "
                "stamped both"
            )
        inside &= (time >= one.time[0]) & (within | (one.channel == _HELD))
    return inside


def _aligned(time: Array, others: Sequence[Sampled]) -> dict[str, Any]:
    """Values of each channel at the instants of the positions: commands hold, the rest is interpolated linearly."""
    values = {name: np.empty((time.size, n)) for name, n in Counter(one.channel for one in others).items()}
    for one in others:
        at = held_values(one.time, one.values, time) if one.channel == _HELD else np.interp(time, one.time, one.values)
        values[one.channel][:, one.place] = at
    return values


def _rates(base: Sampled, others: Sequence[Sampled]) -> list[str]:
    """Notes on what was interpolated, with the rates."""
    notes = []
    for one in others:
        if not np.array_equal(one.time, base.time):
            own, rate = (1.0 / np.median(np.diff(each.time)) for each in (one, base))
            how, more = "interpolated linearly", "; a constant delay between them is estimated by identification"
            if one.channel == _HELD:
                after = int(np.count_nonzero(base.time > one.time[-1]))
                how, more = "held", f"; {counted(after, 'row')} after the last one" * bool(after)
            notes.append(
                f"{_QUANTITIES[one.channel]} ({one.stream}, {own:.4g} Hz) {how} onto the rows of the positions "
                f"({base.stream}, {rate:.4g} Hz){more}"
            )
    return list(dict.fromkeys(notes))


def with_further_files(log: Log, path: Path, mapping: LogMapping, drop: frozenset[str], zero: float = 0.0) -> Log:
    """The log with the channels that a mapping says are in other files, at the instants of its rows."""
    for file in sorted({section.file for section in mapping.sections.values() if section.file is not None}):
        log = _with_file(log, path.parent / file.replace("{log}", path.stem), file, mapping, drop, zero)
    return log


def _with_file(log: Log, path: Path, file: str, mapping: LogMapping, drop: frozenset[str], zero: float) -> Log:
    others, notes, _ = _of_file(path, file, mapping, drop, zero)
    inside = _inside(str(path), log.time, others)
    channels = _aligned(log.time[inside], others)
    outside = int(np.count_nonzero(~inside))
    rows = max(one.time.size for one in others)
    how = "held" if channels.keys() == {_HELD} else "interpolated linearly"
    note = f"{path.name}: {rows} rows, {how} onto the {np.count_nonzero(inside)} of the positions"
    note += f"; {outside} of these are before or after it and are not used" * bool(outside)
    both = digest_of(f"{log.sha256} {recording_sha256(path)}".encode()).hexdigest()
    merged = replace(log.rows(np.flatnonzero(inside)), sha256=both, left_out=(*log.left_out, *notes, note), **channels)
    bridged = _bridged(merged.time, others)
    return merged.without(DROPPED, bridged) if bridged.any() else merged


def _of_file(path: Path, file: str, mapping: LogMapping, drop: frozenset[str], zero: float) -> Samples:
    if (form := binary_format(path)) is not None:
        return sampled_channels(form, path, mapping, file, zero)
    with text_of(path) as text:
        layout = mapping.layout(text.source, text.lines, file)
        columns, notes, zero = samples_of_table(text.source, layout, table_of(text, layout, drop), zero)
        return columns, [*text.mended, *notes], zero


def _bridged(time: Array, others: Sequence[Sampled]) -> NDArray[np.bool_]:
    """Which instants lie in gaps of what is interpolated."""
    gaps = [in_gaps(time, one.time) for one in others if one.channel != _HELD]
    return np.any(gaps, axis=0) if gaps else np.zeros(time.size, dtype=bool)


def in_gaps(new: Array, time: Array) -> NDArray[np.bool_]:
    """Which instants lie in gaps of another clock, where it says nothing."""
    step = np.diff(time)
    before = np.clip(np.searchsorted(time, new, side="right") - 1, 0, step.size - 1)
    return np.asarray((step[before] > STEPS * np.median(step)) & (new > time[before]) & (new < time[before + 1]))
