"""Meshes with few triangles: corners in the same cell of a grid become one [Rossignac and Borrel 1993]."""

from __future__ import annotations

import base64
from dataclasses import dataclass

import numpy as np

from regressors.samples import Array

_CELLS = (192, 128, 96, 64, 48, 32, 24, 16, 12, 8, 4, 2)  # along the longest side
_STEPS = 65535  # of a stored coordinate, over the longest side
MOST = 2500  # triangles


@dataclass(frozen=True, eq=False)
class CoarseMesh:
    """A mesh of few triangles."""

    corners: Array  # (N, 3)
    faces: Array  # (M, 3)

    def to_dict(self) -> dict[str, object]:
        """Corners as 16-bit steps from a point and faces as 16-bit indices, both in base64."""
        origin = self.corners.min(axis=0)
        scale = max(float(np.ptp(self.corners, axis=0).max()), 1e-9) / _STEPS
        steps = np.rint((self.corners - origin) / scale).astype("<u2")
        return {
            "origin": [float(f"{x:.7g}") for x in origin],
            "scale": float(f"{scale:.7g}"),
            "corners": base64.b64encode(steps.tobytes()).decode("ascii"),
            "faces": base64.b64encode(self.faces.astype("<u2").tobytes()).decode("ascii"),
        }


def decimated(triangles: Array, most: int = MOST) -> CoarseMesh:
    """A mesh of at most so many triangles, on the finest of several grids that leaves no more."""
    # triangles (N, 3, 3)
    points = triangles.reshape(-1, 3)
    low, side = points.min(axis=0), max(float(np.ptp(points, axis=0).max()), 1e-9)
    for cells in _CELLS:
        mesh = _clustered(points, np.floor((points - low) * (cells / side)).astype(np.int64))
        if len(mesh.faces) <= most:
            return mesh
    return mesh


def _clustered(points: Array, cells: Array) -> CoarseMesh:
    """The mesh whose corners are the means of those in each cell, without triangles that became lines."""
    _, place, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    place = place.reshape(-1)
    means = np.column_stack([np.bincount(place, points[:, k]) for k in range(3)]) / count[:, None]
    faces = place.reshape(-1, 3)
    real = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    _, first = np.unique(np.sort(faces[real], axis=1), axis=0, return_index=True)
    return CoarseMesh(means, faces[real][np.sort(first)])
