"""The folder of a design: ``design.json``, ``trajectory.csv``, and a file per start."""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from dataclasses import asdict
from pathlib import Path
from typing import Any

from excite.design.design import Design
from excite.design.kept_starts import remove_starts, remove_temporary
from excite.design.start_results import write_start
from excite.files.content_hashes import HASHES, motion_hashes
from excite.files.earlier_content import earlier_content
from excite.files.precision_files import CONTENT, FIGURE, TABLE, seeks_precision, write_precision
from excite.files.sampled_motion import write_trajectory
from excite.files.task_file import task_content
from excite.information.metrics import CONVENTIONS as MEANINGS
from excite.information.metrics import noise_per_row
from excite.information.weighting import minimised_text
from excite.registry import name_of
from excite.storage.atomic import write_json, writing
from excite.storage.destination import NEXT
from excite.storage.figure_names import figure_names
from excite.storage.result_folder import check_not_taken, replace_result, result_folder
from excite.tasks.stored_files import InitialDesign
from excite.tasks.task import Task
from excite.tasks.values import NONE

SCHEMA = "excite.design/1"
KIND = "design"
DESIGN, TRAJECTORY, STARTS = "design.json", "trajectory.csv", "starts"
_FIGURES, _WORLD_FIGURES = ("motion", "phase", "spectrum", "convergence"), ("clearance", "workspace")
_REHEARSAL = re.compile(r"trajectory-[0-9.e-]+\.csv")


def check_no_design(folder: Path, names: Collection[str], *, replace: bool = False) -> None:
    """Raise `TakenError` where a folder holds a design, or a user's own file under one of the given names."""
    check_not_taken(folder, DESIGN, "a design", names, replace=replace)


def data_files(task: Task) -> list[str]:
    """Names of a design's files beside the figures, ``design.json`` first."""
    searched = (CONTENT, TABLE) if seeks_precision(task) else ()
    return [DESIGN, TRAJECTORY, *searched, *(rehearsal_name(speed) for speed in task.output.speed)]


def figure_files(task: Task, formats: Collection[str] = ("png",)) -> list[str]:
    """Names of a design's figures."""
    own = (FIGURE,) if seeks_precision(task) else ()
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
    searched = (CONTENT, TABLE) if design.precision_search is not None else ()
    names = [*data_files(design.task), *searched]
    older = _older_files(folder)
    run = design.provenance.get("run")
    run = None if run is None else str(run)
    with replace_result(folder, KIND, run=run, older=older, folders=(STARTS,), figures=figures) as staged:
        write_trajectory(design, staged / TRAJECTORY)
        for speed in design.task.output.speed:
            write_trajectory(design, staged / rehearsal_name(speed), speed)
        if searched:
            write_precision(design, staged)
        hashes = motion_hashes(trajectory_entry(design), sorted(staged.glob("trajectory*.csv")))
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


def design_content(design: Design) -> dict[str, Any]:
    """Content of ``design.json``."""
    base = design.base
    return {
        "schema": SCHEMA,
        "feasible": design.feasible,
        "interrupted": design.interrupted,
        "notes": list(design.notes),
        "robot": {
            "name": design.robot.name,
            "sha256": design.robot.sha256(),
            "description": design.robot.description(),
        },
        "task": task_content(design.task),
        "shape": None if design.shape is None else design.shape.to_dict(),
        **_beginning(design),
        **_in_hand(design),
        "trajectory": trajectory_entry(design),
        "criteria": {name: _finite(value) for name, value in design.criteria.items()},
        "conventions": MEANINGS,
        "minimised": minimised_text(design.task),
        "minimised_value": _finite(design.minimised_value),
        "limits": [use.to_dict() for use in design.limits],
        "unchecked": [{"limit": each.limit, "reason": each.reason} for each in design.unchecked],
        "played": _sequence(design),
        "base": {
            "rank": base.rank,
            "gap": _finite(base.gap),
            "columns": list(base.names),
            "expressions": list(base.expressions),
            "units": list(base.units),
            "singular_values": design.spectrum.tolist(),
        },
        "predicted": {
            "noise": noise_per_row(design.task.objective.noise, design.target.model).tolist(),
            "equations": [list(label) for label in design.target.model.row_labels],
            "parameters": [prediction.to_dict() for prediction in design.predicted],
            **({"prior": [vars(known) for known in design.prior]} if design.prior else {}),
            "nearly_unidentifiable": [
                {**vars(hardly), "together": list(hardly.together)} for hardly in design.nearly_unidentifiable
            ],
        },
        **({"precision": design.precision.to_dict()} if design.precision is not None else {}),
        "solver": _solver(design),
        "provenance": design.provenance,
    }


def trajectory_entry(design: Design) -> dict[str, Any]:
    """Entry ``trajectory``: the joints that move, the family, and its coefficients."""
    return {"joints": list(design.moving.joint_names), **design.trajectory.family.to_dict(design.trajectory.x)}


def _beginning(design: Design) -> dict[str, Any]:
    """The motion that the search began with, so that it can be run again without the folder of that design."""
    begin = design.task.search.begin
    return {"begins_with": dict(begin.trajectory)} if isinstance(begin, InitialDesign) else {}


def _in_hand(design: Design) -> dict[str, Any]:
    """The information in hand, so that the task can be run again without the folders that it is from."""
    after = design.task.objective.after
    return {"after": [earlier_content(each) for each in after]} if after else {}


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


def _solver(design: Design) -> dict[str, Any]:
    return {
        "name": name_of(design.task.search.solver),
        "best_start": design.best_start,
        "starts": [
            {
                "index": start.index,
                "value": _finite(start.value),
                "status": start.status,
                "iterations": len(start.history),
                "evaluations": start.evaluations,
                "cpu_seconds": start.cpu,
            }
            for start in design.starts
        ],
        **({"further_starts": design.further_starts} if design.further_starts else {}),
        **({"search": asdict(design.search)} if design.search is not None else {}),
        **({"harmonics": [vars(trial) for trial in design.harmonics_trials]} if design.harmonics_trials else {}),
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
