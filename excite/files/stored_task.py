"""The task in a file of results, with the robot, shape and initial motion that it holds; no other file is opened."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from excite.files.earlier_content import earlier_of_content
from excite.files.task_file import task_from_options
from excite.files.world_file import world_of
from excite.tasks.stored_files import InitialDesign, StoredRobot
from excite.tasks.task import Task
from regressors.readers.library import built_in_names
from regressors.robot.robot import Robot


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
