"""The folder of a cell: an ordinary design folder, with ``cell.json`` that says which problem it belongs to."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from excite.files.design_folder import DESIGN, KIND, TRAJECTORY
from excite.storage.atomic import read_json, replacing, write_json, writing
from excite.storage.codec import content_of, record_of
from excite.storage.commit import settle
from excite.storage.destination import Destination
from excite.storage.manifest import check_files
from excite.storage.migrations import schema_of
from regressors.errors import InputError

CELL, CELLS = "cell.json", "cells"
INFEASIBLE, FAILED = "infeasible", "failed"
_NEW, _OLD = ".new-", ".old-"


@dataclass(frozen=True)
class CellRecord:
    """What ``cell.json`` holds."""

    sha256: str | None  # hash of the problem, see `excite.campaigns.cell_identity`
    search: str  # starts, rounds and budget that were asked for
    status: str = ""  # empty while there is no outcome beside the design; ``infeasible`` or ``failed``
    reason: str = ""  # why there is no design


def read_cell(folder: Path) -> CellRecord | None:
    """The record of a cell's folder; None where there is none that can be read."""
    with suppress(InputError):
        return record_of(CellRecord, read_json(folder / CELL), {}) if (folder / CELL).exists() else None
    return None


def write_cell(folder: Path, record: CellRecord) -> None:
    """Write the record of a cell into its folder."""
    write_json(folder / CELL, {"schema": schema_of("cell"), **content_of(record)[0]})


def stored_design(folder: Path) -> dict[str, Any] | None:
    """Content of a complete ``design.json``; None where there is none, or files were changed since it was written."""
    if not folder.is_dir():
        return None
    with suppress(InputError):
        settle(Destination(folder))
        if (folder / DESIGN).exists():
            check_files(folder, KIND, (DESIGN, TRAJECTORY))
            content = read_json(folder / DESIGN)
            return None if content.get("interrupted") else content
    return None


def packed(folder: Path) -> dict[str, bytes]:
    """All files below a folder by their paths in it."""
    files = sorted(path for path in folder.rglob("[!.]*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def place(files: Mapping[str, bytes], folder: Path) -> None:
    """Put a folder in place whole; an older one of the same name leaves."""
    new, old = folder.with_name(f"{_NEW}{folder.name}"), folder.with_name(f"{_OLD}{folder.name}")
    with writing(folder):
        for left in (new, old):
            shutil.rmtree(left, ignore_errors=True)
        for name, content in files.items():
            path = new / name
            path.parent.mkdir(parents=True, exist_ok=True)
            with replacing(path, "wb") as stream:
                stream.write(content)
        if folder.exists():
            os.rename(folder, old)
        os.rename(new, folder)
        shutil.rmtree(old, ignore_errors=True)


def clear_cells(cells: Path) -> None:
    """Make good what an interrupted `place` has left."""
    with writing(cells):
        for old in cells.glob(f"{_OLD}*"):
            if not (there := cells / old.name.removeprefix(_OLD)).exists():
                os.rename(old, there)
        for left in (*cells.glob(f"{_OLD}*"), *cells.glob(f"{_NEW}*")):
            shutil.rmtree(left, ignore_errors=True)
