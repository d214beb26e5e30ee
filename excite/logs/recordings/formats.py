"""All formats of recordings, folders of signals among them, and which of them a file is.

The columns are ``FILE/COLUMN``, or ``FILE`` where a file has one column, or ``FILE[0]`` ... where it has several
without names, with the name of the file without its ending. Files of as many rows, without a time of their own, are one
stream.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from excite.logs.log import counted
from excite.logs.recordings.array_streams import HDF5, JSON, NPY, NPZ, arrays_of, fill_from_npy
from excite.logs.recordings.bags import MCAP_BAG, ROSBAG1, ROSBAG2
from excite.logs.recordings.matlab import MATLAB, MATLAB_7_3
from excite.logs.recordings.parquet import PARQUET
from excite.logs.recordings.recording import (
    Contents,
    Numbers,
    Recording,
    RecordingFormat,
    Stream,
    StreamContents,
    Wanted,
    head_of,
    is_clock,
)
from excite.logs.recordings.text_table import SERVOS, TEXT
from excite.storage.manifest import sha256_of
from regressors.arguments import checked
from regressors.errors import InputError, check_names, reading

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


def _is_folder(head: bytes, path: Path) -> bool:
    """Whether a folder holds an array or a text of numbers."""
    return path.is_dir() and any(_form(each) is not None for each in _files(path))


def _contents(path: Path) -> Contents:
    """Columns of all files."""
    signals, notes = _signals(path)
    return Contents(str(path), f"folder of {len(signals)} files", tuple(_streams(signals)), notes)


def _read(path: Path, wanted: Wanted) -> Recording:
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
    return Recording(str(path), FOLDER.name, streams, tuple(more))


FOLDER = RecordingFormat("folder of signals", _is_folder, _contents, _read)


def _files(folder: Path) -> list[Path]:
    with reading(f"log {folder}"):
        files = sorted(path for path in folder.iterdir() if path.is_file() and not path.name.startswith("."))
    if len(files) > _MOST_FILES:
        raise InputError(f"{folder} holds {len(files)} files, more than the {_MOST_FILES} that a log may have")
    return files


def _form(path: Path) -> RecordingFormat | None:
    """Format of a file of numbers; None for any other."""
    head = head_of(path)
    if NPY.recognises(head, path):
        return NPY
    first = head.split(b"\n", 1)[0].lstrip()
    return TEXT if TEXT.recognises(head, path) and first[:1] not in (b"{", b"<", b"%") else None


def _signals(folder: Path) -> tuple[list[_Signals], tuple[str, ...]]:
    signals, left = list[_Signals](), list[str]()
    for path in _files(folder):
        form = _form(path)
        if form is NPY:
            signals.append(_of_array(path))
        elif form is TEXT and (one := _of_text(path)) is not None:
            signals.append(one)
        else:
            left.append(path.name)
    if not signals:
        raise InputError(f"{folder} holds no file of numbers, neither text nor NPY")
    note = f"{counted(len(left), 'file')} of {folder.name} not read: {', '.join(left[:8])}"
    return signals, (note,) * bool(left)


def _of_array(path: Path) -> _Signals:
    with arrays_of(path, NPY.name, fill_from_npy) as file:
        (table,) = file.contents().streams
        upright = len(table.columns) == 1 and len(file.arrays[0].shape) == 2  # of shape (N, 1)
    columns = {f"{path.stem}[0]" if upright else name: name for name in table.columns}
    clocks = (path.stem,) if list(columns) == [path.stem] and is_clock(path.stem) else ()
    return _Signals(path, NPY, table.name, table.rows or 0, columns, clocks)


def _of_text(path: Path) -> _Signals | None:
    try:
        (table,) = TEXT.contents(path).streams
    except InputError:
        return None
    own, stem = table.columns, path.stem
    numbers = all(name.isdigit() for name in own)
    names = [stem] if len(own) == 1 else [f"{stem}[{k}]" if numbers else f"{stem}/{name}" for k, name in enumerate(own)]
    signals = _Signals(path, TEXT, table.name, table.rows or 0, dict(zip(names, own, strict=True)), ())
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


# The first that recognises a file reads it; one of MATLAB 7.3 is HDF5 too
FORMATS = (MCAP_BAG, ROSBAG2, ROSBAG1, PARQUET, NPZ, NPY, MATLAB_7_3, HDF5, MATLAB, SERVOS, FOLDER, JSON, TEXT)


@checked
def read_recording(path: str | Path, columns: Sequence[str] | None = None) -> Recording:
    """Read columns of a recording, in the units of the file.

    Parameters
    ----------
    path : path
        File or folder of any known format.
    columns : sequence of str, optional
        Names as `excite.logs.guess.log_guess.guess_mapping` lists them; all if not given. The clocks of their streams
        are read with them.

    Raises
    ------
    InputError
        Cannot be read, or of no known format.
    UnknownName
        A column that the recording does not have.
    """
    path = Path(path)
    form = recording_format(path)
    contents = form.contents(path)
    check_names(f"column in {path}", columns or (), contents.columns)
    wanted = {}
    for stream in contents.streams:
        some = stream.columns if columns is None else [name for name in stream.columns if name in columns]
        if some:
            wanted[stream.name] = list(dict.fromkeys([*stream.clocks, *some]))
    return form.read(path, wanted)


def recording_format(path: Path) -> RecordingFormat:
    """Format of a file or folder, which may be a text; one that nothing recognises is refused."""
    if (form := format_of(path)) is None:
        known = ", ".join(each.name for each in FORMATS)
        kind = "folder" if path.is_dir() else "file" if head_of(path) else "empty file"
        raise InputError(f"{path} is {'an' if kind[0] == 'e' else 'a'} {kind} of no known format; known are {known}")
    return form


def binary_format(path: Path) -> RecordingFormat | None:
    """Format of a file or folder that is not one text; None for a text, for a pipe, and for what nothing recognises."""
    if not (path.is_file() or path.is_dir()):  # what comes through a pipe can be read once
        return None
    form = recording_format(path) if path.is_dir() else format_of(path)
    return None if form is TEXT else form


def format_of(path: Path) -> RecordingFormat | None:
    """Format of a file or folder; None where none recognises it."""
    head = head_of(path)
    return next((form for form in FORMATS if form.recognises(head, path)), None)


def preloaded(form: RecordingFormat, contents: Contents, recording: Recording) -> RecordingFormat:
    """The format of a file of which columns were read before, so that they are not read again."""

    def read(path: Path, wanted: Wanted) -> Recording:
        there = recording.streams
        if any(name not in there or not set(columns) <= set(there[name].columns) for name, columns in wanted.items()):
            return form.read(path, wanted)
        streams = {n: Stream(n, {c: there[n].columns[c] for c in columns}) for n, columns in wanted.items()}
        return replace(recording, streams=streams)

    return replace(form, contents=lambda _: contents, read=read)


def recording_sha256(path: Path) -> str:
    """Hash of a file, or of the names and hashes of all files of a folder."""
    if (own := sha256_of(path)) is not None:
        return own
    digest = hashlib.sha256()
    for file in sorted(each for each in path.rglob("*") if each.is_file()):
        digest.update(f"{file.relative_to(path).as_posix()} {sha256_of(file)}\n".encode())
    return digest.hexdigest()
