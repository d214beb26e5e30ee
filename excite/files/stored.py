"""Reading of stored JSON files: schema, robot, and errors that name the file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from excite.storage.atomic import read_json
from regressors.errors import InputError
from regressors.robot.archive import robot_from_description
from regressors.robot.robot import Robot


def stored_content(path: Path, schema: str) -> dict[str, Any]:
    """Read the content of a file and check its schema."""
    content = read_json(path)
    if content.get("schema") != schema:
        raise InputError(f"{path}: expected schema {schema}, given {content.get('schema')!r}")
    return content


def stored_robot(content: Mapping[str, Any]) -> Robot:
    """Robot of a file's ``robot`` entry."""
    robot = robot_from_description(content["robot"]["description"])
    if robot.sha256() != content["robot"]["sha256"]:
        raise InputError("the robot's description does not have the hash that the file states")
    return robot
