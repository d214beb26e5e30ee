"""Where one result is written: a folder, or one file of a folder with those beside it; and the hidden names it uses."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from regressors.errors import InputError

NEXT = ".next"  # folders of a result that is not complete yet, while the folder holds another one
JOURNAL = ".journal"
MANIFEST = "manifest.json"
_HIDDEN = re.compile(r"\.(?:(.+)\.)?(?:staging|commit|lock|writer\.json)|\.next|\.journal")


@dataclass(frozen=True)
class Destination:
    """A folder that one process writes to at a time, or a file name in it."""

    folder: Path
    name: str = ""  # of the file; empty where the whole folder is meant

    def hidden(self, what: str) -> Path:
        """Path of a hidden file or folder of this destination."""
        return self.folder / (f".{self.name}.{what}" if self.name else f".{what}")

    @property
    def path(self) -> Path:
        """What the user asked for."""
        return self.folder / self.name

    @property
    def staging(self) -> Path:
        """Folder where files are written until all of them are complete."""
        return self.hidden("staging")

    @property
    def commit(self) -> Path:
        """The staging folder's name from when all of its files are complete until they are in place."""
        return self.hidden("commit")


def shown(path: Path) -> Path:
    """The path that a user knows, without hidden folders in which a result is prepared.

    Of a hidden file, such as a lock, it is the path of the result that it belongs to.
    """
    known = Path(*(part for part in path.parts if not _HIDDEN.fullmatch(part)))
    hidden = _HIDDEN.fullmatch(path.name)
    return known / hidden[1] if hidden and hidden[1] else known


def plain_name(name: object, source: Path) -> str:
    """A name that stays in its folder, as read from a file."""
    if not isinstance(name, str) or name in ("", ".", "..") or re.search(r"[/\\\0]", name):
        raise InputError(f"{source}: expected names of files without a folder")
    return name
