"""The manifest of a result folder: its runs, and the hash of each of its files.

Several results may share a folder, such as an identification and its verifications; each has an entry of its own.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from excite.storage.atomic import MANIFEST, check_content, plain_name, read_json, write_json
from regressors.errors import InputError, reading

SCHEMA = "excite.manifest/1"


@dataclass(frozen=True)
class FileHash:
    """Content of a file."""

    sha256: str
    size: int  # [bytes]

    @classmethod
    def of(cls, path: Path) -> FileHash:
        """Hash of a file."""
        with path.open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256")
            return cls(digest.hexdigest(), stream.tell())


@dataclass(frozen=True)
class Entry:
    """One result of a folder."""

    run: str  # unique number of the run that wrote it
    files: dict[str, FileHash]  # by name
    figures: tuple[str, ...] | None = None  # formats of the figures that were to be drawn

    def without(self, names: Collection[str]) -> Entry:
        """The entry without files that have become another's."""
        return replace(self, files={name: each for name, each in self.files.items() if name not in names})


def is_foreign(folder: Path) -> bool:
    """True if the folder has a ``manifest.json`` of the user's own, which is not one of results."""
    return (folder / MANIFEST).exists() and _content(folder) is None


def read_manifest(folder: Path) -> dict[str, Entry]:
    """Entries of a folder's manifest by kind of result; none without one, or where the file is the user's own."""
    path = folder / MANIFEST
    content = _content(folder) if path.exists() else None
    if content is None:
        return {}
    if content["schema"] != SCHEMA:
        raise InputError(f"{path}: expected schema {SCHEMA}, given {content['schema']!r}")
    try:
        return {kind: _entry(entry, path) for kind, entry in content["results"].items()}
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path} is damaged; remove it to use the files in {folder} as they are") from error


def _content(folder: Path) -> dict[str, Any] | None:
    """Content of a folder's manifest; None where the file is of another kind."""
    path = folder / MANIFEST
    try:
        content = read_json(path)
    except InputError as error:
        raise InputError(f"{error}; remove it to use the files in {folder} as they are") from error
    schema = content.get("schema")
    return content if isinstance(schema, str) and schema.startswith("excite.manifest/") else None


def _entry(content: Mapping[str, Any], path: Path) -> Entry:
    listed, figures = content["files"], content.get("figures")
    for part in (part for name in listed for part in name.split("/")):
        plain_name(part, path)
    return Entry(
        str(content["run"]),
        {name: FileHash(str(of["sha256"]), int(of["size"])) for name, of in listed.items()},
        None if figures is None else tuple(map(str, figures)),
    )


def write_manifest(path: Path, manifest: Mapping[str, Entry]) -> None:
    """Write a manifest."""
    results = {kind: asdict(entry) for kind, entry in manifest.items()}
    for content in results.values():
        if content["figures"] is None:
            del content["figures"]
    write_json(path, {"schema": SCHEMA, "results": results})


def check_files(folder: Path, kind: str, names: Iterable[str]) -> None:
    """Check that files are those of the run that wrote a result; files that are missing are not looked at."""
    entry = read_manifest(folder).get(kind)
    if entry is None:
        return
    there = [name for name in names if name in entry.files and (folder / name).exists()]
    changed = []
    for name in there:
        path, known = folder / name, entry.files[name]
        with reading(str(path)):
            changed += [] if path.stat().st_size == known.size and FileHash.of(path) == known else [name]
    if changed:
        which, since = " and ".join(changed), MANIFEST if changed[0] == there[0] else there[0]
        has, comes = ("have", "come") if len(changed) > 1 else ("has", "comes")
        raise InputError(
            f"{folder}: {which} {has} been changed since {since} was written, or {comes} from another "
            f"run; write the result again, or remove {folder / MANIFEST} to use the files as they are"
        )


HASH = "sha256"


class EditedError(InputError):
    """A file whose content is not the one that was written."""


def sha256_of(file: Path) -> str | None:
    """Hash of a file's content, None where there is no file."""
    return FileHash.of(file).sha256 if file.is_file() else None


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
