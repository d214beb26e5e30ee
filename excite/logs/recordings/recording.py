"""What a recording holds: streams of columns, each stream with rows of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

JOINT_STATE = "sensor_msgs/JointState"
Numbers = NDArray[np.floating[Any] | np.integer[Any]]


@dataclass(frozen=True)
class Meaning:
    """What a column is by the definition of its format, so that nobody needs to guess."""

    quantity: str  # ``position``, ``velocity``, ``effort``, ``current``, ``temperature`` or ``wrench``
    of: str  # joint, or component of the wrench of `excite.logs.log.WRENCH`
    unit: str  # one that the sections of `excite.logs.mapping.LogMapping` know, such as ``rad``
    why: str  # source of the definition, such as ``sensor_msgs/JointState``


@dataclass(frozen=True, eq=False)
class StreamContents:
    """What is known of a stream without loading its rows."""

    name: str  # of the topic, table or group
    columns: tuple[str, ...]  # flattened names, each once in a recording, but for clocks that several streams share
    rows: int | None = None  # where it is known
    # those of the columns that say when a row was taken, the preferred one first; empty where the format does not
    # tell
    clocks: tuple[str, ...] = ()
    meanings: Mapping[str, Meaning] = field(default_factory=dict)  # of the columns that the format defines
    # units that the file itself states, literally, by column; of clocks those of
    # `excite.logs.mapping_sections.TimeSection`
    units: Mapping[str, str] = field(default_factory=dict)
    # what the file calls columns that the mapping knows by another name, such as a number
    titles: Mapping[str, str] = field(default_factory=dict)

    def title(self, column: str) -> str:
        """What the file calls a column."""
        return self.titles.get(column, column)


@dataclass(frozen=True, eq=False)
class Contents:
    """What is inside a recording.

    Parameters
    ----------
    source : str
        File or folder, for messages.
    format : str
        Name of the format, with its version where it is known.
    streams : tuple of StreamContents
    notes : tuple of str
        What a user should know, such as topics that cannot be read.
    """

    source: str
    format: str
    streams: tuple[StreamContents, ...]
    notes: tuple[str, ...] = ()

    @property
    def columns(self) -> tuple[str, ...]:
        """All columns, each once."""
        return tuple(dict.fromkeys(name for stream in self.streams for name in stream.columns))

    def streams_of(self, column: str) -> tuple[StreamContents, ...]:
        """Streams that have a column."""
        return tuple(stream for stream in self.streams if column in stream.columns)


@dataclass(frozen=True, eq=False)
class Stream:
    """Rows of a stream."""

    name: str
    # (N,) numbers in the units of the file; NaN where a row has none. Clocks of whole nanoseconds stay integers,
    # since their differences are needed to more digits than a float of them has
    columns: Mapping[str, Numbers]

    @property
    def rows(self) -> int:
        """Number of rows."""
        return next((values.size for values in self.columns.values()), 0)


@dataclass(frozen=True, eq=False)
class Recording:
    """Columns that were read.

    Parameters
    ----------
    source : str
        File or folder, for messages.
    format : str
    streams : mapping of str to Stream
        By their names.
    notes : tuple of str
        What was left out or repaired, each with its count.
    """

    source: str
    format: str
    streams: Mapping[str, Stream]
    notes: tuple[str, ...] = ()
