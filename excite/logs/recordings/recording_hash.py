"""Hash that identifies a recording, which may be a folder."""

from __future__ import annotations

import hashlib
from pathlib import Path

from excite.storage.content_hash import sha256_of


def recording_sha256(path: Path) -> str:
    """Hash of a file, or of the names and hashes of all files of a folder."""
    if (own := sha256_of(path)) is not None:
        return own
    digest = hashlib.sha256()
    for file in sorted(each for each in path.rglob("*") if each.is_file()):
        digest.update(f"{file.relative_to(path).as_posix()} {sha256_of(file)}\n".encode())
    return digest.hexdigest()
