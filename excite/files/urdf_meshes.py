"""Meshes of a robot's links from its URDF, in the frames of the links of the chain."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from excite.files.collada_mesh import collada_triangles
from excite.files.mesh import MeshError, mesh_triangles
from excite.files.urdf_shapes import carried_links, mesh_file, numbers_of, placed_shape
from regressors.errors import InputError
from regressors.input_files import read_bytes
from regressors.memory_cap import memory_cap
from regressors.readers.urdf_elements import XmlElement
from regressors.robot.robot import Robot
from regressors.samples import Array

_HELD = 4.0  # bytes at the same time for each byte of the triangles


@dataclass(frozen=True, eq=False)
class LinkMesh:
    """Triangles on a link."""

    link: str  # name of a link of the robot, or of the base
    triangles: Array  # (N, 3, 3) corners in the link's frame [m]


@dataclass(frozen=True, eq=False)
class UrdfMeshes:
    """Meshes of a robot."""

    meshes: tuple[LinkMesh, ...]
    left_out: tuple[str, ...]  # files that are missing, damaged, or in a format without a reader, and why


def urdf_meshes(path: Path, robot: Robot, base: str | None = None, *, snap_angles: bool = True) -> UrdfMeshes:
    """Meshes of the links and what is fixed to them: ``<visual>`` where it can be read, else ``<collision>``."""
    try:
        content = read_bytes(path)
    except OSError as error:
        raise InputError(f"cannot read the URDF file {str(path)!r}: {error.strerror}") from error
    meshes, left_out, left = list[LinkMesh](), dict[str, None](), memory_cap()
    for carrier, link, pose in carried_links(content, path, robot, base, snap_angles=snap_angles):
        for tag in ("visual", "collision"):
            found = []
            for each in link.below(tag):
                triangles = _triangles(each, path, left_out, left)
                if triangles is not None:
                    found.append(triangles)
                    left -= _HELD * triangles.nbytes
            meshes += [LinkMesh(carrier, triangles @ pose[:3, :3].T + pose[:3, 3]) for triangles in found]
            if found:
                break
    return UrdfMeshes(tuple(meshes), tuple(left_out))


def _triangles(element: XmlElement, path: Path, left_out: dict[str, None], left: float) -> Array | None:
    """Triangles in the link's frame; None of a shape that is no mesh, or that is not read, which is noted."""
    try:
        shape, place = placed_shape(element)
        if shape.tag == "mesh":
            file = mesh_file(shape.attributes["filename"], path)
            read = collada_triangles if file.suffix.lower() == ".dae" else mesh_triangles
            triangles = read(file)
            if _HELD * triangles.nbytes > left:
                raise MeshError(f"{file}: its {len(triangles)} triangles go beyond the memory that all meshes may take")
            scaled = triangles * numbers_of(shape, "scale", "1 1 1")
            return np.asarray(scaled @ place[:3, :3].T + place[:3, 3])
    except (MeshError, InputError, KeyError, ValueError) as error:
        left_out[str(error)] = None
    return None
