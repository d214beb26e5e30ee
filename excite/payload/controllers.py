"""What controllers want to know of a payload, in their own words."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from scipy.spatial.transform import Rotation

from excite.payload.held_body import UPPER, HeldBody
from regressors.errors import UnknownName
from regressors.samples import Array

EXPECTED = {
    "ur": "the tool flange, z out of it",
    "franka": "the flange F",
    "kuka": "the FLANGE coordinate system",
    "abb": "the wrist coordinate system (the flange) for the load of a tool, the tool's for GripLoad",
    "urdf": "the link that the joint names as its parent",
}
"""In which frame a controller expects centre and inertia, in words."""
CONTROLLERS = tuple(EXPECTED)
FILES = {
    "ur": "payload.script",
    "franka": "payload.franka.cpp",
    "kuka": "payload.dat",
    "abb": "payload.mod",
    "urdf": "payload.urdf",
}
_DIGITS = 9
_MM = 1e3
_LEAST_MASS, _LEAST_PLACE = 0.001, 0.001  # of a loaddata [kg, mm]


def controller_text(name: str, body: HeldBody, frame: str) -> str:
    """The payload in a controller's own words."""
    texts: dict[str, Callable[[HeldBody, str], str]] = {
        "ur": target_payload_text,
        "franka": set_load_text,
        "kuka": load_data_text,
        "abb": loaddata_text,
        "urdf": urdf_link_text,
    }
    if name not in texts:
        raise UnknownName("controller", name, CONTROLLERS)
    return texts[name](body, frame)


def number_text(value: float, digits: int = _DIGITS) -> str:
    """A number with a point, some digits behind it, and no exponent."""
    text = f"{value:.{digits}f}".rstrip("0")
    text = f"{text}0" if text.endswith(".") else text
    return "0.0" if text == "-0.0" else text


def list_text(values: Iterable[float], digits: int = _DIGITS) -> str:
    """Numbers separated by commas."""
    return ", ".join(number_text(value, digits) for value in values)


def target_payload_text(body: HeldBody, frame: str) -> str:
    """A payload in URScript: ``set_target_payload(m, cog, inertia)``, and ``set_payload(m, cog)`` of older software.

    Universal Robots, "The URScript Programming Language for e-Series": masses in kg, the centre of gravity in m from
    the tool mount, the inertia as [Ixx, Iyy, Izz, Ixy, Ixz, Iyz] in kg m^2 about the centre of gravity, with axes
    parallel to those of the tool flange. `set_target_payload` is there from 5.10 on, and zeroes the force/torque
    measurement.
    """
    I = body.inertia
    mass, centre = number_text(body.mass, 6), list_text(body.centre, 6)
    inertia = list_text((I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]))
    return (
        f"# centre [m] and inertia [kg m^2] in: {frame}; expected: {EXPECTED['ur']}\n"
        f"set_target_payload({mass}, [{centre}], [{inertia}])\n"
        f"# software before 5.10: set_payload({mass}, [{centre}])\n"
    )


def set_load_text(body: HeldBody, frame: str) -> str:
    """A payload for libfranka: ``robot.setLoad(mass, F_x_Cload, load_inertia)``.

    libfranka API documentation, `franka::Robot::setLoad` and `franka::RobotState::I_load`: mass in kg, translation from
    the flange to the centre of mass in m, the inertia matrix in kg m^2 with respect to the centre of mass,
    column-major. The Panda's flange is 0.107 m along z from the frame of link 7.
    """
    centre, inertia = list_text(body.centre, 6), list_text(body.inertia.ravel(order="F"))
    return (
        f"// centre [m] and inertia [kg m^2, column-major] in: {frame}; expected: {EXPECTED['franka']}\n"
        f"robot.setLoad({number_text(body.mass, 6)}, {{{{{centre}}}}}, {{{{{inertia}}}}});\n"
    )


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


def load_data_text(body: HeldBody, frame: str) -> str:
    """A payload as KUKA's ``LOAD_DATA``: ``{M 3.2,CM {X ..,Y ..,Z ..,A ..,B ..,C ..},J {X ..,Y ..,Z ..}}``.

    KUKA System Software, "Operating and Programming Instructions for System Integrators", load data, and the data
    sheets' "Load center of gravity and mass moment of inertia": mass M in kg; CM the centre of gravity in mm and the
    orientation of the principal axes of inertia in degrees, relative to the flange, A about Z, then B about the new Y,
    then C about the new X; J the moments about these axes in kg m^2. In `$config.dat` it belongs to tool number 1 of
    16.
    """
    moments, axes = body.principal
    place = _fields("XYZ", _MM * body.centre, 4) + "," + _fields("ABC", angles_of(axes), 6)
    expected = EXPECTED["kuka"]
    return (
        f"; X, Y, Z [mm], A, B, C [deg] in: {frame}; expected: {expected}; J [kg m^2] about the principal axes\n"
        f"LOAD_DATA[1]={{M {number_text(body.mass, 6)},CM {{{place}}},J {{{_fields('XYZ', moments, 9)}}}}}\n"
    )


def _fields(names: str, values: Array | tuple[float, ...], digits: int) -> str:
    return ",".join(f"{name} {number_text(float(x), digits)}" for name, x in zip(names, values, strict=True))


def quaternion_of(rotation: Array) -> Array:
    """Unit quaternion of a rotation, scalar first and not negative, shape (4,)."""  # rotation (3, 3)
    q = Rotation.from_matrix(rotation).as_quat(scalar_first=True)
    return np.asarray(q if q[np.flatnonzero(np.abs(q) > 1e-12)[0]] > 0 else -q)


def loaddata_text(body: HeldBody, frame: str) -> str:
    """A payload as ABB's ``loaddata``: ``[mass, [x, y, z], [q1, q2, q3, q4], ix, iy, iz]``.

    ABB, "Technical reference manual - RAPID Instructions, Functions and Data types", loaddata: mass in kg, at least
    0.001; cog in mm, in the tool coordinate system (wrist coordinate system for the load of a tool); aom the
    orientation of the principal axes of inertia at the centre of gravity as a quaternion, scalar first; ix, iy, iz the
    moments about these axes in kg m^2, none of them negative; three zeros stand for a point mass. A mass needs a cog
    that is not the origin.
    """
    moments, axes = body.principal
    centre = _MM * body.centre
    if np.all(np.abs(centre) < _LEAST_PLACE):
        centre = np.array([0.0, 0.0, _LEAST_PLACE])
    data = (
        f"[{number_text(max(body.mass, _LEAST_MASS), 6)}, [{list_text(centre, 4)}], "
        f"[{list_text(quaternion_of(axes))}], {list_text(np.maximum(moments, 0.0))}]"
    )
    return (
        f"! cog [mm] and aom in: {frame}; expected: {EXPECTED['abb']}; ix, iy, iz [kg m^2] about the principal axes\n"
        f"PERS loaddata payload := {data};\n"
    )


def urdf_link_text(body: HeldBody, frame: str) -> str:
    """A payload as a link of a URDF, with the joint that fixes it.

    ROS wiki, "urdf/XML/link": mass in kg; origin, the centre of mass, in m; ixx, ixy, ixz, iyy, iyz, izz in kg m^2
    about the centre of mass in the axes of the inertial frame, here those of the link.
    """
    x, y, z = (f"{v:.9g}" for v in body.centre)
    entries = zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), body.inertia[UPPER], strict=True)
    inertia = " ".join(f'{name}="{value:.12g}"' for name, value in entries)
    stated = frame.replace("--", "- -").replace("]]>", "")
    return (
        f"<!-- centre and inertia in: {stated}; expected: {EXPECTED['urdf']}: replace PARENT -->\n"
        '<link name="payload">\n'
        f'  <inertial><origin xyz="{x} {y} {z}" rpy="0 0 0"/><mass value="{body.mass:.9g}"/>\n'
        f"    <inertia {inertia}/></inertial>\n"
        "</link>\n"
        '<joint name="payload_fixed" type="fixed"><parent link="PARENT"/><child link="payload"/></joint>\n'
    )
