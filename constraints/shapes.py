"""Shapes of a robot from its URDF: capsules around its elements, and meshes from STL, OBJ and COLLADA files."""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from constraints.geometry import Part, enclosing_capsule, enclosing_cylinder
from regressors.errors import InputError
from regressors.input_files import in_bytes, read_bytes
from regressors.readers.moving_part import carried
from regressors.readers.urdf import urdf_content
from regressors.readers.urdf_elements import XmlElement, robot_element
from regressors.readers.urdf_tree import parse_tree
from regressors.robot.inertia import pose_of, rotation_from_rpy
from regressors.robot.robot import BASE, Robot
from regressors.robot.shapes import Capsule
from regressors.samples import Array
from regressors.work_prediction import memory_cap

_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])

Solid = tuple[Array, float]  # facets by their corners, shape (F, k, 3), and the radius of what surrounds them [m]
Carried = tuple[str, XmlElement, Array]  # the link of the robot or base that carries a <link>, and its pose there


def urdf_shape(path: Path, links: Iterable[Carried]) -> tuple[tuple[Part, ...], tuple[tuple[str, str], ...]]:
    """One capsule around every ``<collision>`` of the links that a robot carries, see `carried_links`.

    A sphere stays a sphere; a box and a mesh get a small capsule around all their corners; a cylinder one that contains
    its flat ends. Links above the base, or below it on other branches, count as part of the base.
    """
    parts, left_out = [], []
    around: dict[str, Capsule] = {}  # many links have the same shape
    for carrier, link, pose in links:
        name = link.attributes["name"]
        for element in link.below("collision"):
            try:
                shape, place = placed_shape(element)
                alike = f"{shape.tag} {shape.attributes}"
                around[alike] = around.get(alike) or _around(shape, path)
                parts.append(Part(carrier, around[alike].moved(pose @ place)))
            except MeshError as error:
                left_out.append((carrier, f"{path.name}: link {name!r}, <collision>: {error}"))
            except (InputError, KeyError, ValueError) as error:
                reason = f"{error} is missing" if isinstance(error, KeyError) else error
                raise InputError(f"{path.name}: link {name!r}, <collision>: {reason}") from error
    if not parts and not left_out:
        raise InputError(f"{path.name}: no link has a <collision> element to take the robot's shape from")
    return tuple(parts), tuple(left_out)


_SIDES = 32  # of the prism around a cylinder


def urdf_solids(path: Path, links: Iterable[Carried], wanted: Collection[str]) -> dict[str, list[Solid]]:
    """The ``<collision>`` shapes themselves of some of the links that a robot carries; none of one that has others.

    Each as facets in the frame of its carrier, and the radius around them.
    """
    solids: dict[str, list[Solid]] = {}
    unreadable: set[str] = set()
    for carrier, link, pose in links:
        for element in link.below("collision") if carrier in wanted else ():
            shape, place = placed_shape(element)
            T, radius = pose @ place, float(shape.attributes["radius"]) if shape.tag == "sphere" else 0.0
            try:
                solid = _facets(shape, path) @ T[:3, :3].T + T[:3, 3], radius
                solids.setdefault(carrier, []).append(solid)
            except MeshError:
                unreadable.add(carrier)
    return {carrier: own for carrier, own in solids.items() if carrier not in unreadable}


def _facets(shape: XmlElement, path: Path) -> Array:
    """Triangles of a mesh, else the corners of a box, of the prism around a cylinder, or the centre of a sphere."""
    if shape.tag == "sphere":
        return np.zeros((1, 1, 3))
    if shape.tag == "cylinder":
        angle = 2 * np.pi * np.arange(_SIDES) / _SIDES
        circle = float(shape.attributes["radius"]) / np.cos(np.pi / _SIDES) * np.array([np.cos(angle), np.sin(angle)])
        half = 0.5 * float(shape.attributes["length"])
        return np.array([[(x, y, z) for x, y in circle.T for z in (-half, half)]])
    if shape.tag == "box":
        return _CORNERS[None] * numbers_of(shape, "size", "")
    return _mesh(shape, path)


def lowest_point(path: Path, links: Iterable[Carried], normal: Array) -> float | None:
    """Least height of the base's ``<collision>`` shapes themselves along a direction; None if it has none [m]."""
    # normal (3,)
    heights = []
    for carrier, link, pose in links:
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
    else:
        least = (_facets(shape, path) @ up).min()
    return float(normal @ pose[:3, 3]) + float(least)


def carried_links(
    path: Path, robot: Robot, base: str | None = None, *, snap_angles: bool = True, content: str | bytes | None = None
) -> Iterator[Carried]:
    """Every ``<link>`` of a URDF, the link of the robot or base that carries it, and its pose in that frame.

    Where the content of the file is given, it is not read again.
    """
    content = urdf_content(path) if content is None else content
    tree = parse_tree(content, path.name, snap_angles=snap_angles)
    moving = {link.name for link in robot.links}
    poses = dict(carried(tree, tree.root, ()))
    for link in robot_element(content, path.name).below("link"):
        name = link.attributes["name"]
        on_robot = (carrier := tree.carrier(name, moving)) in moving
        above = poses[carrier if on_robot else base or tree.root]
        yield carrier if on_robot else BASE, link, np.linalg.inv(above) @ poses[name]


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
    R = rotation_from_rpy(numbers_of(origin, "rpy", "0 0 0"))
    return shapes[0], pose_of(R, numbers_of(origin, "xyz", "0 0 0"))


def _around(shape: XmlElement, path: Path) -> Capsule:
    given = shape.attributes
    if shape.tag == "sphere":
        return Capsule((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), float(given["radius"]))
    if shape.tag == "cylinder":
        return enclosing_cylinder(float(given["radius"]), float(given["length"]))
    if shape.tag in ("box", "mesh"):
        return enclosing_capsule(_facets(shape, path).reshape(-1, 3))
    raise InputError(f"no shape named {shape.tag!r}; available: sphere, cylinder, box, mesh")


def _mesh(shape: XmlElement, path: Path) -> Array:
    """Triangles of a mesh of any format that there is a reader for, shape (N, 3, 3) [m]."""
    file = mesh_file(shape.attributes["filename"], path)
    triangles = (collada_triangles if file.suffix.lower() == ".dae" else mesh_triangles)(file)
    return np.asarray(triangles * numbers_of(shape, "scale", "1 1 1"))


def mesh_file(name: str, urdf: Path) -> Path:
    """The file of a mesh name: relative to the URDF, or in a package below one of the folders above it."""
    if not name.startswith("package://"):
        return urdf.parent / name.removeprefix("file://")
    inside = name.removeprefix("package://")
    candidates = (folder / part for folder in urdf.resolve().parents for part in (inside, inside.partition("/")[2]))
    return next((path for path in candidates if path.is_file()), urdf.parent / inside)


_HELD_MESHES = 4.0  # bytes at the same time for each byte of the triangles


def urdf_meshes(
    path: Path, robot: Robot, base: str | None = None, *, snap_angles: bool = True
) -> tuple[list[tuple[str, Array]], tuple[str, ...]]:
    """Meshes of the links and what is fixed to them: ``<visual>`` where it can be read, else ``<collision>``.

    For each its link and its triangles in that frame, shape (N, 3, 3) [m]; and the files that are missing, damaged, or
    in a format without a reader, and why.
    """
    meshes, left_out, left = list[tuple[str, Array]](), dict[str, None](), memory_cap()
    for carrier, link, pose in carried_links(path, robot, base, snap_angles=snap_angles):
        for tag in ("visual", "collision"):
            found = []
            for each in link.below(tag):
                triangles = _triangles(each, path, left_out, left)
                if triangles is not None:
                    found.append(triangles)
                    left -= _HELD_MESHES * triangles.nbytes
            meshes += [(carrier, triangles @ pose[:3, :3].T + pose[:3, 3]) for triangles in found]
            if found:
                break
    return meshes, tuple(left_out)


def _triangles(element: XmlElement, path: Path, left_out: dict[str, None], left: float) -> Array | None:
    """Triangles in the link's frame; None of a shape that is no mesh, or that is not read, which is noted."""
    try:
        shape, place = placed_shape(element)
        if shape.tag == "mesh":
            triangles = _mesh(shape, path)
            if _HELD_MESHES * triangles.nbytes > left:
                file = mesh_file(shape.attributes["filename"], path)
                raise MeshError(f"{file}: its {len(triangles)} triangles go beyond the memory that all meshes may take")
            return np.asarray(triangles @ place[:3, :3].T + place[:3, 3])
    except (MeshError, InputError, KeyError, ValueError) as error:
        left_out[str(error)] = None
    return None


_HEADER, _RECORD = 84, 50  # bytes of a binary STL file before its triangles, and of each
_FIRST_WORDS = {".stl": "vertex", ".obj": "v"}  # first word of a text line with a corner


class MeshError(InputError):
    """A mesh that is missing, or cannot be read."""


def _content(path: Path) -> bytes:
    try:
        return read_bytes(path)
    except OSError as error:
        raise MeshError(f"cannot read mesh {path}: {error.strerror}") from error


def mesh_corners(path: Path) -> Array:
    """Corners of all triangles of a mesh, with repetitions, shape (N, 3), in the units of the file."""
    kind = path.suffix.lower()
    if kind not in _FIRST_WORDS:
        raise MeshError(f"{path}: no reader for {kind or 'files without ending'}; available: {', '.join(_FIRST_WORDS)}")
    content = _content(path)
    count = int.from_bytes(content[_HEADER - 4 : _HEADER], "little")
    if kind == ".stl" and len(content) == _HEADER + count * _RECORD:
        triangle = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        corners = np.frombuffer(content, triangle, count, _HEADER)["corners"].reshape(-1, 3).astype(float)
    else:
        corners = _from_text(content, _FIRST_WORDS[kind], path)
    if corners.size == 0 or not np.all(np.isfinite(corners)):
        raise MeshError(f"{path}: expected a mesh of finite corners, given {len(corners)} corners")
    return corners


def mesh_triangles(path: Path) -> Array:
    """Corners of each triangle of a mesh, shape (N, 3, 3), in the units of the file."""
    corners = mesh_corners(path)
    if path.suffix.lower() == ".stl":
        return corners[: len(corners) // 3 * 3].reshape(-1, 3, 3)
    faces = _faces(path, len(corners))
    if not len(faces):
        raise MeshError(f"{path}: expected faces, given corners only")
    return np.asarray(corners[faces])


def _faces(path: Path, count: int) -> Array:
    """Indices of the corners of triangles, a face of more corners as a fan, shape (N, 3)."""
    fans: list[list[int]] = []
    try:
        for words in _lines(read_bytes(path), "f"):
            index = [int(word.partition("/")[0]) for word in words]
            places = [each - 1 if each > 0 else count + each for each in index]
            fans += [[places[0], *places[k : k + 2]] for k in range(1, len(places) - 1)]
    except ValueError as error:
        raise MeshError(f"{path}: not a mesh: {error}") from error
    faces = np.array(fans, dtype=int).reshape(-1, 3)
    if faces.size and not (faces.min() >= 0 and faces.max() < count):
        raise MeshError(f"{path}: a face has a corner that is not there; it has {count}")
    return faces


def _from_text(content: bytes, word: str, path: Path) -> Array:
    try:
        vertices = [[float(number) for number in words[:3]] for words in _lines(content, word)]
        return np.array(vertices).reshape(-1, 3)
    except ValueError as error:
        raise MeshError(f"{path}: not a mesh: {error}") from error


def _lines(content: bytes, word: str) -> Iterator[list[str]]:
    """Words of the lines that begin with one, behind it."""
    lines = (line.split() for line in content.decode("utf-8", "replace").splitlines())
    return (words[1:] for words in lines if words[:1] == [word])


_NODES = 10_000  # of the scene, with those that others stand for
_HELD, _TRIANGLE = 3.0, 72.0  # bytes at the same time for each byte of the triangles; of each
_DECLARATIONS = (b"<!DOCTYPE", b"<!ENTITY")  # COLLADA has none, and entities could expand without end


def collada_triangles(path: Path) -> Array:
    """Corners of each triangle of all geometries in the scene, shape (N, 3, 3) [m].

    Coordinates are as in the file, in its unit of length; its vertical axis is not looked at, as ROS does it.
    """
    try:
        import collada
    except ImportError as error:
        raise MeshError(
            f"{path} needs pycollada: install it with `pip install 'excite-trajectories[meshes]'`"
        ) from error
    content = _content(path)
    if any(word in content for word in _DECLARATIONS) or not content.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
        raise MeshError(f"{path}: expected COLLADA without a document type")
    try:
        with warnings.catch_warnings():
            for kind in (PendingDeprecationWarning, DeprecationWarning):  # it uses numpy.matrix, and sets shapes
                warnings.simplefilter("ignore", kind)
            document = collada.Collada(io.BytesIO(content), ignore=[collada.common.DaeError])
            parts = [] if document.scene is None else list(_primitives(document.scene))
    except MeshError as error:
        raise MeshError(f"{path}: {error}") from error
    except Exception as error:  # whatever the library makes of a damaged file
        raise MeshError(f"{path}: not a mesh: {error}") from error
    corners = np.concatenate(parts) if parts else np.zeros((0, 3, 3))
    if not corners.size or not np.isfinite(corners).all():
        raise MeshError(f"{path}: expected triangles with finite corners")
    return np.asarray(corners * float(document.assetInfo.unitmeter or 1.0))


def _primitives(scene: Any) -> Iterator[Array]:
    """Triangles of each primitive in the frame of the scene; polygons as fans, lines left out."""
    left = memory_cap() / _HELD
    sizes: dict[int, float] = {}
    if sum(_size(node, sizes) for node in scene.nodes) > _NODES:
        raise MeshError(f"its nodes stand for more than {_NODES} nodes")
    for geometry in scene.objects("geometry"):
        for each in geometry.primitives():
            triangles = each.triangleset() if hasattr(each, "triangleset") else each
            shape = np.shape(triangles.vertex_index)
            if len(shape) == 2 and shape[0] > 0 and shape[1] == 3:
                left -= _TRIANGLE * shape[0]
                if left < 0.0:
                    raise MeshError(f"its triangles take more than the cap of {in_bytes(memory_cap())}")
                yield np.asarray(triangles.vertex[triangles.vertex_index], dtype=float)


def _size(node: Any, known: dict[int, float]) -> float:
    """Number of nodes that a node stands for, itself included."""
    key = id(getattr(node, "node", node))  # the one that an instance refers to
    if key not in known:
        known[key] = 1.0 + sum(_size(child, known) for child in getattr(node, "children", ()))
    return known[key]
