"""The interface of every format of recordings."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

from excite.logs.recordings.recording import Contents, Recording

HEAD = 4096  # bytes by which a file is recognised


class RecordingFormat(ABC):
    """A format of recordings; a new one is one subclass in one file, and its line in `excite.logs.recordings.formats`.

    A format needs no state: its object is made without arguments.
    """

    name: ClassVar[str]

    @abstractmethod
    def recognises(self, head: bytes, path: Path) -> bool:
        """Whether a file or folder is of this format, by its content and not by its name."""

    @abstractmethod
    def contents(self, path: Path) -> Contents:
        """What is inside, without loading all of it."""

    @abstractmethod
    def read(self, path: Path, wanted: Mapping[str, Sequence[str]]) -> Recording:
        """Some columns."""

    def glance(self, path: Path, wanted: Mapping[str, Sequence[str]]) -> Recording:
        """Some columns, of as many rows as show what they are; all rows for most formats."""
        return self.read(path, wanted)

    def mapping_fields(self, path: Path) -> Mapping[str, object]:
        """Fields of `excite.logs.mapping.LogMapping` that say how such a file is laid out; none for most formats."""
        return {}
