"""Shapes in the 3D player: meshes of a URDF where it is given, else capsules, else lines through the joints' frames."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from constraints.collision.geometry import Box, Capsule, HalfSpace, Obstacle, Part
from excite.design.design import Design
from excite.design.designed_motion import DesignedMotion
from excite.files.urdf_meshes import urdf_meshes
from excite.report.decimation import decimated
from regressors.errors import InputError
from regressors.readers.urdf import read_urdf
from regressors.robot.robot import Robot


def player_shapes(
    design: Design, robot: Robot, number: Mapping[str, int], robot_file: str | None = None
) -> dict[str, Any]:
    """Entries ``meshes``, ``capsules``, ``objects`` and ``drawn_as`` of the player's data.

    Parameters
    ----------
    design : Design
    robot : Robot
    number : mapping of str to int
        Number of each body in the player.
    robot_file : str, optional
        URDF of the robot, whose meshes are shown.

    Raises
    ------
    InputError
        The URDF cannot be read.
    """
    world = design.task.limits.known_world
    shape = world if world is not None else design.shape
    meshes = [] if robot_file is None else _meshes(design, robot_file, number)
    parts = () if shape is None or meshes else shape.parts
    drawn = "meshes of its URDF" if meshes else "capsules" if parts else "lines through the frames of its joints"
    return {
        "meshes": meshes,
        "capsules": [_part(part, number) for part in parts if part.link in number],
        "objects": [_object(each) for each in (() if world is None else world.obstacles)],
        "drawn_as": drawn,
    }


def matches(design: DesignedMotion, robot_file: str) -> bool:
    """True if a URDF describes the robot of a design.

    Raises
    ------
    InputError
        It cannot be read.
    """
    task = design.task
    try:
        read = read_urdf(robot_file, base=task.base_link, tip=task.tip, snap_angles=task.snap_angles)
    except InputError:
        if Path(robot_file).is_file():
            return False  # a URDF without this chain
        raise
    places = [[(joint.name, joint.kind) for joint in each.joints] for each in (read, design.robot)]
    return places[0] == places[1] and all(
        np.allclose(a.rotation, b.rotation) and np.allclose(a.translation, b.translation)
        for a, b in zip(read.joints, design.robot.joints, strict=True)
    )


def _meshes(design: Design, robot_file: str, number: Mapping[str, int]) -> list[dict[str, Any]]:
    task = design.task
    read = urdf_meshes(Path(robot_file), design.robot, task.base_link, snap_angles=task.snap_angles)
    together = {name: [each.triangles for each in read if each.link == name] for name in number}
    return [
        {"body": number[name], **decimated(np.concatenate(triangles)).to_dict()}
        for name, triangles in together.items()
        if triangles
    ]


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
