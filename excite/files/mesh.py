"""Corners of triangle meshes, from STL (binary or text) and OBJ files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from regressors.errors import InputError
from regressors.input_files import read_bytes
from regressors.samples import Array

_HEADER, _RECORD = 84, 50  # bytes of a binary STL file before its triangles, and of each
_CORNERS = {".stl": "vertex", ".obj": "v"}  # first word of a text line with a corner


class MeshError(InputError):
    """A mesh that is missing, or cannot be read."""


def mesh_corners(path: Path) -> Array:
    """Corners of all triangles of a mesh, with repetitions, shape (N, 3), in the units of the file."""
    kind = path.suffix.lower()
    if kind not in _CORNERS:
        raise MeshError(f"{path}: no reader for {kind or 'files without ending'}; available: {', '.join(_CORNERS)}")
    try:
        content = read_bytes(path)
    except OSError as error:
        raise MeshError(f"cannot read mesh {path}: {error.strerror}") from error
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
    fans: list[tuple[int, int, int]] = []
    try:
        for line in read_bytes(path).decode("utf-8", "replace").splitlines():
            words = line.split()
            if words[:1] == ["f"]:
                index = [int(word.partition("/")[0]) for word in words[1:]]
                places = [each - 1 if each > 0 else count + each for each in index]
                fans += [(places[0], *places[k : k + 2]) for k in range(1, len(places) - 1)]  # type: ignore[misc]
    except ValueError as error:
        raise MeshError(f"{path}: not a mesh: {error}") from error
    faces = np.array(fans, dtype=int).reshape(-1, 3)
    if faces.size and not (faces.min() >= 0 and faces.max() < count):
        raise MeshError(f"{path}: a face has a corner that is not there; it has {count}")
    return faces


def _from_text(content: bytes, word: str, path: Path) -> Array:
    lines = (line.split() for line in content.decode("utf-8", "replace").splitlines())
    try:
        vertices = [[float(number) for number in line[1:4]] for line in lines if line and line[0] == word]
        return np.array(vertices).reshape(-1, 3)
    except ValueError as error:
        raise MeshError(f"{path}: not a mesh: {error}") from error
