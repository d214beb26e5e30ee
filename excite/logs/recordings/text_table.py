"""Tables of numbers in text: CSV, with other separators, or columns of a fixed width; cells may be empty.

The layout is found from the lines. The columns of some programs are defined by them:

- Universal Robots, Real-Time Data Exchange (RTDE) Guide, table of the outputs of the controller: ``timestamp`` [s],
  ``actual_q`` [rad], ``actual_qd`` [rad/s], ``actual_current`` [A], ``joint_temperatures`` [deg C], and since PolyScope
  5.23 ``actual_current_as_torque`` [Nm]; the clients of the RTDE number the elements of a vector, ``actual_q_0``.
- libfranka, ``franka::logToCSV``: ``time`` [ms], ``state.q[0]`` [rad], ``state.dq[0]`` [rad/s], and ``state.tau_J[0]``
  [Nm], measured torques on the side of the links.
- The house format, see `excite.logs.log_reading.read_log`.
- sage (github.com/isaac-sim2real/sage), a folder of ``control.csv`` and ``state_motor.csv``: ``timestamp`` [us], and
  lists of a number for each joint, commanded ``positions`` in the first, in the second measured ``positions`` [rad],
  ``velocities`` [rad/s] and ``torques``.
- PlotJuggler, CSV exporter: ``__time`` [s]; topics keep their names, those of ``sensor_msgs/JointState`` as
  ``/TOPIC/JOINT/position`` [rad], ``velocity`` [rad/s], ``effort`` [Nm].
"""

from __future__ import annotations

import csv
import json
import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np

from excite.logs.layout import CHANNELS, MOST_COLUMNS, Layout, cells, is_number, listed, si_channel, twice
from excite.logs.log import counted
from excite.logs.recordings.recording import (
    JOINT_STATE,
    LARGEST_ARRAY,
    SAGE,
    SI_UNITS,
    Contents,
    Meaning,
    Numbers,
    Recording,
    RecordingFormat,
    Stream,
    StreamContents,
    Wanted,
    check_table,
    check_wanted,
    head_of,
)
from excite.logs.table import TextTable
from excite.logs.text import Text, text_of
from regressors.errors import InputError

TABLE = "table"  # the one stream
_KINDS = {",": "CSV", ";": "CSV with semicolons", "\t": "separated by tabs", None: "separated by white space"}
_NAMES: Mapping[str | None, str] = {None: "whitespace", "\t": "tab"}  # of separators, in a mapping
_GLANCED = 50_000  # rows: text is slow to read, and the log is read next
_SEARCHED = 160  # lines
_ROWS = 20  # of numbers, by which a separator is judged


def _is_text(head: bytes, path: Path) -> bool:
    """Whether it may be a text: it has no zero byte."""
    with suppress(UnicodeDecodeError):
        head[: max(1, len(head) - 4)].decode("utf-8")
        return bool(head) and b"\0" not in head
    return False


def _contents(path: Path) -> Contents:
    """Columns and number of rows."""
    with text_of(path) as text:
        layout = _table_layout(text)
        maker = maker_of(layout.titles)
        titles = dict(zip(layout.names, layout.titles, strict=True))
        units = {name: unit for name, unit in zip(layout.names, layout.units, strict=True) if unit}
        columns = _number_columns(text, layout)
        known = _joint_states(text, layout)
        table = StreamContents(TABLE, columns, len(text.lines) - layout.first, (), known, units, titles)
        if maker is not None and maker.clock in columns:
            units, meanings = {**units, maker.clock: maker.unit}, maker.meanings(columns)
            table = replace(table, clocks=(maker.clock,), units=units, meanings=meanings)
        return Contents(text.source, _kind_of(layout), (table,), text.mended)


def _mapping_fields(path: Path) -> Mapping[str, object]:
    """Separator, header and lines before the table."""
    with text_of(path) as text:
        layout = _table_layout(text)
    skip = layout.first if layout.header is None else layout.header
    separator = _NAMES.get(layout.separator, layout.separator)
    return {"separator": separator, "header": layout.header is not None, "skip": skip}


def _read(path: Path, wanted: Wanted, most: int | None = None) -> Recording:
    with text_of(path) as text:
        found = _table_layout(text)
        place = {name: found.names.index(name) for name in wanted.get(TABLE, ())}
        used = sorted(place.values()) or [0]
        shown = tuple(title or name for title, name in zip(found.titles, found.names, strict=True))
        layout = Layout(found.separator, found.first, shown, used[0], 1.0, (), {"columns": si_channel(used)})
        rows = len(text.lines) - found.first
        only = None if most is None or rows <= most else (1, most)
        table = TextTable(text, layout, frozenset({"truncated"}), only)
        values = {name: table.values[:, used.index(k)] for name, k in place.items()}
        notes = (*text.mended, *table.left_out)
        return Recording(text.source, _kind_of(found), {TABLE: Stream(TABLE, values)}, notes)


def _table_layout(text: Text) -> TextLayout:
    """Layout of the table in a text."""
    if (layout := text_layout(text.lines)) is None:
        raise InputError(f"{text.source} holds no table of numbers; it begins with {listed(list(text.lines[:2]))}")
    return layout


def _number_columns(text: Text, layout: TextLayout) -> tuple[str, ...]:
    """Names of the columns that hold numbers, in most of the first rows; others hold words, such as states."""
    rows = [cells(line, layout.separator) for line in islice(text.lines[layout.first :], _ROWS)]
    columns = zip(*(row for row in rows if len(row) == len(layout.names)), strict=True)
    return tuple(name for name, column in zip(layout.names, columns, strict=True) if 2 * _words(column) < len(column))


_ELEMENT = r"(?:.*[./])?({})[\[_]?(\d*)\]?"  # of an array of a message
_OF_JOINTS = ["position", "velocity", "effort"]


def _joint_states(text: Text, layout: TextLayout) -> dict[str, Meaning]:
    """What columns are beside the names of joints, in messages of ``sensor_msgs/JointState`` that were printed as text.

    Programs call them ``field.position0``, ``position_0`` or ``position[0]``; ``ros2 topic echo --csv`` prints seconds,
    nanoseconds, the frame, and all names, positions, velocities and efforts, without a header.
    """
    rows = [cells(line, layout.separator) for line in islice(text.lines[layout.first :], _ROWS)]
    titles = layout.titles
    if not any(titles) and (n := (len(titles) - 3) // 4) and len(titles) == 3 + 4 * n:
        titles = ("", "", "", *(f"{of}_{k}" for of in ("name", *_OF_JOINTS) for k in range(n)))
    joints = dict[int, str]()
    for title, *column in zip(titles, *rows, strict=False):
        if (match := re.fullmatch(_ELEMENT.format("name"), title)) and len(set(column)) == 1 and _words(column):
            some = [column[0]] if match[2] else re.findall(r"[^\s,'\[\]()]+", column[0])
            joints.update(enumerate(some, int(match[2] or 0)))
    pattern = _ELEMENT.format("|".join(_OF_JOINTS))
    found = [(name, re.fullmatch(pattern, title)) for name, title in zip(layout.names, titles, strict=True)]
    elements = [(name, match[1], int(match[2])) for name, match in found if match and match[2]]
    if not {k for _, _, k in elements} <= joints.keys() or len(set(joints.values())) < len(joints):
        return {}
    return {name: Meaning(of, joints[k], SI_UNITS[of], JOINT_STATE) for name, of, k in elements}


def _kind_of(layout: TextLayout) -> str:
    """Name of the format, by the names of the columns."""
    maker = maker_of(layout.titles)
    return f"{'text' if maker is None else maker.name}, {_KINDS[layout.separator]}"


@dataclass(frozen=True)
class TextLayout:
    """Where a table is in a text."""

    separator: str | None  # between two cells; None for any white space
    first: int  # lines before the first row of numbers
    names: tuple[str, ...]  # of the columns; numbers from 1 where there is no header that names each once
    titles: tuple[str, ...]  # what stands above the columns, for whoever guesses what they are, or empty strings
    units: tuple[str, ...]  # what a row of units above the columns says, or empty strings
    header: int | None  # line of the header, 0 for the first; None where columns have numbers


def text_layout(lines: Sequence[str]) -> TextLayout | None:
    """Layout of the table in a text; None where there is none."""
    head = list(islice(lines, _SEARCHED))
    tables = [table for mark in _KINDS if (table := _table(head, mark)) is not None]
    if not tables:
        return None
    mark, first, count = max(tables, key=lambda table: table[2] - 2 * _words(cells(head[table[1]], table[0])))
    return _with_names(head, mark, first, count)


def _table(head: Sequence[str], mark: str | None) -> tuple[str | None, int, int] | None:
    """Separator, first row and number of columns of the rows of numbers that a separator makes."""
    rows = [cells(line, mark) for line in head]
    for first, row in enumerate(rows):
        some = rows[first : first + _ROWS]
        alike = sum(_is_row(other) and len(other) == len(row) for other in some)
        if _is_row(row) and alike >= 0.8 * len(some) and len(some) >= 2:
            return (mark, first, len(row)) if len(row) <= MOST_COLUMNS else None
    return None


def _is_row(row: Sequence[str]) -> bool:
    """Whether more cells hold numbers than words."""
    return 2 * _words(row) < sum(map(bool, row))


def _words(row: Sequence[str]) -> int:
    """How many cells hold neither a number nor nothing."""
    return sum(not is_number(cell) for cell in row if cell)


def _with_names(head: Sequence[str], mark: str | None, first: int, count: int) -> TextLayout:
    blank = ("",) * count
    titles, units, at = blank, blank, None
    above = [_title_cells(line, mark, count) for line in head[max(0, first - 2) : first]]
    if above and (last := above[-1]) is not None:
        titles, at = last, first - 1
        if len(above) == 2 and above[0] is not None and all(map(_is_unit, last)):
            titles, units, at = above[0], last, None
    names = () if at is None else tuple(cells(head[at], mark))
    if len(names) != count or not all(titles) or twice(titles) is not None:
        names, at = tuple(f"{k}" for k in range(1, count + 1)), None
    return TextLayout(mark, first, names, titles, units, at)


def _title_cells(line: str, mark: str | None, count: int) -> tuple[str, ...] | None:
    """Cells of a line that may name the columns, with or without a sign of a comment before them."""
    for text in (line, line.lstrip("#% \t")):
        row = cells(text, mark)
        if len(row) == count and sum(map(is_number, filter(None, row))) < 0.5 * count and any(row):
            return tuple(cell.removeprefix("#").strip() for cell in row)
    return None


def _is_unit(cell: str) -> bool:
    """Whether a cell of a second line of header may be a unit: short, of letters and the signs of units."""
    text = cell.strip("[]() ")
    return len(text) <= 8 and not any(mark.isdigit() and mark not in "2" for mark in text) and "_" not in text


@dataclass(frozen=True)
class TextMaker:
    """A program that writes tables."""

    name: str
    marks: frozenset[str]  # columns by which its tables are recognised
    clock: str  # column of the time
    columns: Mapping[str, str]  # pattern of the names of each quantity, whose group is the joint
    why: str  # source of the definitions
    unit: str = "s"  # of the time

    def meanings(self, names: Sequence[str]) -> dict[str, Meaning]:
        """What the columns of a table are, of those that are defined."""
        meanings = {}
        for name in names:
            for quantity, pattern in self.columns.items():
                if match := re.fullmatch(pattern, name):
                    meanings[name] = Meaning(quantity, match[1], SI_UNITS[quantity], self.why)
        return meanings


MAKERS = (
    TextMaker(
        "Universal Robots RTDE recording",
        frozenset({"timestamp", "actual_q_0"}),
        "timestamp",
        {
            "position": r"actual_q_(\d)",
            "velocity": r"actual_qd_(\d)",
            "current": r"actual_current_(\d)",
            "effort": r"actual_current_as_torque_(\d)",
            "temperature": r"joint_temperatures_(\d)",
        },
        "RTDE Guide of Universal Robots",
    ),
    TextMaker(
        "libfranka log",
        frozenset({"time", "success_rate", "state.q[0]"}),
        "time",
        {"position": r"state\.q\[(\d)\]", "velocity": r"state\.dq\[(\d)\]", "effort": r"state\.tau_J\[(\d)\]"},
        "franka::logToCSV",
        "ms",
    ),
    TextMaker(
        "PlotJuggler",
        frozenset({"__time"}),
        "__time",
        {quantity: rf"/(?:.*/)?joint_states/([^/]+)/{quantity}" for quantity in ("position", "velocity", "effort")},
        JOINT_STATE,
    ),
)

HOUSE = TextMaker(
    "excite log",
    frozenset({"time"}),
    "time",
    {
        "wrench": r"wrench\.((?:force|torque)\.[xyz])",
        **{quantity: rf"(.+)\.{quantity}" for quantity in CHANNELS.values()},
    },
    "the house format",
)


def maker_of(titles: Sequence[str]) -> TextMaker | None:
    """Program that writes a table with these columns, None if it is unknown."""
    there = set(titles)
    if there >= HOUSE.marks and any(title.endswith(".position") for title in titles):
        return HOUSE
    return next((maker for maker in MAKERS if there >= maker.marks), None)


TEXT = RecordingFormat("text", _is_text, _contents, _read, partial(_read, most=_GLANCED), _mapping_fields)

_SERVO_FILES = {"control": "CONTROL", "state_motor": "STATE_MOTOR"}  # types of the rows by the names of the files
_SERVO_LISTS = {
    "control/positions": "command", "state_motor/positions": "position", "state_motor/velocities": "velocity",
    "state_motor/torques": "effort",
}  # fmt: skip
_LIST_COPIES = 6.0  # lists of numbers take as much more memory than an array of them
_FAULTS = {  # by the kinds of rows to drop
    "truncated": "cut off at the end",
    "garbage": "without a list of {} numbers in each cell",
    "nan": "with numbers that are NaN or infinite",
}


def _is_servo_folder(head: bytes, path: Path) -> bool:
    """Whether it holds a file of commands and one of what was measured."""
    files = [path / f"{name}.csv" for name in _SERVO_FILES]
    return path.is_dir() and all(each.is_file() and head_of(each).startswith(b"type,timestamp,pos") for each in files)


def _servos(path: Path, drop: Collection[str] = _FAULTS) -> tuple[Contents, dict[str, Numbers]]:
    """Contents and columns of a folder; faulty rows that are not to be dropped are refused."""
    columns, streams, notes, joints = dict[str, Numbers](), list[StreamContents](), list[str](), set[str]()
    for stem, kind in _SERVO_FILES.items():
        (clock, time), *lists = _servo_columns(path / f"{stem}.csv", kind, drop, notes).items()
        meanings, last = {}, ""
        for name, _ in lists:
            title, _, last = name.removesuffix("]").rpartition("[")
            if (quantity := _SERVO_LISTS.get(title)) is not None:
                meanings[name] = Meaning(quantity, f"{int(last) + 1}", SI_UNITS[quantity], SAGE)
        efforts = [name for name, meaning in meanings.items() if meaning.quantity == "effort"]
        if efforts and all(np.all(values >= 0) for name, values in lists if name in efforts):
            notes.append("efforts are magnitudes, never negative: not used")
            meanings = {name: meaning for name, meaning in meanings.items() if name not in efforts}
        columns |= {clock: time, **dict(lists)}
        streams.append(StreamContents(stem, (clock, *meanings), time.size, (clock,), meanings, {clock: "us"}))
        joints.add(last)
    if len(joints) > 1:
        what = "control.csv and state_motor.csv have lists of different lengths"
        raise InputError(f"{path}: {what}; expected one number for each joint in both")
    form = "folder of sage: commands and states of servos"
    return Contents(str(path), form, tuple(streams), tuple(notes)), columns


def _servo_columns(path: Path, kind: str, drop: Collection[str], notes: list[str]) -> dict[str, Numbers]:
    """Time stamps, and a column for each joint of each list."""
    names, rows, faults, others = _servo_rows(path, kind)
    lengths = Counter(len(lists[1]) for lists in rows.values())
    joints = max(lengths, key=lambda length: lengths[length], default=0)
    if not 0 < joints <= LARGEST_ARRAY:
        raise InputError(f"{path}: expected rows of the type {kind}, with lists of a number for each joint")
    shape, values = [1, *(joints for _ in names[1:])], list[list[float]]()
    for line, lists in rows.items():
        row = [x for each in lists for x in each]
        if (whole := list(map(len, lists)) == shape) and np.isfinite(row).all():
            values.append(row)
        else:
            faults[line] = "nan" if whole else "garbage"
    counts = Counter(faults.values())
    for line, fault in sorted(faults.items()):
        if fault not in drop:
            like = f"{counted(counts[fault], 'row')} like this (`drop='{fault}'` leaves them out)"
            raise InputError(f"{path}, line {line}: a row {_FAULTS[fault].format(joints)}; {like}")
    notes += [f"{counted(n, 'row')} of {path.name} {_FAULTS[f].format(joints)} left out" for f, n in counts.items()]
    notes += [f"{counted(others, 'row')} of {path.name} of another type left out"] * bool(others)
    titles = [f"{path.stem}/{names[0]}", *(f"{path.stem}/{name}[{k}]" for name in names[1:] for k in range(joints))]
    return dict(zip(titles, np.array(values).reshape(-1, len(titles)).T.copy(), strict=True))


def _servo_rows(path: Path, kind: str) -> tuple[list[str], dict[int, list[list[float]]], dict[int, str], int]:
    """Names of the lists, lists and faults by their lines, and how many rows are of another type."""
    rows, faults, others = dict[int, list[list[float]]](), dict[int, str](), 0
    with text_of(path) as text:
        names = cells(text.lines[0], ",")[1:]
        check_table(path, len(text.lines), max(line.count(",") for line in islice(text.lines, 2)), _LIST_COPIES)
        for line, row in enumerate(text.lines[1:], 2):
            if not f"{kind},".startswith(row[: len(kind) + 1]):  # a row that was cut off may have a part of it
                others += 1
                continue
            try:
                _, stamp, first, *further = next(csv.reader([row]))
                lists = (json.loads(cell) for cell in (first, *further))
                rows[line] = [[float(stamp)], *([float("nan" if x is None else x) for x in each] for each in lists)]
            except (ValueError, TypeError, OverflowError, RecursionError, csv.Error):
                faults[line] = "truncated" if line == len(text.lines) else "garbage"
    return names, rows, faults, others


def _read_servos(path: Path, wanted: Wanted) -> Recording:
    contents, columns = _servos(path)
    check_wanted(path, wanted, {stream.name: stream.columns for stream in contents.streams})
    streams = {stream: Stream(stream, {name: columns[name] for name in names}) for stream, names in wanted.items()}
    return Recording(str(path), contents.format, streams, contents.notes)


SERVOS = RecordingFormat("folder of sage", _is_servo_folder, lambda path: _servos(path)[0], _read_servos, check=_servos)
