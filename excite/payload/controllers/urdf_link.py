"""A payload as a link of a URDF, with the joint that fixes it.

ROS wiki, "urdf/XML/link": mass in kg; origin, the centre of mass, in m; ixx, ixy, ixz, iyy, iyz, izz in kg m^2 about
the centre of mass in the axes of the inertial frame, here those of the link.
"""

from __future__ import annotations

from excite.payload.held_body import UPPER, HeldBody

EXPECTED = "the link that the joint names as its parent"


def payload_text(body: HeldBody, frame: str) -> str:
    """XML of a link and a fixed joint."""
    x, y, z = (f"{v:.9g}" for v in body.centre)
    entries = zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), body.inertia[UPPER], strict=True)
    inertia = " ".join(f'{name}="{value:.12g}"' for name, value in entries)
    stated = frame.replace("--", "- -").replace("]]>", "")
    return (
        f"<!-- centre and inertia in: {stated}; expected: {EXPECTED}: replace PARENT -->\n"
        '<link name="payload">\n'
        f'  <inertial><origin xyz="{x} {y} {z}" rpy="0 0 0"/><mass value="{body.mass:.9g}"/>\n'
        f"    <inertia {inertia}/></inertial>\n"
        "</link>\n"
        '<joint name="payload_fixed" type="fixed"><parent link="PARENT"/><child link="payload"/></joint>\n'
    )
