"""Folders with one file per signal: NumPy arrays (NPY) and texts of numbers, named after what they hold.

The columns are ``FILE/COLUMN``, or ``FILE`` where a file has one column, or ``FILE[0]`` ... where it has several
without names, with the name of the file without its ending. Files of as many rows, without a time of their own, are one
stream.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from excite.logs.recordings.array_streams import NPY
from excite.logs.recordings.column_name import is_clock
from excite.logs.recordings.recording import (
    Contents,
    Numbers,
    Recording,
    RecordingFormat,
    Stream,
    StreamContents,
    head_of,
)
from excite.logs.recordings.text_table import TextTable
from regressors.errors import InputError

_MOST_FILES = 1000


@dataclass(frozen=True)
class _Signals:
    """Columns of one file of a format that has one stream, by their names in the recording."""

    path: Path
    form: RecordingFormat
    stream: str
    rows: int
    columns: Mapping[str, str]  # names in the file
    clocks: tuple[str, ...]

    def load(self, names: Sequence[str]) -> tuple[dict[str, Numbers], tuple[str, ...]]:
        """Columns, and notes on them."""
        own = {name: self.columns[name] for name in names}
        recording = self.form.read(self.path, {self.stream: list(own.values())})
        columns = recording.streams[self.stream].columns
        return {name: columns[column] for name, column in own.items()}, recording.notes


class SignalFolder(RecordingFormat):
    """Folders with one file per signal."""

    name = "folder of signals"

    def recognises(self, head: bytes, path: Path) -> bool:
        """Whether a folder holds an array or a text of numbers."""
        return path.is_dir() and any(_form(each) is not None for each in _files(path))

    def contents(self, path: Path) -> Contents:
        """Columns of all files."""
        signals, notes = _signals(path)
        return Contents(str(path), f"folder of {len(signals)} files", tuple(_streams(signals)), notes)

    def read(self, path: Path, wanted: Mapping[str, Sequence[str]]) -> Recording:
        """Columns of the files that hold them."""
        signals, notes = _signals(path)
        more = list(notes)
        streams: dict[str, Stream] = {}
        for name, columns in wanted.items():
            values: dict[str, Numbers] = {}
            for one in signals:
                if some := [column for column in columns if column in one.columns]:
                    loaded, said = one.load(some)
                    values |= loaded
                    more += [f"{one.path.name}: {note}" for note in said]
            streams[name] = Stream(name, values)
        return Recording(str(path), self.name, streams, tuple(more))


def _files(folder: Path) -> list[Path]:
    try:
        files = sorted(path for path in folder.iterdir() if path.is_file() and not path.name.startswith("."))
    except OSError as error:
        raise InputError(f"cannot read log {folder}: {error.strerror}") from error
    if len(files) > _MOST_FILES:
        raise InputError(f"{folder} holds {len(files)} files, more than the {_MOST_FILES} that a log may have")
    return files


def _form(path: Path) -> RecordingFormat | None:
    """Format of a file of numbers; None for any other."""
    head = head_of(path)
    if NPY.recognises(head, path):
        return NPY
    first = head.split(b"\n", 1)[0].lstrip()
    return TextTable() if TextTable().recognises(head, path) and first[:1] not in (b"{", b"<", b"%") else None


def _signals(folder: Path) -> tuple[list[_Signals], tuple[str, ...]]:
    signals, left = list[_Signals](), list[str]()
    for path in _files(folder):
        form = _form(path)
        if form is NPY:
            signals.append(_of_array(path))
        elif isinstance(form, TextTable) and (one := _of_text(path, form)) is not None:
            signals.append(one)
        else:
            left.append(path.name)
    if not signals:
        raise InputError(f"{folder} holds no file of numbers, neither text nor NPY")
    note = f"{len(left)} file{'s' * (len(left) != 1)} of {folder.name} not read: {', '.join(left[:8])}"
    return signals, (note,) * bool(left)


def _of_array(path: Path) -> _Signals:
    (table,) = NPY.contents(path).streams
    with NPY.arrays(path) as file:
        upright = len(table.columns) == 1 and len(file.arrays[0].shape) == 2  # of shape (N, 1)
    columns = {f"{path.stem}[0]" if upright else name: name for name in table.columns}
    clocks = (path.stem,) if list(columns) == [path.stem] and is_clock(path.stem) else ()
    return _Signals(path, NPY, table.name, table.rows or 0, columns, clocks)


def _of_text(path: Path, form: TextTable) -> _Signals | None:
    try:
        (table,) = form.contents(path).streams
    except InputError:
        return None
    own, stem = table.columns, path.stem
    numbers = all(name.isdigit() for name in own)
    names = [stem] if len(own) == 1 else [f"{stem}[{k}]" if numbers else f"{stem}/{name}" for k, name in enumerate(own)]
    signals = _Signals(path, form, table.name, table.rows or 0, dict(zip(names, own, strict=True)), ())
    clocks = [name for name, title in zip(names, own, strict=True) if is_clock(title) or is_clock(name)]
    if not clocks and len(own) > 1:
        values = signals.load([names[0]])[0][names[0]]
        clocks = names[:1] if values.size > 2 and np.all(np.diff(values) > 0) else []
    return replace(signals, clocks=tuple(clocks))


def _streams(signals: Sequence[_Signals]) -> list[StreamContents]:
    """A stream for each file with a time of its own, and one for all others of as many rows."""
    shared: dict[int, list[_Signals]] = {}
    streams = []
    for one in signals:
        if one.clocks and len(one.columns) > 1:
            streams.append(StreamContents(one.path.stem, tuple(one.columns), one.rows, one.clocks))
        else:
            shared.setdefault(one.rows, []).append(one)
    for rows, several in shared.items():
        columns = tuple(name for one in several for name in one.columns)
        clocks = tuple(name for one in several for name in one.clocks)
        streams.append(StreamContents(f"files of {rows} rows", columns, rows, clocks))
    return streams
