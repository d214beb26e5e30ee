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
    """What a column is by the definition of its format, so that nobody needs to guess.

    Parameters
    ----------
    quantity : str
        ``position``, ``velocity``, ``effort``, ``current``, ``temperature`` or ``wrench``.
    of : str
        Joint, or component of the wrench of `excite.logs.log.WRENCH`.
    unit : str
        One that the sections of `excite.logs.mapping.LogMapping` know, such as ``rad``.
    why : str
        Source of the definition, such as ``sensor_msgs/JointState``.
    """

    quantity: str
    of: str
    unit: str
    why: str


@dataclass(frozen=True, eq=False)
class StreamContents:
    """What is known of a stream without loading its rows.

    Parameters
    ----------
    name : str
        Of the topic, table or group.
    columns : tuple of str
        Flattened names, each once in a recording, but for clocks that several streams share.
    rows : int or None
        Where it is known.
    clocks : tuple of str
        Those of the columns that say when a row was taken, the preferred one first; empty where the format does not
        tell.
    meanings : mapping of str to Meaning
        Of the columns that the format defines.
    units : mapping of str to str
        Units that the file itself states, literally, by column; of clocks those of
        `excite.logs.mapping_sections.TimeSection`.
    titles : mapping of str to str
        What the file calls columns that the mapping knows by another name, such as a number.
    """

    name: str
    columns: tuple[str, ...]
    rows: int | None = None
    clocks: tuple[str, ...] = ()
    meanings: Mapping[str, Meaning] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
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
    """Rows of a stream.

    Parameters
    ----------
    name : str
    columns : mapping of str to ndarray, shape (N,)
        Numbers in the units of the file; NaN where a row has none. Clocks of whole nanoseconds stay integers, since
        their differences are needed to more digits than a float of them has.
    """

    name: str
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
