"""Meshes of a robot's links from its URDF, in the frames of the links of the chain."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from excite.files.mesh import MeshError, mesh_triangles
from excite.files.urdf_shapes import carried_links, mesh_file, numbers_of, placed_shape
from regressors.errors import InputError
from regressors.input_files import read_bytes
from regressors.readers.urdf_elements import XmlElement
from regressors.robot.robot import Robot
from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class LinkMesh:
    """Triangles on a link.

    Parameters
    ----------
    link : str
        Name of a link of the robot, or of the base.
    triangles : ndarray, shape (N, 3, 3)
        Corners in the link's frame [m].
    """

    link: str
    triangles: Array


def urdf_meshes(path: Path, robot: Robot, base: str | None = None, *, snap_angles: bool = True) -> tuple[LinkMesh, ...]:
    """Meshes of the links and of what is fixed to them: of ``<visual>`` where these can be read, else ``<collision>``.

    Files that are missing, or in a format without a reader, are left out.

    Parameters
    ----------
    path : Path
        The URDF.
    robot : Robot
        Read from the same file.
    base : str, optional
        Name of the first link; the root if not given.
    snap_angles : bool
        As the robot was read.

    Raises
    ------
    InputError
        The URDF cannot be read.
    """
    try:
        content = read_bytes(path)
    except OSError as error:
        raise InputError(f"cannot read the URDF file {str(path)!r}: {error.strerror}") from error
    meshes: list[LinkMesh] = []
    for carrier, link, pose in carried_links(content, path, robot, base, snap_angles=snap_angles):
        seen = [_triangles(each, path) for each in link.below("visual")]
        found = [each for each in seen if each is not None]
        if not found:
            found = [each for each in (_triangles(each, path) for each in link.below("collision")) if each is not None]
        meshes += [LinkMesh(carrier, triangles @ pose[:3, :3].T + pose[:3, 3]) for triangles in found]
    return tuple(meshes)


def _triangles(element: XmlElement, path: Path) -> Array | None:
    """Triangles in the link's frame; None of a shape that is no mesh, or one that cannot be read."""
    with suppress(MeshError, InputError, KeyError, ValueError):
        shape, place = placed_shape(element)
        if shape.tag == "mesh":
            corners = mesh_triangles(mesh_file(shape.attributes["filename"], path))
            scaled = corners * numbers_of(shape, "scale", "1 1 1")
            return np.asarray(scaled @ place[:3, :3].T + place[:3, 3])
    return None
