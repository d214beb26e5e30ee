"""A payload as KUKA's ``LOAD_DATA``: ``{M 3.2,CM {X ..,Y ..,Z ..,A ..,B ..,C ..},J {X ..,Y ..,Z ..}}``.

KUKA System Software, "Operating and Programming Instructions for System Integrators", load data, and the data sheets'
"Load center of gravity and mass moment of inertia": mass M in kg; CM the centre of gravity in mm and the orientation of
the principal axes of inertia in degrees, relative to the flange, A about Z, then B about the new Y, then C about the
new X; J the moments about these axes in kg m^2. In `$config.dat` it belongs to tool number 1 of 16.
"""

from __future__ import annotations

import numpy as np

from excite.payload.controllers.number_text import number_text
from excite.payload.held_body import HeldBody
from regressors.samples import Array

EXPECTED = "the FLANGE coordinate system"
_MM = 1e3


def angles_of(rotation: Array) -> tuple[float, float, float]:
    """A, B, C with ``R = Rz(A) Ry(B) Rx(C)`` [deg]; C is zero where B is 90 degrees."""  # rotation (3, 3)
    R = rotation
    flat = float(np.hypot(R[0, 0], R[1, 0]))
    B = np.arctan2(-R[2, 0], flat)
    if flat < 1e-9:
        A, C = np.arctan2(-R[0, 1], R[1, 1]), 0.0
    else:
        A, C = np.arctan2(R[1, 0], R[0, 0]), np.arctan2(R[2, 1], R[2, 2])
    return tuple(map(float, np.degrees([A, B, C])))  # type: ignore[return-value]


def payload_text(body: HeldBody, frame: str) -> str:
    """A line of KRL."""
    moments, axes = body.principal
    place = _fields("XYZ", _MM * body.centre, 4) + "," + _fields("ABC", angles_of(axes), 6)
    return (
        f"; X, Y, Z [mm], A, B, C [deg] in: {frame}; expected: {EXPECTED}; J [kg m^2] about the principal axes\n"
        f"LOAD_DATA[1]={{M {number_text(body.mass, 6)},CM {{{place}}},J {{{_fields('XYZ', moments, 9)}}}}}\n"
    )


def _fields(names: str, values: Array | tuple[float, ...], digits: int) -> str:
    return ",".join(f"{name} {number_text(float(x), digits)}" for name, x in zip(names, values, strict=True))
