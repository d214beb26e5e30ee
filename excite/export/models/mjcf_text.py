"""An MJCF of a robot, written from its description.

Grammar: MuJoCo, XML reference: ``body/inertial`` (``fullinertia``: xx, yy, zz, xy, xz, yz), ``joint`` (``armature``,
``damping``, ``frictionloss``), ``tendon/fixed`` (a length ``coef @ q`` with armature, damping and friction loss of its
own), ``actuator/motor``.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from excite.export.models.exact_numbers import about_centre, number, numbers, quaternion_of
from excite.export.models.identified_model import IdentifiedModel
from excite.export.models.model_drives import ModelDrive
from excite.export.models.xml_text import comment, start
from regressors.robot.robot import Joint, Robot
from regressors.samples import Array

_NO_MASS = 1e-9  # of a moving body without inertia, which MuJoCo refuses


def mjcf_text(model: IdentifiedModel, lines: tuple[str, ...]) -> str:
    """The whole document."""
    robot = model.robot
    parts = [
        comment(lines),
        start("mujoco", {"model": robot.name}),
        "  " + start("compiler", {"angle": "radian", "autolimits": "true", "balanceinertia": "false"}, empty=True),
        "  " + start("option", {"gravity": numbers(robot.gravity)}, empty=True),
        "  <worldbody>",
        *_bodies(model),
        "  </worldbody>",
        *_tendons(model),
        *_motors(robot),
        "</mujoco>",
        "",
    ]
    return "\n".join(parts)


def mjcf_notes(robot: Robot) -> tuple[str, ...]:
    """What an MJCF that is written from a description does not hold."""
    notes = []
    bounds = robot.limits
    if np.any(np.isfinite([bounds.velocity, bounds.acceleration, bounds.jerk])):
        notes.append("an MJCF holds no limits of velocity, acceleration and jerk")
    unknown = [link.name for link in robot.links if link.theta is None]
    if unknown:
        notes.append(f"nothing is known of {', '.join(unknown)}: a mass of {_NO_MASS:g} kg stands for none")
    return tuple(notes)


def inertial_values(theta: Array) -> dict[str, str]:
    """Attributes of ``<inertial>`` of a body about its frame."""
    mass, centre, I = about_centre(theta)
    full = [I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]
    return {"pos": numbers(centre), "mass": number(mass), "fullinertia": numbers(full)}


def joint_values(model: IdentifiedModel, joint: int) -> dict[str, str]:
    """Attributes of a joint that hold its drive's rotor inertia and friction, those that the model knows."""
    known = {
        "armature": model.armature(joint),
        "damping": model.damping(joint),
        "frictionloss": model.friction(joint),
    }
    return {name: number(value) for name, value in known.items() if value is not None}


def _bodies(model: IdentifiedModel) -> Iterator[str]:
    robot = model.robot
    for k, (joint, link) in enumerate(zip(robot.joints, robot.links, strict=True)):
        indent = "    " + "  " * k
        pose = {"pos": numbers(joint.translation), "quat": numbers(quaternion_of(joint.rotation))}
        yield indent + start("body", {"name": link.name, **pose})
        theta = link.theta
        if theta is None or not np.any(theta):
            theta = np.array([_NO_MASS, 0, 0, 0, _NO_MASS, 0, 0, _NO_MASS, 0, _NO_MASS])
        yield f"{indent}  " + start("inertial", inertial_values(theta), empty=True)
        yield f"{indent}  " + start("joint", _joint(model, k, joint), empty=True)
    for k in reversed(range(robot.n)):
        yield "    " + "  " * k + "</body>"


def _joint(model: IdentifiedModel, k: int, joint: Joint) -> dict[str, str]:
    limits = model.robot.limits
    attributes = {
        "name": joint.name,
        "type": "slide" if joint.kind == "prismatic" else "hinge",
        "axis": numbers(joint.axis),
    }
    if np.isfinite(limits.lower[k]):
        attributes["range"] = numbers([limits.lower[k], limits.upper[k]])
    if np.isfinite(limits.torque[k]):
        attributes["actuatorfrcrange"] = numbers([-limits.torque[k], limits.torque[k]])
    return {**attributes, **joint_values(model, k)}


def _tendons(model: IdentifiedModel) -> Iterator[str]:
    """Drives that move several joints, as tendons whose length is the drive coordinate."""
    coupled = [drive for drive in model.drives if drive.joint is None and np.any(drive.row)]
    if coupled:
        yield "  <tendon>"
        for drive in coupled:
            yield "    " + start("fixed", {"name": drive.name, **_tendon(drive)})
            for k in np.flatnonzero(drive.row):
                part = {"joint": model.robot.joint_names[k], "coef": number(drive.row[k])}
                yield "      " + start("joint", part, empty=True)
            yield "    </fixed>"
        yield "  </tendon>"


def _tendon(drive: ModelDrive) -> dict[str, str]:
    known = {"armature": drive.reflected, "damping": drive.viscous, "frictionloss": drive.coulomb}
    return {name: number(value) for name, value in known.items() if value is not None}


def _motors(robot: Robot) -> Iterator[str]:
    yield "  <actuator>"
    for k, name in enumerate(robot.joint_names):
        torque = robot.limits.torque[k]
        reach = {"ctrlrange": numbers([-torque, torque])} if np.isfinite(torque) else {}
        yield "    " + start("motor", {"name": f"{name}_motor", "joint": name, **reach}, empty=True)
    yield "  </actuator>"
