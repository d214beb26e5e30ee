"""Recordings of any known format, read as they are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from excite.logs.recordings.formats import recording_format
from excite.logs.recordings.recording import Recording
from regressors.arguments import checked
from regressors.errors import UnknownName


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
