"""A payload as ABB's ``loaddata``: ``[mass, [x, y, z], [q1, q2, q3, q4], ix, iy, iz]``.

ABB, "Technical reference manual - RAPID Instructions, Functions and Data types", loaddata: mass in kg, at least 0.001;
cog in mm, in the tool coordinate system (wrist coordinate system for the load of a tool); aom the orientation of the
principal axes of inertia at the centre of gravity as a quaternion, scalar first; ix, iy, iz the moments about these
axes in kg m^2, none of them negative; three zeros stand for a point mass. A mass needs a cog that is not the origin.
"""

from __future__ import annotations

import numpy as np

from excite.payload.controllers.number_text import list_text, number_text
from excite.payload.held_body import HeldBody
from regressors.samples import Array

EXPECTED = "the wrist coordinate system (the flange) for the load of a tool, the tool's for GripLoad"
_MM, _LEAST_MASS, _LEAST_PLACE = 1e3, 0.001, 0.001


def quaternion_of(rotation: Array) -> Array:
    """Unit quaternion of a rotation, scalar first and not negative, shape (4,)."""  # rotation (3, 3)
    R = rotation
    K = np.array(
        [
            [R[0, 0] + R[1, 1] + R[2, 2], R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]],
            [R[2, 1] - R[1, 2], R[0, 0] - R[1, 1] - R[2, 2], R[0, 1] + R[1, 0], R[0, 2] + R[2, 0]],
            [R[0, 2] - R[2, 0], R[0, 1] + R[1, 0], R[1, 1] - R[0, 0] - R[2, 2], R[1, 2] + R[2, 1]],
            [R[1, 0] - R[0, 1], R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], R[2, 2] - R[0, 0] - R[1, 1]],
        ]
    )
    q = np.linalg.eigh(K)[1][:, -1]
    return np.asarray(q if q[np.flatnonzero(np.abs(q) > 1e-12)[0]] > 0 else -q)


def payload_text(body: HeldBody, frame: str) -> str:
    """A line of RAPID."""
    moments, axes = body.principal
    centre = _MM * body.centre
    if np.all(np.abs(centre) < _LEAST_PLACE):
        centre = np.array([0.0, 0.0, _LEAST_PLACE])
    data = (
        f"[{number_text(max(body.mass, _LEAST_MASS), 6)}, [{list_text(centre, 4)}], "
        f"[{list_text(quaternion_of(axes))}], {list_text(np.maximum(moments, 0.0))}]"
    )
    return (
        f"! cog [mm] and aom in: {frame}; expected: {EXPECTED}; ix, iy, iz [kg m^2] about the principal axes\n"
        f"PERS loaddata payload := {data};\n"
    )
