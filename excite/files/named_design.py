"""The design that a hash names, found in the folders that one is given."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path

from excite.files.content_hashes import HASHES
from excite.files.design_folder import DESIGN
from excite.storage.atomic import read_json
from excite.storage.manifest import entry_sha256, sha256_of
from regressors.errors import InputError

_MOST = 1000  # folders in one folder that are looked into


def find_design(sha256: str, folders: Iterable[str | Path]) -> Path | None:
    """Folder of the design with a hash, among some folders and those directly in them.

    Only files of the name ``design.json`` are read, and nothing that they name is opened.
    """
    return next((place for place in _places(folders) if sha256 in design_hashes(place)), None)


def _places(folders: Iterable[str | Path]) -> Iterator[Path]:
    for folder in map(Path, folders):
        yield folder
        if folder.is_dir():
            yield from sorted(path for path in islice(folder.iterdir(), _MOST) if path.is_dir())


def design_hashes(folder: Path) -> frozenset[str]:
    """Hashes by which the design in a folder may be named; none if there is no readable one."""
    path = folder / DESIGN
    try:
        whole = sha256_of(path)
        if whole is None:
            return frozenset()
        content = read_json(path)
        stated = content.get(HASHES, {}).get("trajectory") or entry_sha256(content["trajectory"])
    except (InputError, OSError, KeyError, AttributeError, TypeError, ValueError):
        return frozenset()
    return frozenset({whole, str(stated)})
