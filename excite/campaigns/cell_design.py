"""Design of one cell, in any process: in its folder, or in a temporary one whose files are sent back."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import cloudpickle

from constraints.feasibility.diagnosis import ContradictionError
from excite.campaigns.cell_folder import FAILED, INFEASIBLE, CellRecord, packed, write_cell
from excite.design.formulation import formulate
from excite.design.optimisation import solve
from excite.errors import NoFeasibleMotionError
from excite.executors.dask_starts import check_versions
from excite.files.design_folder import write_design
from excite.files.resumed_search import resume_search
from excite.storage.result_folder import result_folder
from excite.tasks.robot_of_task import installed_robot
from excite.tasks.task import Task
from regressors.errors import ExciteError
from regressors.quoting import one_line


@dataclass(frozen=True)
class CellWork:
    """A cell that is left to design."""

    task: bytes  # pickled, with executor ``serial``
    record: CellRecord
    folder: str = ""  # of the cell; empty where the design is sent back
    fresh: bool = False  # its folder holds starts of another problem, which leave


@dataclass(frozen=True)
class CellResult:
    """What came of a cell."""

    record: CellRecord
    files: Mapping[str, bytes] = field(default_factory=dict)  # of its folder, where it was designed in a temporary one


def pickled_task(task: Task) -> bytes:
    """A task whose starts run one after the other, for another process."""
    return bytes(cloudpickle.dumps(task.changed(executor="serial", workers=None)))


def design_cell(versions: Mapping[str, str], work: CellWork) -> CellResult:
    """Design a cell and write its folder, whatever comes of it."""
    check_versions(dict(versions))
    task = cloudpickle.loads(work.task)
    if work.folder:
        return CellResult(_design_in(Path(work.folder), task, work))
    with tempfile.TemporaryDirectory() as temporary:
        record = _design_in(Path(temporary), task, work)
        return CellResult(record, packed(Path(temporary)))


def _design_in(folder: Path, task: Task, work: CellWork) -> CellRecord:
    with result_folder(folder):
        write_cell(folder, work.record)
        try:
            _design(folder, task, fresh=work.fresh)
        except Exception as error:  # whatever it is, the other cells run
            record = replace(work.record, status=_status(error), reason=_reason(error))
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


def _status(error: Exception) -> str:
    return INFEASIBLE if isinstance(error, ContradictionError | NoFeasibleMotionError) else FAILED


def _reason(error: Exception) -> str:
    text = str(error) or "no reason given"
    return one_line(text if isinstance(error, ExciteError) else f"{type(error).__name__}: {text}")
