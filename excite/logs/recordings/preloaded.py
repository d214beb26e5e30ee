"""A recording of which some columns were read before, so that they are not read again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from excite.logs.recordings.recording import Contents, Recording, Stream
from excite.logs.recordings.recording_format import RecordingFormat


class Preloaded(RecordingFormat):
    """What was read of one file."""

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
