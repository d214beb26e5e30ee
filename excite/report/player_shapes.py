"""Shapes in the 3D player: meshes of a URDF where it is given, else capsules, else lines through the joints' frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from constraints.collision.geometry import Box, Capsule, HalfSpace, Obstacle, Part, World
from excite.files.urdf_meshes import urdf_meshes
from excite.report.decimation import decimated
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.readers.urdf import read_urdf
from regressors.robot.robot import Robot


def player_shapes(
    robot: Robot, task: Task, shape: World | None, number: Mapping[str, int], robot_file: str | None = None
) -> dict[str, Any]:
    """Entries ``meshes``, ``capsules``, ``objects``, ``drawn_as`` and ``left_out`` of the player's data."""
    world = task.limits.known_world
    known = world if world is not None else shape
    meshes, reasons = ([], ()) if robot_file is None else _meshes(robot, task, robot_file, number)
    parts = () if known is None or meshes else known.parts
    drawn = "meshes of its URDF" if meshes else "capsules" if parts else "lines through the frames of its joints"
    return {
        "meshes": meshes,
        "capsules": [_part(part, number) for part in parts if part.link in number],
        "objects": [_object(each) for own in (world, shape) if own is not None for each in own.obstacles],
        "drawn_as": drawn,
        "left_out": _left_out(reasons),
    }


def matches(robot: Robot, task: Task, robot_file: str) -> bool:
    """True if a URDF describes the robot of a task."""
    try:
        read = read_urdf(robot_file, base=task.base_link, tip=task.tip, snap_angles=task.snap_angles)
    except InputError:
        if Path(robot_file).is_file():
            return False  # a URDF without this chain
        raise
    places = [[(joint.name, joint.kind) for joint in each.joints] for each in (read, robot)]
    return places[0] == places[1] and all(
        np.allclose(a.rotation, b.rotation) and np.allclose(a.translation, b.translation)
        for a, b in zip(read.joints, robot.joints, strict=True)
    )


def _meshes(
    robot: Robot, task: Task, robot_file: str, number: Mapping[str, int]
) -> tuple[list[dict[str, Any]], tuple[str, ...]]:
    """Meshes of few triangles, and what is said of files that are left out."""
    read = urdf_meshes(Path(robot_file), robot, task.base_link, snap_angles=task.snap_angles)
    together = {name: [each.triangles for each in read.meshes if each.link == name] for name in number}
    meshes = [
        {"body": number[name], **decimated(np.concatenate(triangles)).to_dict()}
        for name, triangles in together.items()
        if triangles
    ]
    return meshes, read.left_out


def _left_out(reasons: Sequence[str]) -> str:
    """A sentence on files that are not shown."""
    if not reasons:
        return ""
    more = f"; and {len(reasons) - 1} more" if len(reasons) > 1 else ""
    return f"Some meshes of its URDF are not shown: {reasons[0]}{more}."


def _part(part: Part, number: Mapping[str, int]) -> dict[str, Any]:
    return {"body": number[part.link], **_capsule(part.capsule)}


def _capsule(capsule: Capsule) -> dict[str, Any]:
    return {"from": list(capsule.start), "to": list(capsule.end), "radius": capsule.radius}


def _object(each: Obstacle) -> dict[str, Any]:
    shape = each.shape
    place: dict[str, Any]
    if isinstance(shape, Box):
        place = {"kind": "box", "centre": list(shape.centre), "size": list(shape.size), "rpy": list(shape.rpy)}
    elif isinstance(shape, HalfSpace):
        place = {"kind": "plane", "normal": list(shape.normal), "offset": shape.offset}
    else:
        place = {"kind": "capsule", **_capsule(shape)}
    return {"name": each.name, **place}
