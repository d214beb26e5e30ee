"""The frame of every write of a result: one writer at a time, and all files at once."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from excite.storage.commit import clear, commit, staging
from excite.storage.destination import Destination
from excite.storage.folder import new_folder
from excite.storage.lock import locked


@dataclass(frozen=True)
class Change:
    """What happens when files that are complete are put in place."""

    last: str  # file that is put in place after the others
    remove: Collection[str] = ()  # files of the folder that leave
    folders: Collection[str] = ()  # folders in ``.next`` that take the place of those of the same name


@contextmanager
def sole_writer(at: Destination) -> Iterator[None]:
    """Be the only writer of a destination, whose folder is made; what an interrupted run has left is settled first."""
    with new_folder(at.folder), locked(at):
        clear(at)
        yield


@contextmanager
def replacing(at: Destination, change: Callable[[Path], Change]) -> Iterator[Path]:
    """Give an empty folder for new files, and put them in place all at once when the block ends without an error."""
    with staging(at) as staged:
        yield staged
        planned = change(staged)
        commit(at, last=planned.last, remove=planned.remove, folders=planned.folders)
