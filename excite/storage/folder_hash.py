"""One hash of many files of a folder, which neither needs their names in memory nor depends on their order."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass
from itertools import islice
from pathlib import Path


@dataclass(frozen=True)
class FolderHash:
    """Names and contents of the files of a folder, without hidden ones."""

    count: int  # number of files
    # sum of the SHA-256 of each file's entry modulo 2^256, in hexadecimal digits; the entry is the name in UTF-8, a
    # zero byte, and the SHA-256 of the content
    sum: str

    @classmethod
    def of(cls, folder: Path) -> FolderHash:
        """Hash of a folder, one file in memory at a time."""
        count = total = 0
        for path in visible_files(folder):
            with path.open("rb") as stream:
                content = hashlib.file_digest(stream, "sha256").digest()
            count += 1
            total += int.from_bytes(hashlib.sha256(os.fsencode(path.name) + b"\0" + content).digest(), "big")
        return cls(count, f"{total % 2**256:064x}")


def visible_files(folder: Path) -> Generator[Path, None, None]:
    """Files of a folder, in any order, without hidden ones."""
    with os.scandir(folder) as entries:
        for entry in entries:
            if not entry.name.startswith(".") and entry.is_file():
                yield Path(entry.path)


def holds_more_than(count: int, folder: Path) -> bool:
    """True if a folder holds more files than a number; no more of them are looked at."""
    with closing(visible_files(folder)) as files:
        return next(islice(files, count, None), None) is not None
