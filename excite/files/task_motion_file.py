"""Task motions from files: that of a design's folder, or a table in the format of ``trajectory.csv``."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from excite.design.given_task_motion import INSTANTS, task_motion_of
from excite.files.design_json import load_design
from excite.files.sampled_motion import read_table
from excite.tasks.task_motion import TaskMotion
from regressors.errors import InputError

_COLUMNS = ("position", "velocity", "acceleration")


def read_task_motion(place: str | Path) -> TaskMotion:
    """Read the motion whose torques a design is to predict."""
    path = Path(place)
    if path.suffix != ".csv":
        return task_motion_of(load_design(path))
    header, table, _ = read_table(path, _COLUMNS)
    joints = [name.removesuffix(".position") for name in header if name.endswith(".position")]
    wanted = [[f"{joint}.{what}" for joint in joints] for what in _COLUMNS]
    missing = [name for names in wanted for name in names if name not in header]
    if not joints or missing or not len(table):
        lacking = ", ".join(missing[:3]) or ("rows" if joints else "columns NAME.position of joints")
        raise InputError(f"task_motion {path}: {lacking} missing; expected the columns of trajectory.csv")
    rows = np.unique(np.linspace(0, len(table) - 1, min(INSTANTS, len(table))).round().astype(int))
    q, dq, ddq = (table[rows][:, [header.index(name) for name in names]] for names in wanted)
    return TaskMotion(str(place), tuple(joints), q, dq, ddq)
