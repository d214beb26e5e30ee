"""All formats of recordings, and which of them a file is."""

from __future__ import annotations

from pathlib import Path

from excite.logs.recordings.hdf5_file import Hdf5File
from excite.logs.recordings.matlab_file import MatlabFile
from excite.logs.recordings.matlab_hdf5 import MatlabHdf5
from excite.logs.recordings.mcap_bag import McapBag
from excite.logs.recordings.npz_arrays import NpyFile, NpzFile
from excite.logs.recordings.parquet_table import ParquetTable
from excite.logs.recordings.recording_format import HEAD, RecordingFormat
from excite.logs.recordings.rosbag1 import Rosbag1
from excite.logs.recordings.rosbag2 import Rosbag2
from excite.logs.recordings.signal_folder import SignalFolder
from excite.logs.recordings.text_table import TextTable
from regressors.errors import InputError
from regressors.input_files import LOG, opened

FORMATS: tuple[RecordingFormat, ...] = (  # the first that recognises a file reads it
    McapBag(),
    Rosbag2(),
    Rosbag1(),
    ParquetTable(),
    NpzFile(),
    NpyFile(),
    MatlabHdf5(),  # is HDF5 too
    Hdf5File(),
    MatlabFile(),
    SignalFolder(),
    TextTable(),
)


def format_of(path: str | Path) -> RecordingFormat | None:
    """Format of a file or folder; None where none recognises it."""
    path = Path(path)
    head = head_of(path)
    return next((form for form in FORMATS if form.recognises(head, path)), None)


def binary_format(path: Path) -> RecordingFormat | None:
    """Format of a file or folder that is not one text; None for a text, for a pipe, and for what nothing recognises."""
    if not (path.is_file() or path.is_dir()):  # what comes through a pipe can be read once
        return None
    form = recording_format(path) if path.is_dir() else format_of(path)
    return None if isinstance(form, TextTable) else form


def recording_format(path: Path) -> RecordingFormat:
    """Format of a file or folder, which may be a text."""
    if (form := format_of(path)) is None:
        known = ", ".join(each.name for each in FORMATS)
        kind = "folder" if path.is_dir() else "file" if head_of(path) else "empty file"
        raise InputError(f"{path} is {'an' if kind[0] == 'e' else 'a'} {kind} of no known format; known are {known}")
    return form


def head_of(path: Path) -> bytes:
    """First bytes of a file; empty for a folder."""
    if path.is_dir():
        return b""
    try:
        with opened(path, LOG) as stream:
            return stream.read(HEAD)
    except OSError as error:
        raise InputError(f"cannot read log {path}: {error.strerror}") from error
