"""Warm start of a search from an earlier design, possibly of another family, duration or limits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from excite.information.target import IdentificationTarget
from excite.storage.atomic import read_json
from excite.tasks.task import Task
from excite.trajectories import stored_trajectory
from regressors.errors import InputError
from regressors.samples import Array

_INSTANTS = 1001


def initial_motion(target: IdentificationTarget, task: Task) -> Array | None:
    """Positions of the moving coordinates in the design that a task starts from; None if it names none.

    The motion keeps its shape over the task's period.

    Parameters
    ----------
    target : IdentificationTarget
        Identification target of the task.
    task : Task

    Returns
    -------
    ndarray, shape (N, k), or None
        At equal steps from the beginning to the end [rad or m].

    Raises
    ------
    InputError
        No such design, or it moves other joints.
    """
    if task.search.begin is None:
        return None
    series = _series(Path(task.search.begin))
    names, wanted = tuple(series.get("joints", ())), target.robot.joint_names
    if names != wanted:
        raise InputError(
            f"{task.search.begin} moves {', '.join(names)}; the motion to begin with must move {', '.join(wanted)}"
        )
    trajectory = stored_trajectory(series, len(names))
    q = trajectory.samples(np.linspace(0.0, trajectory.duration, _INSTANTS)).q
    motion = target.motion
    return np.asarray((q - motion.offset) @ np.linalg.pinv(motion.matrix).T)


def _series(folder: Path) -> dict[str, Any]:
    """Entries of a design's file that define its motion."""
    path = folder / "design.json"
    if not path.exists():
        raise InputError(f"{folder} is no design folder: there is no {path}")
    series = read_json(path).get("trajectory")
    if not isinstance(series, dict):
        raise InputError(f"{path}: not a complete design: 'trajectory' is missing")
    return series
