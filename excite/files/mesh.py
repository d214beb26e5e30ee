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
    """Corners of all triangles of a mesh, with repetitions, shape (N, 3), in the units of the file.

    Parameters
    ----------
    path : Path
        Ends with ``.stl`` or ``.obj``.

    Raises
    ------
    MeshError
        Cannot be read, has another format, or is empty.
    """
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


def _from_text(content: bytes, word: str, path: Path) -> Array:
    lines = (line.split() for line in content.decode("utf-8", "replace").splitlines())
    try:
        vertices = [[float(number) for number in line[1:4]] for line in lines if line and line[0] == word]
        return np.array(vertices).reshape(-1, 3)
    except ValueError as error:
        raise MeshError(f"{path}: not a mesh: {error}") from error
