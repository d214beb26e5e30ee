"""Where the starts of a search go, and which of them an earlier run has finished."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import Any

from excite.design.design_folder import DESIGN, KIND, STARTS, check_no_design, data_files, starts_folder
from excite.design.formulation import Formulation
from excite.design.kept_starts import KeptStarts, keep_starts
from excite.design.start_results import RUNNING, read_start, start_files
from excite.registry import FIGURE_FORMATS
from excite.storage.atomic import read_json, replacing, shown, writing
from excite.storage.manifest import read_manifest
from excite.tasks.search import Search
from regressors.errors import InputError


def resume_search(folder: Path, formulation: Formulation, *, replace: bool = False, fresh: bool = False) -> KeptStarts:
    """Find the starts of the same problem that an earlier run has finished, in the folder where further ones go.

    A design that an interrupted run has saved is continued, and replaced when the new one is complete; so is one that
    was killed before its figures were drawn, and, if it may be replaced, one of fewer starts. Any other complete design
    is replaced by one that is made anew.
    """
    stored = _same_problem(folder, formulation)
    unfinished = _is_unfinished(folder, stored)
    check_no_design(folder, data_files(formulation.task), replace=replace or unfinished)
    starts = starts_folder(folder)
    if not fresh and (unfinished or _is_less(stored, formulation.task.search)):
        _carry_over(folder / STARTS, starts, formulation)
    return keep_starts(starts, formulation, fresh=fresh, shown=shown(starts))


def holds_unfinished_design(folder: Path) -> bool:
    """Whether a run was interrupted, or killed before its figures were drawn, so that it may be continued."""
    return _is_unfinished(folder, _stored(folder))


def _is_unfinished(folder: Path, stored: dict[str, Any]) -> bool:
    return bool(stored) and (stored.get("interrupted") is True or not _is_drawn(folder))


def _is_drawn(folder: Path) -> bool:
    """Whether a design has its figures, where any were asked for."""
    entry = None
    with suppress(InputError):
        entry = read_manifest(folder).get(KIND)
    formats = FIGURE_FORMATS if entry is None or entry.figures is None else entry.figures
    return not formats or any(any(folder.glob(f"*.{form}")) for form in formats)


def _stored(folder: Path) -> dict[str, Any]:
    """Content of ``design.json``; empty where there is none that can be read."""
    with suppress(InputError):
        return read_json(folder / DESIGN) if (folder / DESIGN).exists() else {}
    return {}


def _same_problem(folder: Path, formulation: Formulation) -> dict[str, Any]:
    """Content of ``design.json`` if it is of the same problem, else nothing."""
    stored, sha256 = _stored(folder), formulation.identity.sha256
    provenance = stored.get("provenance")
    same = sha256 is not None and isinstance(provenance, dict) and provenance.get("problem") == sha256
    return stored if same else {}


def _is_less(stored: dict[str, Any], search: Search) -> bool:
    """Whether a stored design had fewer starts than are asked for now, so that it is continued."""
    task = stored.get("task")
    if not isinstance(task, dict):
        return False
    count = task.get("starts")
    if search.adaptive:  # which rounds are in it, only their lineage says
        return isinstance(count, int) or task.get("rounds") is not None
    return isinstance(count, int) and count < search.first


def _carry_over(old: Path, new: Path, formulation: Formulation) -> None:
    """Give the finished starts of the same problem a second name in another folder.

    Those that cannot be used get one too, so that `keep_starts` says so.
    """
    if old == new or not old.is_dir():
        return
    there = {index for index, _ in start_files(new)}
    for index, path in start_files(old):
        if index not in there and path.is_file() and not _is_other(path, formulation):
            _link(path, new / path.name)


def _is_other(path: Path, formulation: Formulation) -> bool:
    """True for starts that did not end, or are of another problem."""
    with suppress(InputError):
        start, origin = read_start(path)
        return origin is None or origin.sha256 != formulation.identity.sha256 or start.status == RUNNING
    return False


def _link(path: Path, other: Path) -> None:
    try:
        os.link(path, other)
    except OSError:  # of a file system without links
        with writing(other), replacing(other, "wb") as stream:
            stream.write(path.read_bytes())
