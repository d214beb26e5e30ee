"""Warm start of a search from an earlier design, possibly of another family, duration or limits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from excite.design.designed_motion import DesignedMotion
from excite.information.target import IdentificationTarget
from excite.registry import OwnPart, is_own
from excite.storage.atomic import read_json
from excite.storage.commit import settle
from excite.storage.destination import Destination
from excite.tasks.stored_files import InitialDesign, UnopenedFile
from excite.tasks.task import Task
from excite.trajectories import stored_trajectory
from regressors.errors import InputError
from regressors.samples import Array

_INSTANTS = 1001


def with_initial_design(task: Task) -> Task:
    """The task with the motion itself of the design that it begins with, so that a result can hold it."""
    begin = task.search.begin
    if begin is None or isinstance(begin, InitialDesign):
        return task
    if isinstance(begin, UnopenedFile):
        raise begin.missing()
    if isinstance(begin, DesignedMotion):
        series = {"joints": list(begin.moving.joint_names), **begin.trajectory.family.to_dict(begin.trajectory.x)}
        return task.changed(begin=InitialDesign(begin.name, series, begin.trajectory))
    return task.changed(begin=InitialDesign(str(begin), _series(Path(begin))))


def initial_motion(target: IdentificationTarget, task: Task) -> Array | None:
    """Positions of the moving coordinates in the design that a task starts from; None if it names none.

    The motion keeps its shape over the task's period.
    """
    if task.search.begin is None:
        return None
    begin: InitialDesign = with_initial_design(task).search.begin
    names, wanted = tuple(begin.trajectory.get("joints", ())), target.robot.joint_names
    if names != wanted:
        raise InputError(
            f"{begin.name} moves {', '.join(names)}; the motion to begin with must move {', '.join(wanted)}"
        )
    trajectory = begin.motion or stored_trajectory(begin.trajectory, len(names))
    q = trajectory.samples(np.linspace(0.0, trajectory.duration, _INSTANTS)).q
    motion = target.motion
    return np.asarray((q - motion.offset) @ np.linalg.pinv(motion.matrix).T)


def _series(folder: Path) -> dict[str, Any]:
    """Entries of a design's file that define its motion."""
    path = folder / "design.json"
    settle(Destination(folder))
    if not path.exists():
        raise InputError(f"{folder} is no design folder: there is no {path}")
    content = read_json(path)
    series, task = content.get("trajectory"), content.get("task")
    family = task.get("trajectory") if isinstance(task, dict) else None
    if isinstance(family, str) and is_own(family):
        raise OwnPart("trajectory", family).missing()
    if not isinstance(series, dict):
        raise InputError(f"{path}: not a complete design: 'trajectory' is missing")
    return series
