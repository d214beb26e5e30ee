"""Triangles of meshes in COLLADA (``.dae``), by the optional package pycollada."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from excite.files.mesh import MeshError
from regressors.input_files import in_bytes, read_bytes
from regressors.memory_cap import memory_cap
from regressors.samples import Array

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
    try:
        content = read_bytes(path)
    except OSError as error:
        raise MeshError(f"cannot read mesh {path}: {error.strerror}") from error
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
