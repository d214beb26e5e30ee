"""A payload in URScript: ``set_target_payload(m, cog, inertia)``, and ``set_payload(m, cog)`` of older software.

Universal Robots, "The URScript Programming Language for e-Series": masses in kg, the centre of gravity in m from the
tool mount, the inertia as [Ixx, Iyy, Izz, Ixy, Ixz, Iyz] in kg m^2 about the centre of gravity, with axes parallel to
those of the tool flange. `set_target_payload` is there from 5.10 on, and zeroes the force/torque measurement.
"""

from __future__ import annotations

from excite.payload.controllers.number_text import list_text, number_text
from excite.payload.held_body import HeldBody

EXPECTED = "the tool flange, z out of it"


def payload_text(body: HeldBody, frame: str) -> str:
    """URScript lines."""
    I = body.inertia
    mass, centre = number_text(body.mass, 6), list_text(body.centre, 6)
    inertia = list_text((I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]))
    return (
        f"# centre [m] and inertia [kg m^2] in: {frame}; expected: {EXPECTED}\n"
        f"set_target_payload({mass}, [{centre}], [{inertia}])\n"
        f"# software before 5.10: set_payload({mass}, [{centre}])\n"
    )
