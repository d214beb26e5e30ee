"""Shape of a robot from its URDF: capsules around ``<collision>`` elements, and meshes in the frames of its links."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from constraints.collision.geometry import Capsule, Part, enclosing_capsule, enclosing_cylinder
from constraints.collision.mesh import MeshError, collada_triangles, mesh_corners, mesh_triangles
from regressors.errors import InputError
from regressors.input_files import read_bytes
from regressors.memory_cap import memory_cap
from regressors.readers.chain_ends import resting_pose
from regressors.readers.urdf_elements import XmlElement, robot_element
from regressors.readers.urdf_tree import UrdfTree, parse_tree
from regressors.robot.inertia import rotation_from_rpy
from regressors.robot.robot import BASE, Robot
from regressors.samples import Array

_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def urdf_shape(
    path: Path, robot: Robot, base: str | None = None, *, snap_angles: bool = True
) -> tuple[tuple[Part, ...], tuple[tuple[str, str], ...]]:
    """One capsule around every ``<collision>`` of the robot's links and of the links fixed to them.

    A sphere stays a sphere; a box and a mesh get a small capsule around all their corners; a cylinder one that contains
    its flat ends. Links above the base, or below it on other branches, count as part of the base.
    """
    parts, left_out = [], []
    for carrier, link, pose in carried_links(path, robot, base, snap_angles=snap_angles):
        name = link.attributes["name"]
        for element in link.below("collision"):
            try:
                shape, place = placed_shape(element)
                parts.append(Part(carrier, _around(shape, path).moved(pose @ place)))
            except MeshError as error:
                left_out.append((carrier, f"{path.name}: link {name!r}, <collision>: {error}"))
            except (InputError, KeyError, ValueError) as error:
                reason = f"{error} is missing" if isinstance(error, KeyError) else error
                raise InputError(f"{path.name}: link {name!r}, <collision>: {reason}") from error
    if not parts and not left_out:
        raise InputError(f"{path.name}: no link has a <collision> element to take the robot's shape from")
    return tuple(parts), tuple(left_out)


def lowest_point(
    path: Path, robot: Robot, base: str | None, normal: Array, *, snap_angles: bool = True
) -> float | None:
    """Least height of the base's ``<collision>`` shapes themselves along a direction; None if it has none [m]."""
    # normal (3,)
    heights = []
    for carrier, link, pose in carried_links(path, robot, base, snap_angles=snap_angles):
        for element in link.below("collision") if carrier == BASE else ():
            shape, place = placed_shape(element)
            with contextlib.suppress(InputError, KeyError, ValueError):
                heights.append(_lowest(shape, path, pose @ place, normal))
    return min(heights, default=None)


def _lowest(shape: XmlElement, path: Path, pose: Array, normal: Array) -> float:
    given, up = shape.attributes, pose[:3, :3].T @ normal
    if shape.tag == "sphere":
        least = -float(given["radius"])
    elif shape.tag == "cylinder":
        least = -float(given["radius"]) * np.hypot(up[0], up[1]) - 0.5 * float(given["length"]) * abs(up[2])
    elif shape.tag == "box":
        least = float((_CORNERS * numbers_of(shape, "size", "") @ up).min())
    else:
        corners = _corners(mesh_file(given["filename"], path))
        least = float((corners * numbers_of(shape, "scale", "1 1 1") @ up).min())
    return float(normal @ pose[:3, 3]) + float(least)


def carried_links(
    path: Path, robot: Robot, base: str | None = None, *, snap_angles: bool = True
) -> Iterator[tuple[str, XmlElement, Array]]:
    """Every ``<link>`` of a URDF, the link of the robot or base that carries it, and its pose in that frame."""
    try:
        content = read_bytes(path)
    except OSError as error:
        raise InputError(f"cannot read the URDF file {str(path)!r}: {error.strerror}") from error
    tree = parse_tree(content, path.name, snap_angles=snap_angles)
    moving = {link.name for link in robot.links}
    poses = _poses(tree)
    for link in robot_element(content, path.name).below("link"):
        name = link.attributes["name"]
        carrier = _carrier(tree, name, moving)
        above = poses[base or tree.root] if carrier == BASE else poses[carrier]
        yield carrier, link, np.linalg.inv(above) @ poses[name]


def _poses(tree: UrdfTree) -> dict[str, Array]:
    """Pose of every link in the frame of the root, all joints at rest."""
    poses, left = {tree.root: np.eye(4)}, [tree.root]
    for name in left:  # which grows
        for joint in tree.below[name]:
            poses[joint.child] = poses[name] @ resting_pose(tree, joint)
            left.append(joint.child)
    return poses


def _carrier(tree: UrdfTree, link: str, moving: set[str]) -> str:
    """The link of the robot that a link is fixed to, or the base."""
    while link not in moving:
        if link not in tree.above:
            return BASE
        link = tree.above[link].parent
    return link


def numbers_of(element: XmlElement | None, attribute: str, default: str) -> Array:
    """Numbers of an attribute."""
    text = default if element is None else element.attributes.get(attribute, default)
    return np.array([float(word) for word in text.split()])


def placed_shape(element: XmlElement) -> tuple[XmlElement, Array]:
    """The shape of a ``<collision>`` or ``<visual>``, and its pose in the link's frame."""
    origin = next(element.below("origin"), None)
    shapes = [shape for geometry in element.below("geometry") for shape in geometry.children if ":" not in shape.tag]
    if len(shapes) != 1:
        raise InputError("expected one shape in <geometry>")
    place = np.eye(4)
    place[:3, :3] = rotation_from_rpy(numbers_of(origin, "rpy", "0 0 0"))
    place[:3, 3] = numbers_of(origin, "xyz", "0 0 0")
    return shapes[0], place


def _around(shape: XmlElement, path: Path) -> Capsule:
    given = shape.attributes
    if shape.tag == "sphere":
        return Capsule((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), float(given["radius"]))
    if shape.tag == "cylinder":
        return enclosing_cylinder(float(given["radius"]), float(given["length"]))
    if shape.tag == "box":
        return enclosing_capsule(_CORNERS * numbers_of(shape, "size", ""))
    if shape.tag == "mesh":
        return enclosing_capsule(_corners(mesh_file(given["filename"], path)) * numbers_of(shape, "scale", "1 1 1"))
    raise InputError(f"no shape named {shape.tag!r}; available: sphere, cylinder, box, mesh")


def _corners(file: Path) -> Array:
    """Corners of a mesh of any format that there is a reader for, shape (N, 3)."""
    return collada_triangles(file).reshape(-1, 3) if file.suffix.lower() == ".dae" else mesh_corners(file)


def mesh_file(name: str, urdf: Path) -> Path:
    """The file of a mesh name: relative to the URDF, or in a package below one of the folders above it."""
    if not name.startswith("package://"):
        return urdf.parent / name.removeprefix("file://")
    inside = name.removeprefix("package://")
    candidates = (folder / part for folder in urdf.resolve().parents for part in (inside, inside.partition("/")[2]))
    return next((path for path in candidates if path.is_file()), urdf.parent / inside)


_HELD_MESHES = 4.0  # bytes at the same time for each byte of the triangles


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
    meshes, left_out, left = list[LinkMesh](), dict[str, None](), memory_cap()
    for carrier, link, pose in carried_links(path, robot, base, snap_angles=snap_angles):
        for tag in ("visual", "collision"):
            found = []
            for each in link.below(tag):
                triangles = _triangles(each, path, left_out, left)
                if triangles is not None:
                    found.append(triangles)
                    left -= _HELD_MESHES * triangles.nbytes
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
            if _HELD_MESHES * triangles.nbytes > left:
                raise MeshError(f"{file}: its {len(triangles)} triangles go beyond the memory that all meshes may take")
            scaled = triangles * numbers_of(shape, "scale", "1 1 1")
            return np.asarray(scaled @ place[:3, :3].T + place[:3, 3])
    except (MeshError, InputError, KeyError, ValueError) as error:
        left_out[str(error)] = None
    return None
