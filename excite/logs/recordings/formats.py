"""All formats of recordings, which of them a file is, and recordings of any known format, read as they are."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path

from excite.logs.recordings.array_streams import HDF5, NPY, NPZ
from excite.logs.recordings.bags import MCAP_BAG, ROSBAG1, ROSBAG2
from excite.logs.recordings.matlab import MATLAB, MATLAB_7_3
from excite.logs.recordings.parquet import ParquetTable
from excite.logs.recordings.recording import Contents, Recording, RecordingFormat, Stream, head_of
from excite.logs.recordings.signal_folder import SignalFolder
from excite.logs.recordings.text_table import TextTable
from excite.storage.manifest import sha256_of
from regressors.arguments import checked
from regressors.errors import InputError, UnknownName

FORMATS: tuple[RecordingFormat, ...] = (  # the first that recognises a file reads it
    MCAP_BAG,
    ROSBAG2,
    ROSBAG1,
    ParquetTable(),
    NPZ,
    NPY,
    MATLAB_7_3,  # is HDF5 too
    HDF5,
    MATLAB,
    SignalFolder(),
    TextTable(),
)


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
    for name in columns or ():
        if name not in contents.columns:
            raise UnknownName(f"column in {path}", name, contents.columns)
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
    return None if isinstance(form, TextTable) else form


def format_of(path: str | Path) -> RecordingFormat | None:
    """Format of a file or folder; None where none recognises it."""
    path = Path(path)
    head = head_of(path)
    return next((form for form in FORMATS if form.recognises(head, path)), None)


class Preloaded(RecordingFormat):
    """Columns that were read of one file before, so that they are not read again."""

    name = "preloaded"

    def __init__(self, form: RecordingFormat, known: Contents, recording: Recording) -> None:
        self._form, self._known, self._recording = form, known, recording

    def recognises(self, head: bytes, path: Path) -> bool:
        """Whether it is the file that was read."""
        return self._known.source == str(path)

    def contents(self, path: Path) -> Contents:
        """What is known of it."""
        return self._known

    def read(self, path: Path, wanted: Mapping[str, Sequence[str]]) -> Recording:
        """Columns that were read; from the file where one of them was not."""
        there = self._recording.streams
        if any(name not in there or not set(columns) <= set(there[name].columns) for name, columns in wanted.items()):
            return self._form.read(path, wanted)
        streams = {n: Stream(n, {c: there[n].columns[c] for c in columns}) for n, columns in wanted.items()}
        return Recording(self._recording.source, self._recording.format, streams, self._recording.notes)


def recording_sha256(path: Path) -> str:
    """Hash of a file, or of the names and hashes of all files of a folder."""
    if (own := sha256_of(path)) is not None:
        return own
    digest = hashlib.sha256()
    for file in sorted(each for each in path.rglob("*") if each.is_file()):
        digest.update(f"{file.relative_to(path).as_posix()} {sha256_of(file)}\n".encode())
    return digest.hexdigest()
