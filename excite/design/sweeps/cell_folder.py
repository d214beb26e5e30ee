"""The folder of a cell, an ordinary design folder with ``cell.json`` that states its problem, and its design there.

A cell is designed in any process: in its folder, or in a temporary one whose files are sent back.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cloudpickle

from constraints.diagnosis import ContradictionError
from excite.design.design_folder import DESIGN, KIND, TRAJECTORY, write_design
from excite.design.executors.dask_starts import check_versions
from excite.design.formulation import formulate
from excite.design.optimisation import solve
from excite.design.resumed_search import resume_search
from excite.errors import NoFeasibleMotionError
from excite.storage.atomic import read_json, replacing, write_json, writing
from excite.storage.codec import content_of, record_of
from excite.storage.commit import settle
from excite.storage.destination import Destination
from excite.storage.manifest import check_files
from excite.storage.migrations import schema_of
from excite.storage.result_folder import result_folder
from excite.tasks.robot_of_task import installed_robot
from excite.tasks.task import Task
from regressors.errors import ExciteError, InputError
from regressors.quoting import one_line

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


@dataclass(frozen=True)
class CellWork:
    """A cell that is left to design."""

    task: bytes  # pickled, with executor ``serial``
    record: CellRecord
    folder: str = ""  # of the cell; empty where the design is sent back
    fresh: bool = False  # its folder holds starts of another problem, which leave


CellResult = tuple[CellRecord, Mapping[str, bytes]]
"""What came of a cell, and the files of its folder, where it was designed in a temporary one."""


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
            _design(folder, task, fresh=work.fresh)
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


def _design(folder: Path, task: Task, *, fresh: bool) -> None:
    robot = installed_robot(task)
    formulation = formulate(robot, task)
    kept = resume_search(folder, formulation, replace=True, fresh=fresh)
    design = solve(robot, formulation, kept)
    if design.interrupted:
        raise KeyboardInterrupt
    write_design(design, folder, ())
