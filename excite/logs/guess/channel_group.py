"""Columns of one quantity, one for each joint: by definitions, by names, or by their numbers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from excite.logs.guess.clock_choice import Clock
from excite.logs.log import WRENCH
from excite.logs.recordings.column_name import ColumnName, parsed_name
from excite.logs.recordings.recording import Contents, Recording, StreamContents
from regressors.samples import Array

_PREFERRED = frozenset({"actual", "measured", "meas", "state", "states", "joint", "feedback", "present"})


@dataclass(frozen=True)
class ChannelGroup:
    """Columns of one quantity."""

    # ``position``, ``velocity``, ``effort``, ``current``, ``temperature``, ``wrench``; empty where nothing says it
    quantity: str
    stream: str
    joints: tuple[str, ...]  # numbers or names, as the file has them
    columns: tuple[str, ...]  # one for each of them
    unit: str = ""  # empty where nothing states it
    why: str = ""  # definition that says so; empty where it is by name
    common: tuple[str, ...] = ()  # words that all names share beside quantity and joint
    measured: bool = True
    how: str = "by their names"  # it was found, the end of a sentence
    guessed: bool = False  # whether the columns themselves are to be asked for

    @property
    def span(self) -> str:
        """First and last column, in words."""
        ends = [f"column {name}" if name.isdigit() else name for name in (self.columns[0], self.columns[-1])]
        if len(self.columns) == 1:
            return ends[0]
        return f"columns {self.columns[0]} ... {self.columns[-1]}" if self.columns[0].isdigit() else " ... ".join(ends)

    @property
    def rank(self) -> tuple[bool, int, int]:
        """By which the likeliest of several is chosen: defined, named as measured, with most joints."""
        return bool(self.why), len(_PREFERRED.intersection(self.common)), len(self.joints)

    def of(self, joints: Sequence[str]) -> ChannelGroup:
        """The same, of some joints in an order."""
        columns = tuple(self.columns[self.joints.index(joint)] for joint in joints)
        return replace(self, joints=tuple(joints), columns=columns)


def channel_groups(contents: Contents) -> list[ChannelGroup]:
    """All groups of columns of a recording."""
    groups = []
    for stream in contents.streams:
        groups += [*_defined(stream), *_wrenches(stream), *_named(stream)]
    return groups


def _defined(stream: StreamContents) -> list[ChannelGroup]:
    there: dict[tuple[str, str, str], dict[str, str]] = {}
    for column in stream.columns:
        if (meaning := stream.meanings.get(column)) is not None:
            there.setdefault((meaning.quantity, meaning.unit, meaning.why), {})[meaning.of] = column
    return [
        _whole_wrench(stream, columns, unit, why)
        if quantity == "wrench"
        else ChannelGroup(quantity, stream.name, tuple(columns), tuple(columns.values()), unit, why)
        for (quantity, unit, why), columns in there.items()
        if quantity != "wrench" or set(WRENCH) <= set(columns)
    ]


def _whole_wrench(stream: StreamContents, columns: dict[str, str], unit: str, why: str) -> ChannelGroup:
    return ChannelGroup("wrench", stream.name, WRENCH, tuple(columns[part] for part in WRENCH), unit, why)


_AXIS = re.compile(r"^(.*?)(force|torque|f|t|m)[^a-z0-9]?([xyz])$", re.IGNORECASE)
_SIDE = {"force": "force", "f": "force", "torque": "torque", "t": "torque", "m": "torque"}


def _wrenches(stream: StreamContents) -> list[ChannelGroup]:
    """Six columns such as ``ft/force/x`` or ``fx``."""
    there: dict[tuple[str, int], dict[str, str]] = {}
    for column in stream.columns:
        title = re.sub(r"\s*[\[(].*$", "", stream.title(column))
        if column not in stream.meanings and (match := _AXIS.match(title)):
            part = f"{_SIDE[match[2].lower()]}.{match[3].lower()}"
            there.setdefault((match[1].lower(), len(match[2]) > 1), {})[part] = column
    return [_whole_wrench(stream, columns, "", "") for columns in there.values() if set(WRENCH) <= set(columns)]


def _named(stream: StreamContents) -> list[ChannelGroup]:
    parsed = {
        column: parsed_name(stream.title(column), stream.units.get(column, ""))
        for column in stream.columns
        if column not in stream.meanings and column not in stream.clocks and stream.title(column)
    }
    groups: list[ChannelGroup] = []
    for quantity in ("position", "velocity", "effort", "current", "temperature", ""):
        for measured in (True, False):
            some = {c: p for c, p in parsed.items() if p.quantity == quantity and p.measured == measured}
            groups += _by_joint(stream, quantity, some, measured=measured)
    return groups


def _by_joint(
    stream: StreamContents, quantity: str, parsed: dict[str, ColumnName], *, measured: bool
) -> Iterable[ChannelGroup]:
    """Groups of columns whose names differ by a number; else by the name of a joint."""
    numbered: dict[tuple[tuple[str, ...], str], dict[str, str]] = {}
    for column, name in parsed.items():
        digits = [k for k, word in enumerate(name.label) if word.isdigit()]
        if digits:
            k = digits[-1]
            template = (*name.label[:k], "#", *name.label[k + 1 :])
            numbered.setdefault((template, name.unit), {}).setdefault(name.label[k], column)
    in_groups = {column for columns in numbered.values() if len(columns) > 1 for column in columns.values()}
    if len(in_groups) == len(parsed) or not quantity:
        for (template, unit), columns in numbered.items():
            if len(columns) > 1:
                joints = tuple(sorted(columns, key=int))
                ordered = tuple(columns[joint] for joint in joints)
                yield ChannelGroup(quantity, stream.name, joints, ordered, unit, "", template, measured)
        return
    by_place: dict[tuple[str, str], dict[str, str]] = {}
    for column, name in parsed.items():
        place, joint = _joint_name(stream.title(column), name)
        by_place.setdefault((place, name.unit), {}).setdefault(joint, column)
    for (place, unit), columns in by_place.items():
        words = tuple(part for part in re.split(r"[^a-z]+", place.lower()) if part)
        yield ChannelGroup(quantity, stream.name, tuple(columns), tuple(columns.values()), unit, "", words, measured)


def _joint_name(title: str, parsed: ColumnName) -> tuple[str, str]:
    """Where a column is, and the name of its joint, of a name such as ``/topic/shoulder/position`` or ``elbow.pos``."""
    parts = [part for part in re.split(r"[/.]", re.sub(r"\s*[\[(][^\])]*[\])]\s*$", "", title)) if part]
    of_quantity = [k for k, part in enumerate(parts) if parsed_name(part).quantity == parsed.quantity]
    k = of_quantity[-1] if of_quantity else len(parts) - 1
    if not parsed_name(parts[k]).label and len(parts) > 1:  # the quantity alone: the joint stands before or behind it
        joint = k - 1 if k else 1
        return "/".join(part for n, part in enumerate(parts) if n not in (k, joint)), parts[joint]
    return "/".join(parts[:k]), "_".join(parsed_name(parts[k]).label) or "joint"


def numbered_groups(
    contents: Contents, recording: Recording, clocks: Mapping[str, Clock], joints: int | None
) -> list[ChannelGroup]:
    """Positions and velocities of each stream by their agreement, and blocks of as many columns beside them."""
    groups = []
    for stream in contents.streams:
        clock = clocks.get(stream.name)
        if clock is None or stream.name not in recording.streams:
            continue
        columns = recording.streams[stream.name].columns
        names = [name for name in stream.columns if name in columns]
        values = np.column_stack([np.asarray(columns[name], dtype=float) for name in names])
        groups += _of_stream(stream.name, names, values, names.index(clock.column), joints)
    return groups


def _of_stream(stream: str, names: list[str], values: Array, clock: int, joints: int | None) -> list[ChannelGroup]:
    whole = values[np.isfinite(values).all(axis=1)]
    if whole.shape[0] < 100:
        return []
    found = motion_columns(whole[:, clock], whole, clock)
    if found is None:
        return []
    n = min(joints or len(found.positions), len(found.positions))
    labels = tuple(f"{k}" for k in range(1, n + 1))
    seen = "" if found.seen >= n else f", as {found.seen} of them show{'s' * (found.seen == 1)} that moved"
    any_of = ChannelGroup("", stream, labels, labels, common=("#",), how="by their place")
    positions, velocities = (tuple(names[k] for k in some[:n]) for some in (found.positions, found.velocities))
    why = f"since other columns are their rate of change{seen}"
    groups = [
        replace(any_of, quantity="position", columns=positions, how=why, guessed=found.seen < n),
        replace(any_of, quantity="velocity", columns=velocities, how="since they are their rate of change"),
    ]
    free = [k for k in range(len(names)) if k > max(found.velocities) and k != clock]
    for first in range(0, len(free) - n + 1, n):
        groups.append(replace(any_of, columns=tuple(names[k] for k in free[first : first + n])))
    return groups


_ALIKE = 0.95  # correlation
_MOST_ROWS = 20_000
_WIDTH = 10  # rows over which a rate of change is taken


@dataclass(frozen=True)
class MotionColumns:
    """Columns of positions, and those of their velocities, 0 for the first."""

    positions: tuple[int, ...]
    velocities: tuple[int, ...]
    seen: int  # of how many joints the motion shows it


def motion_columns(time: Array, values: Array, clock: int) -> MotionColumns | None:
    """Positions and velocities that stand beside each other; None if no column is the rate of change of another."""
    # time (N,); values (N, c)
    some = slice(None, None, max(1, time.size // _MOST_ROWS))
    pairs = _pairs(time[some], values[some], clock)
    if not pairs:
        return None
    apart = [b - a for a, b in pairs]
    offset = max(set(apart), key=apart.count)
    rates = {b for a, b in pairs if b - a == offset}  # of change, whose own is an acceleration
    starts = [a for a, b in pairs if b - a == offset and a not in rates]
    if not starts:
        return None
    first = min(starts)
    if offset == 1:  # q1, dq1, q2, dq2, ...: every second or third column
        stride = min(np.diff(starts), default=2)
        block = tuple(range(first, max(starts) + 1, int(stride)))
    elif max(starts) - first < offset:
        lowest = max(clock + 1 if clock < first else 0, max(starts) - offset + 1)
        begin = lowest if lowest <= first else first
        block = tuple(range(begin, min(begin + offset, values.shape[1] - offset)))
    else:
        block = tuple(sorted(set(starts)))
    return MotionColumns(block, tuple(k + offset for k in block), len(set(starts).intersection(block)))


def _pairs(time: Array, values: Array, clock: int) -> list[tuple[int, int]]:
    """Columns of which the second is the rate of change of the first."""
    area = np.zeros_like(values)
    area[1:] = np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time)[:, None], axis=0)
    moved = _unit(values[_WIDTH:] - values[:-_WIDTH])
    integral = _unit(area[_WIDTH:] - area[:-_WIDTH])
    alike = np.abs(moved.T @ integral)  # (positions, velocities)
    alike[clock] = alike[:, clock] = 0.0
    np.fill_diagonal(alike, 0.0)
    best = [(int(a), int(np.argmax(alike[a]))) for a in range(values.shape[1]) if alike[a].max() > _ALIKE]
    return [(a, b) for a, b in best if int(np.argmax(alike[:, b])) == a]


def _unit(values: Array) -> Array:
    values = values - values.mean(axis=0)
    size = np.linalg.norm(values, axis=0)
    return np.asarray(np.divide(values, size, out=np.zeros_like(values), where=size > 1e-9 * max(1.0, size.max())))
