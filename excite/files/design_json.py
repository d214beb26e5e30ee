"""Designs read back from their ``design.json``: the robot, the task and the motion, for judging them again."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from excite.files.design_folder import DESIGN, SCHEMA
from excite.files.stored import complete, stored_content, stored_robot
from excite.files.task_file import task_from_options
from excite.information.target import moving_robot
from excite.tasks.task import Task
from excite.trajectories import Trajectory, stored_trajectory
from regressors.errors import InputError
from regressors.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class StoredDesign:
    """A design as its file tells it.

    Parameters
    ----------
    folder : Path
    robot, moving : Robot
        The whole robot, and its moving joints with the task's limits.
    task : Task
    trajectory : Trajectory
    content : dict
        The whole file.
    """

    folder: Path
    robot: Robot
    moving: Robot
    task: Task
    trajectory: Trajectory
    content: dict[str, Any]


def read_design(folder: str | Path) -> StoredDesign:
    """Design in a folder, or in a ``design.json``.

    Parameters
    ----------
    folder : path

    Raises
    ------
    InputError
        There is none, it is of another schema, or its robot is not the one that its hash says.
    """
    folder = Path(folder)
    path = folder if folder.suffix == ".json" else folder / DESIGN
    if not path.exists():
        raise InputError(f"{folder} holds no design: there is no {path}")
    content = stored_content(path, SCHEMA)
    with complete(path, "design"):
        robot = stored_robot(content)
        task = task_from_options(content["task"])
        moving = moving_robot(robot, task)
        trajectory = stored_trajectory(content["trajectory"], moving.n)
        float(content["provenance"]["cpu_seconds"])
    return StoredDesign(path.parent, robot, moving, task, trajectory, content)
