"""Designs read back from their ``design.json``: the robot, the task and the motion, for judging them again."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from excite.design.motion_limits import RecomputedLimits
from excite.design.stored_design import StoredDesign
from excite.design.stored_sequence import check_joined
from excite.files.content_hashes import check_motion
from excite.files.design_folder import DESIGN, KIND, SCHEMA, TRAJECTORY
from excite.files.stored import stored_content, stored_robot
from excite.files.stored_task import stored_task
from excite.files.world_file import world_of
from excite.information.target import moving_robot
from excite.registry import OwnPart, is_own
from excite.storage.commit import read_settled
from excite.storage.destination import Destination
from excite.storage.manifest import check_files
from excite.storage.records import complete
from excite.trajectories import stored_trajectory
from excite.trajectories.sequence import WholeRobotMotion
from regressors.arguments import checked
from regressors.errors import InputError


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
