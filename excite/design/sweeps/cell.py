"""A cell of a sweep: one design task, the name that its options give it, and its folder.

A cell is designed in any process: in its folder, or in a temporary one whose files are sent back.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import string
import tempfile
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import cloudpickle

from constraints.diagnosis import ContradictionError
from excite.design.design_folder import DESIGN, KIND, TRAJECTORY, write_design
from excite.design.executors.dask_cluster import check_versions
from excite.design.formulation import formulate
from excite.design.multistart import resume_search
from excite.design.optimisation import solve
from excite.design.problem_identity import (
    NotComparable,
    content_sha256,
    package_versions,
    plain_options,
    references_of_own,
)
from excite.errors import NoFeasibleMotionError
from excite.storage.atomic import Destination, read_json, write_bytes, write_json, writing
from excite.storage.codec import content_of, record_of
from excite.storage.commit import settle
from excite.storage.manifest import check_files
from excite.storage.migrations import schema_of
from excite.storage.result_folder import result_folder
from excite.tasks.robot_of_task import installed_robot
from excite.tasks.task import PARTS, Task
from regressors.errors import ExciteError, InputError, one_line

_NOWHERE = ("class", "executor", "workers", "starts")  # on which no start depends
_LONGEST_VALUE, _LONGEST_NAME = 32, 160  # characters
_SAFE = frozenset(string.ascii_letters + string.digits + "_.+-")
_DIGITS = 8  # of a hash in a name


@dataclass(frozen=True)
class Cell:
    """One design of a sweep."""

    name: str  # of its folder; unique in the sweep, whatever the other cells are
    task: Task
    # options of the grid and what they are in this cell, as text
    options: Mapping[str, str] = field(default_factory=dict)


def cell_name(options: Mapping[str, str]) -> str:
    """Name of a cell by its options, such as ``robot=irp6,seed=0``; it depends on nothing else."""
    name = ",".join(f"{option}={value}" for option, value in options.items())
    return name if len(name) <= _LONGEST_NAME else f"{name[:_LONGEST_NAME]}-{_hash(name)}"


def value_name(value: Any) -> str:
    """Short name of a value in names of folders: letters, digits, and ``+ - . _`` only."""
    if isinstance(value, list) and value and not any(isinstance(each, list | dict) for each in value):
        text = "+".join(map(_plain, value))
    else:
        text = _plain(value)
    safe = "".join(letter if letter in _SAFE else "-" for letter in text).strip("-.")[:_LONGEST_VALUE]
    return safe if safe == text else f"{safe}-{_hash(text)}".strip("-")


def is_cell_name(name: str) -> bool:
    """True for a name that folders of any system may have, and that is no option and not hidden."""
    return 0 < len(name) <= _LONGEST_NAME and all(value_name(part) == part for part in re.split("[,=]", name))


def _plain(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, sort_keys=True)


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:_DIGITS]


def cell_identities(cells: Iterable[Cell]) -> dict[str, str | None]:
    """Hashes of the problems of cells by their names: robot, task and versions, without the number of starts.

    None stands for a task with a part of the user's own of which a later process could not tell whether it is the same.
    """
    robots: dict[tuple[Any, ...], str] = {}  # each read once
    versions = package_versions()
    identities = {}
    for cell in cells:
        task = cell.task
        named = task.robot if isinstance(task.robot, str) else id(task.robot)
        key = (named, task.base_link, task.tip, task.snap_angles, task.xacro, repr(task.installation))
        if key not in robots:
            robots[key] = content_sha256(installed_robot(task).description())
        identities[cell.name] = _identity(task, robots[key], versions)
    return identities


def _identity(task: Task, robot: str, versions: dict[str, str]) -> str | None:
    content: dict[str, Any] = {"robot": robot, "versions": versions}
    try:
        content |= plain_options(task, PARTS, _NOWHERE)
        content["own"] = references_of_own(task)
    except NotComparable:
        return None
    return content_sha256(content)


CELL, CELLS = "cell.json", "cells"
INFEASIBLE, FAILED = "infeasible", "failed"
_NEW, _OLD = ".new-", ".old-"


@dataclass(frozen=True)
class CellRecord:
    """What ``cell.json`` holds."""

    sha256: str | None  # hash of the problem, see `excite.design.sweeps.cell`
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
            write_bytes(path, content)
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


@dataclass(frozen=True)
class CellWork:
    """A cell that is left to design."""

    task: bytes  # pickled, with executor ``serial``
    record: CellRecord
    folder: str = ""  # of the cell; empty where the design is sent back
    fresh: bool = False  # its folder holds starts of another problem, which leave


#: What came of a cell, and the files of its folder, where it was designed in a temporary one.
CellResult = tuple[CellRecord, Mapping[str, bytes]]


def pickled_task(task: Task) -> bytes:
    """A task whose starts run one after the other, for another process."""
    return bytes(cloudpickle.dumps(task.changed(executor="serial", workers=None)))


def design_cell(versions: Mapping[str, str], work: CellWork) -> CellResult:
    """Design a cell and write its folder, whatever comes of it."""
    check_versions(dict(versions))
    task = cloudpickle.loads(work.task)
    if work.folder:
        return _design_in(Path(work.folder), task, work), {}
    with tempfile.TemporaryDirectory() as temporary:
        return _design_in(Path(temporary), task, work), packed(Path(temporary))


def _design_in(folder: Path, task: Task, work: CellWork) -> CellRecord:
    with result_folder(folder):
        write_cell(folder, work.record)
        try:
            robot = installed_robot(task)
            formulation = formulate(robot, task)
            kept = resume_search(folder, formulation, replace=True, fresh=work.fresh)
            design = solve(robot, formulation, kept)
            if design.interrupted:
                raise KeyboardInterrupt
            write_design(design, folder, ())
        except Exception as error:  # whatever it is, the other cells run
            text = str(error) or "no reason given"
            record = replace(
                work.record,
                status=INFEASIBLE if isinstance(error, ContradictionError | NoFeasibleMotionError) else FAILED,
                reason=one_line(text if isinstance(error, ExciteError) else f"{type(error).__name__}: {text}"),
            )
            write_cell(folder, record)
            return record
    return work.record
