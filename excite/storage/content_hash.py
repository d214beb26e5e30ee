"""SHA-256 of files and of entries of JSON files, and JSON files that hold the hash of their own content."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from excite.storage.atomic import read_json, write_json
from excite.storage.finite import check_content
from regressors.errors import InputError

HASH = "sha256"


class EditedError(InputError):
    """A file whose content is not the one that was written."""


def sha256_of(file: Path) -> str | None:
    """Hash of a file's content, None where there is no file."""
    if not file.is_file():
        return None
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def entry_sha256(entry: object) -> str:
    """Hash of an entry of a JSON file that depends neither on its layout nor on how its numbers are written."""
    text = json.dumps(_as_floats(entry), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode("ascii")).hexdigest()


def _as_floats(entry: object) -> object:
    if isinstance(entry, Mapping):
        return {name: _as_floats(value) for name, value in entry.items()}
    if isinstance(entry, list | tuple):
        return [_as_floats(value) for value in entry]
    return float(entry) if isinstance(entry, int) and not isinstance(entry, bool) else entry


def write_hashed(path: Path, content: Mapping[str, Any]) -> None:
    """Write JSON with an entry ``sha256`` of all others; see `write_json`."""
    check_content(path, content)
    write_json(path, {**content, HASH: entry_sha256(content)})


def read_hashed(path: Path) -> dict[str, Any]:
    """Read what `write_hashed` has written, without the hash; a file without one is taken as it is."""
    content = read_json(path)
    if HASH in content and content.pop(HASH) != entry_sha256(content):
        raise EditedError(f"{path} was changed after it was written: its SHA-256 is not the one in the entry '{HASH}'")
    return content
