"""Designs read back from their ``design.json``: the robot, the task and the motion, for judging them again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from excite.design.stored_design import StoredDesign
from excite.files.design_folder import DESIGN, SCHEMA
from excite.files.stored import complete, stored_content, stored_robot
from excite.files.task_file import task_from_options
from excite.information.target import moving_robot
from excite.registry import OwnPart
from excite.tasks.trajectory_choice import TrajectoryChoice
from excite.trajectories import stored_trajectory
from regressors.errors import InputError


def load_design(folder: str | Path, **own: Any) -> StoredDesign:
    """Design in a folder, or in a ``design.json``.

    Parameters
    ----------
    folder : path
    **own
        Parts of a user's own that the design was made with, as objects: ``model``, ``trajectory``, ``criterion``,
        ``solver``, ``constraints`` (all of them). Files name them only; nothing is imported on their behalf.

    Raises
    ------
    InputError
        There is none, it is of another schema, or its robot is not the one that its hash says; or its trajectory is
        of a user's own family that is not given. Other parts are missed where they are needed.
    """
    folder = Path(folder)
    path = folder if folder.suffix == ".json" else folder / DESIGN
    if not path.exists():
        raise InputError(f"{folder} holds no design: there is no {path}")
    content = stored_content(path, SCHEMA)
    with complete(path, "design"):
        robot = stored_robot(content)
        task = task_from_options(content["task"], stored=True, **own)
        family = TrajectoryChoice(own["trajectory"]).family() if own.get("trajectory") is not None else None
        if isinstance(task.trajectory.trajectory, OwnPart):
            raise task.trajectory.trajectory.missing()
        trajectory = stored_trajectory(content["trajectory"], moving_robot(robot, task).n, family)
        float(content["provenance"]["cpu_seconds"])
        if "condition_number" not in content["criteria"]:
            raise KeyError("condition_number")
    return StoredDesign(path.parent, robot, task, trajectory, content)
