"""The folder of a design: ``design.json``, ``trajectory.csv``, and a file per start."""

from __future__ import annotations

import csv
import re
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from excite.design.design import Design
from excite.design.start_results import write_start
from excite.design.starts import remove_starts, remove_temporary
from excite.design.task_file import task_content
from excite.information.precision_forecast import PrecisionSearch
from excite.storage.atomic import NEXT, replacing, write_json, writing
from excite.storage.codec import content_of
from excite.storage.manifest import check_files, sha256_of
from excite.storage.migrations import schema_of
from excite.storage.records import read_record
from excite.storage.result_folder import check_not_taken, figure_names, replace_result, result_folder
from excite.storage.sampled_motion import motion_columns, write_motion_table
from excite.tasks.option import NONE
from excite.tasks.stored_files import EarlierInformation, InitialDesign
from excite.tasks.task import Task
from regressors.numerical import or_none
from regressors.samples import Array

KIND = "design"
SCHEMA = schema_of(KIND)
HASHES = "sha256"  # entry by which an edited motion is found: of its coefficients, and of the files that play it
DESIGN, TRAJECTORY, STARTS = "design.json", "trajectory.csv", "starts"
_FIGURES, _WORLD_FIGURES = ("motion", "phase", "spectrum", "convergence"), ("clearance", "workspace")
_REHEARSAL = re.compile(r"trajectory-[0-9.e-]+\.csv")


def check_no_design(folder: Path, names: Collection[str], *, replace: bool = False) -> None:
    """Raise `TakenError` where a folder holds a design, or a user's own file under one of the given names."""
    check_not_taken(folder, DESIGN, "a design", names, replace=replace)


def data_files(task: Task) -> list[str]:
    """Names of a design's files beside the figures, ``design.json`` first."""
    searched = (PRECISION, PRECISION_TABLE) if seeks_precision(task) else ()
    return [DESIGN, TRAJECTORY, *searched, *(rehearsal_name(speed) for speed in task.output.speed)]


def figure_files(task: Task, formats: Collection[str] = ("png",)) -> list[str]:
    """Names of a design's figures."""
    own = ("precision",) if seeks_precision(task) else ()
    if task.limits.world is not None:
        own = (*own, *_WORLD_FIGURES)
    elif task.limits.floor != NONE:
        own = (*own, "workspace")
    return figure_names((*_FIGURES, *own), formats)


def starts_folder(folder: Path) -> Path:
    """Make the folder for the starts of a search.

    Starts of a design that is to be replaced stay until the new one is complete, so that those of the new one go to a
    hidden folder until then.
    """
    starts = folder / NEXT / STARTS if (folder / DESIGN).exists() else folder / STARTS
    with writing(starts):
        starts.mkdir(parents=True, exist_ok=True)
        remove_temporary(starts)
    return starts


def save_design(design: Design, folder: str | Path, *, replace: bool = False) -> list[Path]:
    """Write a design into a folder, which is created if it does not exist."""
    folder = Path(folder)
    with result_folder(folder):
        check_no_design(folder, data_files(design.task), replace=replace)
        write_starts(design, folder)
        return write_design(design, folder)


def write_starts(design: Design, folder: Path) -> None:
    """Write the starts of a design into its folder, in place of those that are there."""
    starts = starts_folder(folder)
    remove_starts(starts)
    for start in design.starts:
        write_start(starts, start)


def write_design(design: Design, folder: Path, figures: Collection[str] | None = None) -> list[Path]:
    """Write a design's files, and replace an older design, all at once."""
    searched = (PRECISION, PRECISION_TABLE) if design.precision_search is not None else ()
    names = list(dict.fromkeys((*data_files(design.task), *searched)))
    older = _older_files(folder)
    run = None if (stated := design.provenance.get("run")) is None else str(stated)
    with replace_result(folder, KIND, run=run, older=older, folders=(STARTS,), figures=figures) as staged:
        write_trajectory(design, staged / TRAJECTORY)
        for speed in design.task.output.speed:
            write_trajectory(design, staged / rehearsal_name(speed), speed)
        if design.precision_search is not None:
            _write_precision(design.precision_search, staged)
        files = {file.name: sha256_of(file) for file in sorted(staged.glob("trajectory*.csv"))}
        hashes = {"trajectory": design.coefficients_sha256, "files": files}
        write_json(staged / DESIGN, {**design_content(design), HASHES: hashes})
    return [folder / name for name in names]


def _older_files(folder: Path) -> list[str]:
    """Files of a design that was written without a manifest."""
    if not (folder / DESIGN).exists():
        return []
    rehearsals = [path.name for path in folder.glob("trajectory-*.csv") if _REHEARSAL.fullmatch(path.name)]
    return [*rehearsals, *figure_names((*_FIGURES, *_WORLD_FIGURES))]


def rehearsal_name(speed: float) -> str:
    """Name of the file of the same motion at a fraction of full speed, such as ``trajectory-0.1.csv``."""
    return f"trajectory-{speed:.12g}.csv"


PRECISION_KIND, PRECISION, PRECISION_TABLE = "precision", "precision.json", "precision.csv"
_HEAD = ("period", "runs", "robot_seconds", "largest_use")


def seeks_precision(task: Task) -> bool:
    """Whether a task asks for the shortest experiment that meets a precision, not for one motion at its period."""
    return task.objective.precision is not None and task.objective.scale != "precision"


def _write_precision(search: PrecisionSearch, folder: Path) -> None:
    """Write both files of a design's search for a precision."""
    write_json(folder / PRECISION, {"schema": schema_of(PRECISION_KIND), **content_of(search)[0]})
    with replacing(folder / PRECISION_TABLE) as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(_HEAD)
        writer.writerows((repr(p.period), p.runs, repr(p.robot_seconds), repr(p.use)) for p in search.front)


def load_precision_search(folder: Path) -> PrecisionSearch | None:
    """The search for a precision of the design in a folder; None without one."""
    path = folder / PRECISION
    if not path.exists():
        return None
    check_files(folder, KIND, (PRECISION,))
    return read_record(path, PrecisionSearch, PRECISION_KIND)


def design_content(design: Design) -> dict[str, Any]:
    """Content of ``design.json``; of a design that was loaded, with what is computed from its coefficients."""
    design = design.stored()
    begin, after = design.task.search.begin, design.task.objective.after
    return {
        "schema": SCHEMA,
        **content_of(design)[0],
        "task": task_content(design.task),
        **({"begins_with": dict(begin.trajectory)} if isinstance(begin, InitialDesign) else {}),
        **({"after": [_earlier(each) for each in after]} if after else {}),
        "trajectory": design.series,
        "criteria": {name: or_none(value) for name, value in design.criteria.items()},
        "minimised_value": or_none(design.minimised_value),
        "played": _sequence(design),
    }


def _sequence(design: Design) -> dict[str, Any]:
    """Segments of trajectory.csv, approach and return with their limits, and the rehearsals."""
    sequence = design.sequence
    speeds = {rehearsal_name(wanted): sequence.speed(wanted) for wanted in design.task.output.speed}
    return {
        "rate": design.task.output.rate,
        "duration": sequence.duration,
        "segments": [{"name": name, "start": start, "end": end} for name, (start, end) in sequence.spans().items()],
        "rehearsals": [
            {"file": name, "speed": speed, "duration": sequence.duration / speed} for name, speed in speeds.items()
        ],
        "between_samples": [each.to_dict() for each in design.between_samples],
        **(design.approach_and_return.to_dict() if design.approach_and_return is not None else {}),
    }


def _earlier(earlier: EarlierInformation) -> dict[str, Any]:
    """Information in hand with the hash of its file, so that the task can be run again without the folder."""
    values = None if earlier.values is None else [or_none(float(x)) for x in earlier.values]
    factors = [_sparse(F) for F in earlier.factors]
    return {**vars(earlier), "A": _sparse(earlier.A), "factors": factors, "values": values}


def _sparse(A: Array) -> dict[str, Any]:
    """A matrix as its shape, and the places and values of what is not zero."""
    rows, columns = np.nonzero(A)
    return {"shape": list(A.shape), "rows": rows.tolist(), "columns": columns.tolist(), "values": A[A != 0.0].tolist()}


def shown_content(design: Design) -> dict[str, Any]:
    """What a terminal shows of a design as JSON."""
    left_out = ("schema", "robot", "solver", "conventions")
    return {name: each for name, each in design_content(design).items() if name not in left_out}


def write_trajectory(design: Design, path: Path, speed: float = 1.0) -> None:
    """Write the motion of a design; with approach and return, a last column ``segment`` is added."""
    samples, segments = design.sequence.sampled(speed)
    header, table = motion_columns(design.robot.joint_names, samples)
    write_motion_table(path, header, table, None if design.approach_and_return is None else segments)
