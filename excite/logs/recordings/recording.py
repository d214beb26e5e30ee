"""Recordings: streams of columns, the interface of their formats, its guards, and what names of columns say.

Every format predicts the memory of what a file declares before it is read, and turns what its library raises into one
line.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from excite.logs.text import log_opened
from regressors.errors import ExciteError, InputError, cut, listed_names, one_line
from regressors.work_prediction import FLOAT, check_memory

HEAD = 4096  # bytes by which a file is recognised
LARGEST_ARRAY = 100  # elements of one row; what has more, such as an image, is no measurement of joints
JOINT_STATE = "sensor_msgs/JointState"
SAGE = "sage"  # whose lists have a number for each joint, from the base on
SI_UNITS = {
    "position": "rad", "velocity": "rad/s", "effort": "Nm", "current": "A", "temperature": "degC", "wrench": "N",
    "command": "rad",
}  # fmt: skip
Numbers = NDArray[np.floating[Any] | np.integer[Any]]
_COPIES = 2.0  # what was read, and what it becomes
_REASON = 120  # characters of what a library says
_PACKAGES = {"ros": "rosbags", "hdf5": "h5py", "matlab": "h5py", "parquet": "pyarrow"}  # of each extra


@dataclass(frozen=True)
class Meaning:
    """What a column is by the definition of its format, so that nobody needs to guess."""

    quantity: str  # position, velocity, effort, current, temperature, wrench or command
    of: str  # joint, or component of the wrench of excite.logs.log.WRENCH
    unit: str  # one that the sections of excite.logs.mapping.LogMapping know, such as rad
    why: str  # source of the definition, such as sensor_msgs/JointState


@dataclass(frozen=True, eq=False)
class StreamContents:
    """What is known of a stream, such as a topic, a table or a group, without loading its rows."""

    name: str
    columns: tuple[str, ...]  # flattened names, each once in a recording, but for clocks that several streams share
    rows: int | None = None  # where it is known
    clocks: tuple[str, ...] = ()  # columns that say when a row was taken, the preferred one first
    meanings: Mapping[str, Meaning] = field(default_factory=dict)  # of the columns that the format defines
    units: Mapping[str, str] = field(default_factory=dict)  # that the file states, literally; of clocks TimeSection's
    titles: Mapping[str, str] = field(default_factory=dict)  # what the file calls columns that a mapping names else

    def title(self, column: str) -> str:
        """What the file calls a column."""
        return self.titles.get(column, column)


@dataclass(frozen=True, eq=False)
class Contents:
    """What is inside a recording: a file or folder."""

    source: str  # for messages
    format: str  # with its version where it is known
    streams: tuple[StreamContents, ...]
    notes: tuple[str, ...] = ()  # what a user should know, such as topics that cannot be read

    @property
    def columns(self) -> tuple[str, ...]:
        """All columns, each once."""
        return tuple(dict.fromkeys(name for stream in self.streams for name in stream.columns))


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


Wanted: TypeAlias = Mapping[str, Sequence[str]]  # columns by the names of their streams


@dataclass(frozen=True)
class RecordingFormat:
    """A format of recordings; a new one is one of these, and its line in `excite.logs.recordings.formats`.

    One of named arrays is made by `excite.logs.recordings.array_streams.array_format`, one of messages of ROS by
    `excite.logs.recordings.bags.bag_format`.
    """

    name: str
    # whether a file or folder is of this format, by its content and not by its name: by its first bytes, and its path
    recognises: Callable[[bytes, Path], bool]
    contents: Callable[[Path], Contents]  # what is inside, without loading all of it
    read: Callable[[Path, Wanted], Recording]  # some columns
    glance: Callable[[Path, Wanted], Recording] | None = None  # of as many rows as show what they are; else of all
    # fields of `excite.logs.mapping.LogMapping` that say how such a file is laid out; none for most formats
    mapping_fields: Callable[[Path], Mapping[str, object]] = lambda _: {}
    # refuses faulty rows of a file, all of which `read` leaves out, but for the kinds that are to be dropped
    check: Callable[[Path, frozenset[str]], object] = lambda *_: None


def check_table(source: Path, rows: float, columns: float, copies: float = _COPIES) -> None:
    """Refuse a table that takes more memory than it may; ``copies`` of each number are held at the same time."""
    what, remedy = f"{rows:.3g} rows of {columns:.3g} numbers", "cut the recording, or map fewer columns"
    check_memory(f"reading {source}", FLOAT * copies * rows * columns, what, remedy)


def check_wanted(source: Path, wanted: Wanted, streams: Mapping[str, Collection[str]]) -> None:
    """Refuse streams, or columns of these, that a recording does not have."""
    for name, columns in wanted.items():
        for one, known in ((name, streams), *((column, streams.get(name, ())) for column in columns)):
            if one not in known:
                raise InputError(f"{source} has no {cut(one)}; it has {listed_names(known)}")


def left_out_note(left_out: Mapping[str, str]) -> tuple[str, ...]:
    """Note on what is not read, with the reasons; none where nothing is left out."""
    listed = "; ".join(f"{cut(name)} {why}" for name, why in list(left_out.items())[:5])
    more = f"; and {len(left_out) - 5} more" if len(left_out) > 5 else ""
    return (f"left out: {listed}{more}",) * bool(left_out)


def head_of(path: Path) -> bytes:
    """First bytes of a file; empty for a folder."""
    if path.is_dir():
        return b""
    with log_opened(path) as stream:
        return stream.read(HEAD)


def check_bytes(source: Path, size: float) -> None:
    """Refuse to unpack more bytes than may be held in memory."""
    check_table(source, size / FLOAT, 1.0, copies=1.0)


def numbers_of(values: NDArray[Any]) -> Numbers:
    """Whole numbers as they are, since they may be clocks, and all others as floats."""
    kind, largest = values.dtype.kind, np.iinfo(np.int64).max
    whole = kind == "i" or (kind == "u" and (values.dtype.itemsize < 8 or not np.any(values > largest)))
    return np.ascontiguousarray(values, dtype=np.int64 if whole else float)


def optional_package(module: str, extra: str, source: Path | str) -> Any:
    """A module, such as ``pyarrow.parquet``, of a package that an extra of this distribution installs."""
    try:
        return import_module(module)
    except ImportError as error:
        raise InputError(f"{source} needs {_PACKAGES[extra]}: pip install 'excite-trajectories[{extra}]'") from error


@contextmanager
def foreign_reader(path: Path, form: str) -> Iterator[None]:
    """Turn whatever a library raises on a damaged file of a format into one line."""
    try:
        yield
    except (ExciteError, MemoryError):
        raise
    except Exception as error:  # each library has its own, and damaged files meet those of Python too
        said = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        reason = cut(one_line(said), _REASON) or type(error).__name__
        raise InputError(
            f"{path} cannot be read as {form}; it is damaged or was not written to its end: {reason}"
        ) from error


_WORDS: Mapping[str, str] = {
    "position": (
        "position positions pos q qs angle angles theta phi qpos jointpos jointposition jointpositions "
        "lage winkel istposition istwinkel"
    ),
    "velocity": (
        "velocity velocities vel dq qd qdot qvel dtheta thetadot omega speed speeds dqs qds jointvel "
        "geschwindigkeit istgeschwindigkeit drehzahl istdrehzahl"
    ),
    "effort": "effort efforts eff torque torques tau moment moments trq drehmoment istmoment",
    "current": "current currents cur i iq amps motorcurrent strom iststrom motorstrom",
    "temperature": "temperature temperatures temp temps temperatur",
    "time": "time times timestamp timestamps t stamp elapsed clock date datetime zeit datum zeitstempel",
}
_QUANTITY_OF = {word: quantity for quantity, words in _WORDS.items() for word in words.split()}
_REFERRED = (
    "target targets desired des d cmd command commanded commands reference ref goal setpoint error err errors "
    "feedforward ff ddq acc acceleration accelerations ddtheta qddot qdd ext external hat filtered limit limits tcp "
    "cartesian min max std computed cmptd calculated calc planned soll simulated sim"
)
_NOT_MEASURED = frozenset(_REFERRED.split())
_BRACKET = re.compile(r"[\[(]([^\])]*)[\])]\s*$")
_PART = re.compile(r"[A-Z]{2,}(?=[A-Z][a-z]|\d|\b|_)|[A-Z]?[a-z]+|[A-Z]+|\d+")
_DEGREE, _MICRO, _DOT = "\N{DEGREE SIGN}", "\N{MICRO SIGN}", "\N{MIDDLE DOT}"
_WRITTEN: Mapping[str, Mapping[str, str]] = {  # quantity, unit of the mapping: how else it is written, in lower case
    "position": {
        "rad": "radian radians", "deg": f"degree degrees grad {_DEGREE}", "ticks": "counts inc",
        "turns": "", "rev": "", "m": "", "mm": "",
    },
    "velocity": {
        "rad/s": "rad/sec rad_s radps rads", "deg/s": f"deg/sec deg_s degps dps grad/s {_DEGREE}/s",
        "rpm": "1/min u/min", "rev/s": "", "m/s": "", "mm/s": "",
    },
    "effort": {"Nm": f"n.m n*m n{_DOT}m", "mNm": "", "kNm": "", "N": "", "kN": ""},
    "current": {"A": "amp ampere", "mA": ""},
    "temperature": {"degC": f"celsius c {_DEGREE}c", "K": "", "degF": ""},
    "time": {"s": "sec secs seconds", "ms": "msec", "us": f"usec {_MICRO}s", "ns": "nsec nanosec"},
}  # fmt: skip
_KNOWN = {
    text: (quantity, unit)
    for quantity, units in _WRITTEN.items()
    for unit, others in units.items()
    for text in (unit.lower(), *others.split())
}
_NONE = ("", "")


@dataclass(frozen=True)
class ColumnName:
    """What a name says."""

    quantity: str  # time, position, velocity, effort, current or temperature; empty where it says nothing
    unit: str  # in the words of the mapping; empty where it says nothing
    label: tuple[str, ...]  # what is left of its words: a number or the name of a joint, and what stands before it
    measured: bool  # not of something desired, commanded or limited


def parsed_name(name: str, unit: str = "") -> ColumnName:
    """What the name of a column says, and the unit that the file states beside it, literally."""
    of, given = stated_unit(unit)
    if not given and (bracket := _BRACKET.search(name)):
        of, given = stated_unit(bracket[1])
        name = name[: bracket.start()] if given else name
    words = [part.lower() for part in _PART.findall(name)]
    if not given:
        words, (of, given) = _without_unit(words)
    place = next((k for k in reversed(range(len(words))) if words[k] in _QUANTITY_OF), None)
    quantity = "" if place is None else _QUANTITY_OF[words[place]]
    if not quantity or (quantity == "time" and of not in ("", "time")):
        quantity = of
    rest = tuple(word for k, word in enumerate(words) if k != place)
    fits = of == quantity
    return ColumnName(quantity, given if fits else "", rest, not _NOT_MEASURED.intersection(rest))


def _without_unit(words: list[str]) -> tuple[list[str], tuple[str, str]]:
    """Words without those of a unit at the end, as in ``pos_deg`` and ``vel_deg_s``, and that unit."""
    for count in (2, 1):
        unit = stated_unit("_".join(words[-count:]))
        if unit != _NONE and len(words) > count and len("".join(words[-count:])) > 1:
            return words[:-count], unit
    return words, _NONE


def is_clock(name: str, unit: str = "") -> bool:
    """Whether a name says that a column is a time."""
    parsed = parsed_name(name, unit)
    return parsed.quantity == "time" and not any(word.isdigit() for word in parsed.label)


def stated_unit(text: str) -> tuple[str, str]:
    """Quantity and unit that a text such as ``[deg/s]`` states; two empty strings for none."""
    return _KNOWN.get(text.strip().strip("[]()").strip().lower().replace("n m", "nm"), _NONE)
