"""Designs as JSON, and the tasks that they store."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from excite.design.motion_limits import RecomputedLimits
from excite.design.stored_design import StoredDesign, check_joined
from excite.files.content_hashes import check_motion
from excite.files.design_folder import DESIGN, KIND, SCHEMA, TRAJECTORY
from excite.files.earlier_content import earlier_of_content
from excite.files.stored import stored_content, stored_robot
from excite.files.task_file import task_from_options
from excite.files.world_file import world_of
from excite.information.target import moving_robot
from excite.registry import OwnPart, is_own
from excite.storage.commit import read_settled
from excite.storage.destination import Destination
from excite.storage.manifest import check_files
from excite.storage.records import complete
from excite.tasks.stored_files import InitialDesign, StoredRobot
from excite.tasks.task import Task
from excite.trajectories import stored_trajectory
from excite.trajectories.sequence import WholeRobotMotion
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.readers.library import built_in_names
from regressors.robot.robot import Robot


@checked
def load_design(folder: str | Path, part: str | Collection[str] = (), **own: Any) -> StoredDesign:
    """Load the design in a folder, or in a ``design.json``.

    Parameters
    ----------
    folder : path
    part : str or collection of str
        User-defined parts, as ``module:Name``, that may be imported if the design names them.
    **own
        Options of the task that replace those of the file. User-defined parts, as objects: ``model``, ``trajectory``,
        ``criterion``, ``solver``, ``constraints`` (all of them); files only name such parts, and nothing else is
        imported for them. And files that a design names without their content, such as ``world``: they are not opened
        either.

    Raises
    ------
    InputError
        There is no design, it has another schema, its robot, its coefficients or a file of its motion do not match
        their hash, or its trajectory belongs to a user-defined family that is not given. Other missing parts and files
        raise an error where they are needed.
    """
    folder = Path(folder)
    path = folder if folder.suffix == ".json" else folder / DESIGN
    allowed = (part,) if isinstance(part, str) else part
    return read_settled(Destination(path.parent), lambda: _design(folder, path, allowed, own))


def _design(folder: Path, path: Path, allowed: Collection[str], own: dict[str, Any]) -> StoredDesign:
    if not path.exists():
        raise InputError(f"{folder} holds no design: there is no {path}")
    content = stored_content(path, SCHEMA)
    with complete(path, "design"):
        robot = stored_robot(content)
        task = stored_task(content, robot, allowed, own)
        chosen = task.trajectory.trajectory
        if isinstance(chosen, OwnPart):
            raise chosen.missing()
        family = None if isinstance(chosen, str) and not is_own(chosen) else task.trajectory.family()
        trajectory = stored_trajectory(content["trajectory"], moving_robot(robot, task).n, family)
        check_motion(content, path.parent)
        float(content["provenance"]["cpu_seconds"])
        if "condition_number" not in content["criteria"]:
            raise KeyError("condition_number")
        shape = None if content.get("shape") is None else world_of(content["shape"], "the shape of the design")
        design = StoredDesign(path.parent, robot, task, trajectory, content, shape)
        RecomputedLimits.of(content)  # entries that are missing are named here
        _check_joined(design)
    if path.name == DESIGN:
        check_files(path.parent, KIND, (DESIGN, TRAJECTORY))
    return design


def _check_joined(design: StoredDesign) -> None:
    """Refuse a motion that is not the one that the approach and the return of the file were made for."""
    if design.transfers is not None:
        whole = WholeRobotMotion(design.trajectory, design.task.limits.applied(design.robot), design.moving.joint_names)
        check_joined(design.transfers, whole.samples(np.array([0.0, whole.duration])).q)


def stored_task(content: Mapping[str, Any], robot: Robot, allowed: Collection[str], own: Mapping[str, Any]) -> Task:
    """The task of a design or a result.

    A robot that is not built in is the one that the file describes, so that the task can be run again without the file
    that it was read from.
    """
    options, shape = dict(content["task"]), content.get("shape")
    if str(options["robot"]) not in built_in_names():
        options["robot"] = StoredRobot(
            str(options["robot"]), robot, None if shape is None else world_of(shape, "shape of the robot")
        )
    elif shape is None and not robot.shapes:  # built in, of a time when the built-in robots had none
        options["self_collision"] = False
    if content.get("begins_with") is not None:
        options["begin"] = InitialDesign(str(options.get("begin")), content["begins_with"])
    if content.get("after") is not None:
        options["after"] = [earlier_of_content(each) for each in content["after"]]
    return task_from_options(options, stored=True, allowed=allowed, **own)
