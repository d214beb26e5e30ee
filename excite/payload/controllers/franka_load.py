"""A payload for libfranka: ``robot.setLoad(mass, F_x_Cload, load_inertia)``.

libfranka API documentation, `franka::Robot::setLoad` and `franka::RobotState::I_load`: mass in kg, translation from the
flange to the centre of mass in m, the inertia matrix in kg m^2 with respect to the centre of mass, column-major. The
Panda's flange is 0.107 m along z from the frame of link 7.
"""

from __future__ import annotations

from excite.payload.controllers.number_text import list_text, number_text
from excite.payload.held_body import HeldBody

EXPECTED = "the flange F"


def payload_text(body: HeldBody, frame: str) -> str:
    """A line of C++."""
    centre, inertia = list_text(body.centre, 6), list_text(body.inertia.ravel(order="F"))
    return (
        f"// centre [m] and inertia [kg m^2, column-major] in: {frame}; expected: {EXPECTED}\n"
        f"robot.setLoad({number_text(body.mass, 6)}, {{{{{centre}}}}}, {{{{{inertia}}}}});\n"
    )
