"""The folder of a design: ``design.json``, ``trajectory.csv``, and a file per start."""

from __future__ import annotations

import math
import os
import re
from pathlib import Path
from typing import Any

from excite.design.design import Design
from excite.design.multistart import write_start
from excite.files.content_hashes import HASHES, motion_hashes
from excite.files.task_file import task_content
from excite.files.trajectory_csv import write_trajectory
from excite.information.metrics import CONVENTIONS as MEANINGS
from excite.information.metrics import noise_per_row
from excite.information.weighting import minimised_text
from excite.registry import name_of
from excite.storage.atomic import write_json
from excite.tasks.stored_files import InitialDesign
from regressors.errors import InputError, TakenError

SCHEMA = "excite.design/1"
DESIGN, TRAJECTORY, STARTS = "design.json", "trajectory.csv", "starts"
_REHEARSAL = re.compile(r"trajectory-[0-9.e-]+\.csv")


def prepare_folder(folder: Path, *, replace: bool = False) -> Path:
    """Create a design's folder, and check before any computation that it can be written to.

    Parameters
    ----------
    folder : Path
    replace : bool
        Allow a folder that holds a design, which is replaced when the new one is complete.

    Returns
    -------
    Path
        The folder where starts are kept.

    Raises
    ------
    InputError
        The folder holds a design, is a file, or cannot be written to.
    """
    starts = folder / STARTS
    try:
        if (folder / DESIGN).exists() and not replace:
            raise TakenError(f"{folder} already holds a design")
        starts.mkdir(parents=True, exist_ok=True)
        for old in starts.glob("start-*.json"):
            old.unlink()
    except OSError as error:
        raise InputError(f"cannot write to {folder}: {error.strerror}") from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"cannot write to {folder}: Permission denied")
    return starts


def save_design(design: Design, folder: str | Path, *, replace: bool = False) -> list[Path]:
    """Write a design into a folder, which is created if it does not exist.

    Parameters
    ----------
    design : Design
    folder : path
    replace : bool
        Replace an existing design.

    Returns
    -------
    list of Path
        Files that were written.

    Raises
    ------
    InputError
        The folder holds a design, or cannot be written to.
    """
    starts = prepare_folder(Path(folder), replace=replace)
    for start in design.starts:
        write_start(starts, start)
    return write_design(design, Path(folder))


def write_design(design: Design, folder: Path) -> list[Path]:
    """Write a design's files; ``design.json`` comes last and marks the folder as complete.

    Parameters
    ----------
    design : Design
    folder : Path
        An existing folder.

    Returns
    -------
    list of Path
        Files that were written.
    """
    trajectory = folder / TRAJECTORY
    rehearsals = {folder / rehearsal_name(speed): speed for speed in design.task.output.speed}
    for old in folder.glob("trajectory-*.csv"):
        if old not in rehearsals and _REHEARSAL.fullmatch(old.name):
            old.unlink()  # of the design that is replaced
    write_trajectory(design, trajectory)
    for path, speed in rehearsals.items():
        write_trajectory(design, path, speed)
    hashes = motion_hashes(trajectory_entry(design), (trajectory, *rehearsals))
    write_json(folder / DESIGN, {**design_content(design), HASHES: hashes})
    return [folder / DESIGN, trajectory, *rehearsals]


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
        "trajectory": trajectory_entry(design),
        "criteria": {name: _finite(value) for name, value in design.criteria.items()},
        "conventions": MEANINGS,
        "minimised": minimised_text(design.task),
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
        **(design.approach_and_return.to_dict() if design.approach_and_return is not None else {}),
    }


def _solver(design: Design) -> dict[str, Any]:
    return {
        "name": name_of(design.task.search.solver),
        "best_start": design.best_start,
        "starts": [
            {
                "index": start.index,
                "value": start.value,
                "status": start.status,
                "iterations": len(start.history),
                "evaluations": start.evaluations,
                "cpu_seconds": start.cpu,
            }
            for start in design.starts
        ],
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
