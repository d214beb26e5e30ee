"""Assignment of the columns of a file to the channels of a log."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from excite.logs.log import WRENCH
from excite.storage.sampled_motion import header_names
from regressors.errors import InputError, check_names, listed_names, shortened
from regressors.samples import Array

CHANNELS = {
    "q": "position", "dq": "velocity", "effort": "effort", "temperature": "temperature", "command": "command",
}  # fmt: skip
_SHOWN = 8
MOST_COLUMNS = 10_000
ROWS = -1  # in place of a column of the time: the number of the row
QUOTE = '"'
_PREFACE = 100  # lines that are searched for the header


class ForeignHeader(InputError):
    """The header of a table is not that of the house format."""


@dataclass(frozen=True, eq=False)
class Channel:
    """Columns of one channel: ``value = scale (cell - zero)``."""

    columns: tuple[int, ...]  # 0 for the first column of the file
    scale: Array  # (k,) SI unit per unit of the cell
    zero: Array  # (k,) reading at zero [unit of the cell]


@dataclass(frozen=True, eq=False)
class Layout:
    """Layout of the columns and lines of a file."""

    separator: str | None  # between two cells; None for any white space
    first: int  # number of lines before the first row
    names: tuple[str, ...]  # all columns, for messages
    time: int  # column of the time, or `ROWS`
    second: float  # seconds per unit of the time column, or per row
    joints: tuple[str, ...]
    # by the names of `excite.logs.log.Log`: ``q``, ``dq``, ``effort``, ``temperature``, ``command``, ``wrench``
    channels: dict[str, Channel]
    preface: int = 0  # lines before the header that were found to be something else
    nanoseconds: int | None = None  # column of those in the whole seconds of the time

    @property
    def used(self) -> tuple[int, ...]:
        """Columns that are read, in the order of the file."""
        own = {self.time, *(k for channel in self.channels.values() for k in channel.columns)} - {ROWS}
        return tuple(sorted(own if self.nanoseconds is None else own | {self.nanoseconds}))

    @property
    def unused(self) -> tuple[str, ...]:
        """Names of the columns that are not read."""
        used = set(self.used)
        return tuple(name for k, name in enumerate(self.names) if k not in used and name)


def cells(line: str, separator: str | None) -> list[str]:
    """Cells of a line, without white space and quotation marks around them."""
    if separator and QUOTE in line:  # a cell in quotation marks may hold separators
        with suppress(csv.Error):
            return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True))]
    return [cell.strip().strip(QUOTE) for cell in line.split(separator)]


def checked_head(source: str, head: list[str]) -> list[str]:
    """Cells of the line that says how many columns there are."""
    if len(head) > MOST_COLUMNS:
        raise InputError(f"{source} has {len(head)} columns, more than the {MOST_COLUMNS} that a log may have")
    return head


def header_line(lines: Sequence[str]) -> int:
    """Line with the names of the columns, 0 for the first, which it is where no other one can be."""
    for k, line in enumerate(lines[:_PREFACE]):
        names = header_names(line) if "time" in line else []
        if "time" in names and any(name.endswith(".position") for name in names):
            return k
    return 0


def house_layout(
    source: str, names: list[str], joints: Sequence[str] | None, preface: int = 0, passive: Sequence[str] = ()
) -> Layout:
    """Layout by the column names ``time``, ``NAME.position``, ``NAME.velocity``, ..., ``wrench.force.x``.

    A column ``temperature`` without a joint's name applies to all joints. A passive joint whose torque has no column
    has none: zero times the time.
    """
    _check_header(source, checked_head(source, names))
    index = {name: k for k, name in enumerate(names)}
    recorded = [name.removesuffix(".position") for name in names if name.endswith(".position")]
    if not recorded:
        raise ForeignHeader(f"{source}: no column NAME.position; columns: {listed(names)}")
    check_names(f"joint in {source}", joints or (), recorded)
    wanted = tuple(recorded if joints is None else joints)
    named = {channel: [f"{name}.{suffix}" for name in wanted] for channel, suffix in CHANNELS.items()}
    if "temperature" in index and index.keys().isdisjoint(named["temperature"]):
        named["temperature"] = ["temperature"] * len(wanted)  # one for all joints
    named["wrench"] = [f"wrench.{part}" for part in WRENCH]
    silent = [name for name in named["effort"] if name not in index and name.removesuffix(".effort") in passive]
    named["effort"] = [name for name in named["effort"] if name not in silent]
    there = {channel: _all_or_none(source, columns, index) for channel, columns in named.items()}
    channels = {channel: si_channel([index[name] for name in columns]) for channel, columns in there.items() if columns}
    if silent and "effort" in channels:
        torques = [f"{name}.effort" for name in wanted]
        scale = np.array([0.0 if name in silent else 1.0 for name in torques])
        columns = tuple(index.get(name, index["time"]) for name in torques)
        channels["effort"] = Channel(columns, scale, np.zeros(len(columns)))
    return Layout(",", preface + 1, tuple(names), index["time"], 1.0, wanted, channels, preface)


def columns_by_name(
    source: str, time: Array, channels: Mapping[str, Array | None], joints: Sequence[str]
) -> dict[str, Array]:
    """Columns of the channels of a log by their names in a file."""
    known = {name: values for name, values in channels.items() if values is not None}
    for name, values in known.items():
        what, count = ("component", len(WRENCH)) if name == "wrench" else (f"joint ({listed(joints)})", len(joints))
        if values.shape != (expected := (time.size, count)):
            why = f"a row for each time, and a column for each {what}"
            turned = "; transpose it" * (values.T.shape == expected)
            raise InputError(f"{source}: {name} has shape {values.shape}, expected {expected}: {why}{turned}")
    columns = {"time": time}
    for k, joint in enumerate(joints):
        columns |= {f"{joint}.{suffix}": known[name][:, k] for name, suffix in CHANNELS.items() if name in known}
    if "wrench" in known:
        columns |= {f"wrench.{part}": values for part, values in zip(WRENCH, known["wrench"].T, strict=True)}
    return columns


def si_channel(columns: Sequence[int]) -> Channel:
    """Channel whose cells are in SI."""
    return Channel(tuple(columns), np.ones(len(columns)), np.zeros(len(columns)))


def twice(names: Sequence[str]) -> str | None:
    """First name that occurs twice, None if there is none."""
    return next((name for name, count in Counter(names).items() if name and count > 1), None)


def listed(names: Sequence[str]) -> str:
    """Names in a message, the last of many left out."""
    return listed_names(names, _SHOWN)


def number(cell: str) -> float:
    """Number in a cell, with a point or a comma; of a date with its time (ISO 8601) seconds since 1970."""
    try:
        return float(cell.replace(",", "."))
    except ValueError:
        if ":" not in cell:
            raise
    moment = datetime.fromisoformat(cell)
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def is_number(cell: str) -> bool:
    """Whether a cell holds a number, NaN and infinities among them, or a date with its time."""
    try:
        number(cell)
    except (ValueError, OverflowError):
        return False
    return "_" not in cell


def _check_header(source: str, names: list[str]) -> None:
    there = [is_number(name) for name in names if name]
    if 2 * sum(there) >= len(there):  # beside words, as of a frame or of joints
        raise ForeignHeader(
            f"{source}: line 1 holds numbers, expected a header; give a mapping with header: false and the columns"
        )
    if (name := twice(names)) is not None:
        raise InputError(f"{source}: two columns are named {shortened(name)}")
    if "time" in names:
        return
    other = next((mark for mark in (";", "\t") if len(names) == 1 and mark in names[0]), None)
    hint = "" if other is None else f"; the cells seem to be separated by {other!r}; give a mapping with that separator"
    raise ForeignHeader(f"{source}: no column 'time'; columns: {listed(names)}{hint}")


def _all_or_none(source: str, columns: list[str], index: dict[str, int]) -> list[str]:
    missing = [name for name in columns if name not in index]
    if missing and len(missing) < len(columns):
        there = [name for name in columns if name in index]
        one = "; give one column 'temperature' for all joints, or one each"
        hint = one if there[0].endswith(".temperature") else ""
        raise InputError(f"{source}: the log has the columns {listed(there)}, but not {listed(missing)}{hint}")
    return [] if missing else columns
