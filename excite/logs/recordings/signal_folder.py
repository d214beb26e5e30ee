"""Folders with one file per signal: NumPy arrays (NPY) and texts of numbers, named after what they hold.

The columns are ``FILE/COLUMN``, or ``FILE`` where a file has one column, or ``FILE[0]`` ... where it has several
without names, with the name of the file without its ending. Files of as many rows, without a time of their own, are one
stream.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from excite.logs.recordings.column_name import is_clock
from excite.logs.recordings.recording import Contents, Numbers, Recording, Stream, StreamContents
from excite.logs.recordings.recording_format import HEAD, RecordingFormat
from excite.logs.recordings.text_table import TABLE, TextTable
from regressors.errors import InputError
from regressors.input_files import LOG, opened

_NPY = b"\x93NUMPY"
_MOST_FILES = 1000


@dataclass(frozen=True)
class _Signals:
    """Columns of one file, by their names in the recording."""

    path: Path
    rows: int
    columns: Mapping[str, str | int]  # own names, or numbers of the columns of an array
    clocks: tuple[str, ...]


class SignalFolder(RecordingFormat):
    """Folders with one file per signal."""

    name = "folder of signals"

    def recognises(self, head: bytes, path: Path) -> bool:
        """Whether a folder holds an array or a text of numbers."""
        return path.is_dir() and any(_kind(each) is not None for each in _files(path))

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
                    loaded, said = _loaded(one, some)
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


def _kind(path: Path) -> str | None:
    try:
        with opened(path, LOG) as stream:
            head = stream.read(HEAD)
    except OSError as error:
        raise InputError(f"cannot read log {path}: {error.strerror}") from error
    if head.startswith(_NPY):
        return "array"
    if TextTable().recognises(head, path):
        first = head.split(b"\n", 1)[0].lstrip()
        return None if first[:1] in (b"{", b"<", b"%") else "text"
    return None


def _signals(folder: Path) -> tuple[list[_Signals], tuple[str, ...]]:
    signals, left = list[_Signals](), list[str]()
    for path in _files(folder):
        kind = _kind(path)
        if kind == "array":
            signals.append(_of_array(path))
        elif kind == "text" and (one := _of_text(path)) is not None:
            signals.append(one)
        else:
            left.append(path.name)
    if not signals:
        raise InputError(f"{folder} holds no file of numbers, neither text nor NPY")
    note = f"{len(left)} file{'s' * (len(left) != 1)} of {folder.name} not read: {', '.join(left[:8])}"
    return signals, (note,) * bool(left)


def _of_array(path: Path) -> _Signals:
    shape = _array(path).shape
    if len(shape) not in (1, 2):
        raise InputError(f"{path} holds an array of shape {shape}; expected rows of numbers")
    names = [path.stem] if len(shape) == 1 else [f"{path.stem}[{k}]" for k in range(shape[1])]
    clocks = tuple(name for name in names if is_clock(name))
    return _Signals(path, shape[0], {name: k for k, name in enumerate(names)}, clocks if len(shape) == 1 else ())


def _of_text(path: Path) -> _Signals | None:
    try:
        (table,) = TextTable().contents(path).streams
    except InputError:
        return None
    own = table.columns
    if len(own) == 1:
        names = [path.stem]
    elif all(name.isdigit() for name in own):
        names = [f"{path.stem}[{k}]" for k in range(len(own))]
    else:
        names = [f"{path.stem}/{name}" for name in own]
    clocks = [name for name, title in zip(names, own, strict=True) if is_clock(title) or is_clock(name)]
    if not clocks and len(own) > 1 and _increases(path, own[0]):
        clocks = names[:1]
    return _Signals(path, table.rows or 0, dict(zip(names, own, strict=True)), tuple(clocks))


def _increases(path: Path, column: str) -> bool:
    values = TextTable().read(path, {TABLE: [column]}).streams[TABLE].columns[column]
    return values.size > 2 and bool(np.all(np.diff(values) > 0))


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


def _loaded(one: _Signals, names: Sequence[str]) -> tuple[dict[str, Numbers], tuple[str, ...]]:
    own = {name: one.columns[name] for name in names}
    if all(isinstance(place, int) for place in own.values()):
        array = _array(one.path)
        return {name: array if array.ndim == 1 else array[:, int(place)] for name, place in own.items()}, ()
    recording = TextTable().read(one.path, {TABLE: [str(place) for place in own.values()]})
    table = recording.streams[TABLE].columns
    return {name: table[str(place)] for name, place in own.items()}, recording.notes


def _array(path: Path) -> Numbers:
    try:
        with opened(path, LOG) as stream:
            array = np.load(stream, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        why = getattr(error, "strerror", None) or "it is not an array of numbers, or not written to its end"
        raise InputError(f"cannot read {path}: {why}") from error
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "iufb":
        raise InputError(f"{path} holds no numbers, but {getattr(array, 'dtype', type(array).__name__)}")
    return np.asarray(array)
