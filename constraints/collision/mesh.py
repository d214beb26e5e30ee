"""Triangle meshes from STL (binary or text) and OBJ files, and from COLLADA (``.dae``), by the package pycollada."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from regressors.errors import InputError
from regressors.input_files import in_bytes, read_bytes
from regressors.memory_cap import memory_cap
from regressors.samples import Array

_HEADER, _RECORD = 84, 50  # bytes of a binary STL file before its triangles, and of each
_CORNERS = {".stl": "vertex", ".obj": "v"}  # first word of a text line with a corner


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
    if kind not in _CORNERS:
        raise MeshError(f"{path}: no reader for {kind or 'files without ending'}; available: {', '.join(_CORNERS)}")
    content = _content(path)
    count = int.from_bytes(content[_HEADER - 4 : _HEADER], "little")
    if kind == ".stl" and len(content) == _HEADER + count * _RECORD:
        triangle = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        corners = np.frombuffer(content, triangle, count, _HEADER)["corners"].reshape(-1, 3).astype(float)
    else:
        corners = _from_text(content, _CORNERS[kind], path)
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
            warnings.simplefilter("ignore", PendingDeprecationWarning)  # it uses numpy.matrix
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
