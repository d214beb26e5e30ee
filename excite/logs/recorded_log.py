"""Logs from recordings: streams of different rates aligned by their time stamps, on the rows of the positions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from excite.logs.event import DROPPED
from excite.logs.further_files import in_gaps
from excite.logs.log import Log, Removed
from excite.logs.recordings.formats import recording_sha256
from excite.logs.sampled_channels import Sampled, SampledChannels
from regressors.errors import InputError
from regressors.samples import Array, Index

_QUANTITIES = {"q": "positions", "dq": "velocities", "effort": "efforts", "temperature": "temperatures"}


def recorded_log(
    path: Path,
    channels: SampledChannels,
    joints: tuple[str, ...],
    drop: frozenset[str],
    only: tuple[int, int] | None = None,
) -> Log:
    """Log of a recording whose streams have clocks of their own.

    The rows are those of the positions; everything else is interpolated linearly onto them, but not over its gaps.
    """
    source, notes = str(path), list(channels.notes)
    base = max((one for one in channels.columns if one.channel == "q"), key=lambda one: one.time.size)
    keep, removed = _kept(source, base, drop, only, notes)
    time, numbers = base.time[keep], base.rows[keep]
    others = [one if one is base else _in_order(source, one, drop) for one in channels.columns]
    inside = _inside(source, time, others)
    if outside := int(np.count_nonzero(~inside)):
        notes.append(f"{_rows(outside)} before or after what other streams recorded not used")
    values = _aligned(time[inside], others, base, keep, inside)
    notes += _rates(base, others)
    bridged = _bridged(time[inside], others, base)
    log = Log(
        source=source,
        sha256=recording_sha256(path),
        joints=joints,
        time=time[inside],
        q=values["q"],
        dq=values.get("dq"),
        effort=values.get("effort"),
        wrench=values.get("wrench"),
        temperature=values.get("temperature"),
        left_out=tuple(notes),
        numbers=numbers[inside],
        removed=removed,
    )
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
    later = _later(source, base, asked, drop)
    if repeated := int(np.sum(~later)):
        notes.append(f"{_rows(repeated)} with time repeated")
        return asked[later], (Removed(DROPPED, base.rows[asked[~later]]),)
    return asked, ()


def _later(source: str, one: Sampled, asked: Index, drop: frozenset[str]) -> NDArray[np.bool_]:
    """Which samples are later than those before; earlier ones are refused."""
    time, rows = one.time[asked], one.rows[asked]
    step = np.diff(time)
    if np.any(step < 0):
        k = int(np.argmax(step < 0))
        raise InputError(
            f"{source}, {one.stream}: time runs backwards at row {rows[k + 1]}, from {time[k]:.9f} to "
            f"{time[k + 1]:.9f} s; is this the right clock, and one recording? `rows` chooses rows of the positions"
        )
    if "repeated" not in drop and np.any(step == 0):
        k = int(np.argmax(step == 0))
        raise InputError(
            f"{source}, {one.stream}: time {time[k]:.9f} s is repeated at row {rows[k + 1]}; "
            f"{_rows(int(np.sum(step == 0)))} like this (`drop='repeated'` leaves them out)"
        )
    return np.concatenate([[True], step > 0])


def _in_order(source: str, one: Sampled, drop: frozenset[str]) -> Sampled:
    later = _later(source, one, np.arange(one.time.size), drop)
    if later.all():
        return one
    return Sampled(one.channel, one.place, one.stream, one.time[later], one.values[later], one.rows[later])


def _inside(source: str, time: Array, others: Sequence[Sampled]) -> NDArray[np.bool_]:
    """Which instants all columns were recorded around."""
    inside = np.ones(time.size, dtype=bool)
    for one in others:
        within = (time >= one.time[0]) & (time <= one.time[-1])
        if np.count_nonzero(inside & within) < 2:
            raise InputError(
                f"{source}: {_what(one)} of {one.stream} were recorded from {one.time[0]:.6g} to {one.time[-1]:.6g} s, "
                f"the positions from {time[0]:.6g} to {time[-1]:.6g} s; one clock should have stamped both"
            )
        inside &= within
    return inside


def _aligned(
    time: Array, others: Sequence[Sampled], base: Sampled, keep: Index, inside: NDArray[np.bool_]
) -> Mapping[str, Array]:
    """Values of each channel at the instants of the positions."""
    count = {one.channel: 1 + max(o.place for o in others if o.channel == one.channel) for one in others}
    values = {name: np.empty((time.size, columns)) for name, columns in count.items()}
    for one in others:
        alike = one.time is base.time or (one.stream == base.stream and np.array_equal(one.rows, base.rows))
        column = one.values[keep][inside] if alike and one.time.size == base.time.size else None
        values[one.channel][:, one.place] = np.interp(time, one.time, one.values) if column is None else column
    return values


def _bridged(time: Array, others: Sequence[Sampled], base: Sampled) -> NDArray[np.bool_]:
    """Which instants lie in gaps of a column that is not sampled with the positions."""
    bridged = np.zeros(time.size, dtype=bool)
    for one in others:
        if one.time.size != base.time.size or not np.array_equal(one.time, base.time):
            bridged |= in_gaps(time, one.time)
    return bridged


def _rates(base: Sampled, others: Sequence[Sampled]) -> list[str]:
    """Notes on what was interpolated, with the rates."""
    notes: dict[str, None] = {}
    for one in others:
        if one.time.size == base.time.size and np.array_equal(one.time, base.time):
            continue
        notes[
            f"{_what(one)} ({one.stream}, {_rate(one):.4g} Hz) interpolated linearly onto the rows of the positions "
            f"({base.stream}, {_rate(base):.4g} Hz); a constant delay between them is estimated by identification"
        ] = None
    return list(notes)


def _rate(one: Sampled) -> float:
    return float(1.0 / np.median(np.diff(one.time)))


def _what(one: Sampled) -> str:
    return _QUANTITIES.get(one.channel, one.channel)


def _rows(count: int) -> str:
    return f"{count} row{'s' * (count != 1)}"
