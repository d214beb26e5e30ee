"""Identified models as MJCF: a copy of the user's own file, or one written from the description.

Grammar: MuJoCo, XML reference: ``body/inertial`` (``fullinertia``: xx, yy, zz, xy, xz, yz), ``joint`` (``armature``,
``damping``, ``frictionloss``), ``tendon/fixed`` (a length ``coef @ q`` with armature, damping and friction loss of its
own), ``actuator/motor``.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from excite.export.models.export_model import ModelFormat, ModelText
from excite.export.models.exported_model import about_centre, number, numbers, quaternion_of, stated
from excite.export.models.identified_model import COUPLED, IdentifiedModel
from excite.export.models.xml_copy import XmlDocument, XmlSpan, chain_in, comment, pose_error, share_inertia, start
from regressors.errors import InputError
from regressors.input_files import read_bytes
from regressors.readers.mjcf import tree_of_mjcf
from regressors.readers.mjcf_tree import joint_actuators, names_of, reflected
from regressors.readers.urdf_elements import MJCF, xml_kind
from regressors.robot.columns import COULOMB, ROTOR, VISCOUS
from regressors.robot.inertia import transport
from regressors.robot.robot import Joint, Robot
from regressors.samples import Array

_ZONE = (
    "MuJoCo's friction loss is a soft constraint: in a stick zone around standstill it is less than Coulomb friction; "
    "solreffriction and solimpfriction of the joints set how wide that is"
)


class MjcfFormat(ModelFormat):
    """MJCF [MuJoCo, XML reference]: inertia, armature, damping and friction loss; coupled drives as fixed tendons."""

    name = "MJCF"
    suffix = ".xml"
    expresses = frozenset({ROTOR, COULOMB, VISCOUS, COUPLED})
    template_suffixes = (".xml", ".mjcf")

    def text(self, model: IdentifiedModel, comment: tuple[str, ...], robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.export_model.ModelFormat.text`."""
        zone = (_ZONE,) if any(feature.kind == COULOMB for feature in model.features) else ()
        if robot_file is not None:
            document, notes = mjcf_copy(model, robot_file)
            notes = (*notes, *zone)
            return ModelText(document.edited((*comment, *notes)), notes)
        notes = (*mjcf_notes(model.robot), *zone)
        return ModelText(mjcf_text(model, (*comment, *notes)), notes)


_NO_MASS = 1e-9  # of a moving body without inertia, which MuJoCo refuses


def mjcf_text(model: IdentifiedModel, lines: tuple[str, ...]) -> str:
    """The whole document."""
    robot = model.robot
    return "\n".join(
        [
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
    )


def mjcf_notes(robot: Robot) -> tuple[str, ...]:
    """What an MJCF that is written from a description does not hold."""
    notes = []
    bounds = robot.limits
    if np.any(np.isfinite([bounds.velocity, bounds.acceleration, bounds.jerk])):
        notes.append("an MJCF holds no limits of velocity, acceleration and jerk")
    if unknown := [link.name for link in robot.links if link.theta is None]:
        notes.append(f"nothing is known of {', '.join(unknown)}: a mass of {_NO_MASS:g} kg stands for none")
    return tuple(notes)


def inertial_values(theta: Array) -> dict[str, str]:
    """Attributes of ``<inertial>`` of a body about its frame."""
    mass, centre, I = about_centre(theta)
    full = [I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]
    return {"pos": numbers(centre), "mass": number(mass), "fullinertia": numbers(full)}


def joint_values(model: IdentifiedModel, joint: int) -> dict[str, str]:
    """Attributes of a joint that hold its drive's rotor inertia and friction, those that the model knows."""
    return stated(armature=model.armature(joint), damping=model.damping(joint), frictionloss=model.friction(joint))


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
            known = stated(armature=drive.reflected, damping=drive.viscous, frictionloss=drive.coulomb)
            yield "    " + start("fixed", {"name": drive.name, **known})
            for k in np.flatnonzero(drive.row):
                part = {"joint": model.robot.joint_names[k], "coef": number(drive.row[k])}
                yield "      " + start("joint", part, empty=True)
            yield "    </fixed>"
        yield "  </tendon>"


def _motors(robot: Robot) -> Iterator[str]:
    yield "  <actuator>"
    for k, name in enumerate(robot.joint_names):
        torque = robot.limits.torque[k]
        reach = {"ctrlrange": numbers([-torque, torque])} if np.isfinite(torque) else {}
        yield "    " + start("motor", {"name": f"{name}_motor", "joint": name, **reach}, empty=True)
    yield "  </actuator>"


def mjcf_copy(model: IdentifiedModel, file: Path) -> tuple[XmlDocument, tuple[str, ...]]:
    """Write the parameters of a model into a user's MJCF."""
    if xml_kind(str(file)) != MJCF:
        raise InputError(f"{str(file)!r} is no MJCF; leave `robot_file` out, and a new MJCF is written")
    compiled, tree = tree_of_mjcf(file, snap_angles=False)
    chain = chain_in(tree, model.described, file)
    snapped = tree_of_mjcf(file)[1]
    pose_error((tree, snapped), model.described, file)
    document = XmlDocument(read_bytes(file), file.name)
    for element in document.root.below("compiler"):
        if element.attributes.get("inertiafromgeom") == "true":
            raise InputError(
                f"{document.source}: inertiafromgeom='true' of its compiler leaves no inertia to state; set it to "
                "'auto', or leave `robot_file` out"
            )
    every_body = [element for element in document.root.all() if element.tag == "body"]
    bodies = {element.attributes.get("name"): element for element in every_body}

    def write(body: str, theta: Array, _: float) -> None:
        _set_inertial(document, _found(bodies, body, "body", document), theta, _anchor(compiled, body))

    notes = share_inertia(tree, chain, model, write)
    joints = names_of(compiled, "joint")
    elements = {e.attributes.get("name"): e for body in every_body for e in body.below("joint")}
    for k, name in enumerate(model.robot.joint_names):
        if values := joint_values(model, k):
            own = _without_actuators(values, compiled, joints.index(name))
            document.set(_found(elements, name, "joint", document), own)
    return document, tuple(notes)


def _found(elements: dict[str | None, XmlSpan], name: str, kind: str, document: XmlDocument) -> XmlSpan:
    if name not in elements:
        raise InputError(
            f"{document.source}: {kind} {name!r} is not in the file itself but in one that it includes or attaches, or "
            "has no name there; leave `robot_file` out, and a new MJCF is written"
        )
    return elements[name]


def _without_actuators(values: dict[str, str], compiled: Any, joint: int) -> dict[str, str]:
    """Values of the joint alone: less what its actuators add to them."""
    own = joint_actuators(compiled)[joint]
    for name, field in (("armature", "actuator_armature"), ("damping", "actuator_damping")):
        added = reflected(compiled, field, own)
        if name in values and added:
            values[name] = number(max(float(values[name]) - added, 0.0))
    return values


def _anchor(compiled: Any, body: str) -> Array:
    """Origin of a link in the frame of its body: the anchor of the hinge that moves it [m]."""
    import mujoco

    k = names_of(compiled, "body").index(body)
    if not compiled.body_jntnum[k]:
        return np.zeros(3)
    last = int(compiled.body_jntadr[k] + compiled.body_jntnum[k]) - 1
    hinge = int(compiled.jnt_type[last]) == int(mujoco.mjtJoint.mjJNT_HINGE)
    return np.array(compiled.jnt_pos[last]) if hinge else np.zeros(3)


def _set_inertial(document: XmlDocument, body: XmlSpan, theta: Array, anchor: Array) -> None:
    text = start("inertial", inertial_values(transport(np.eye(3), anchor) @ theta), empty=True)
    inertial = body.child("inertial")
    if inertial is None:
        document.insert_in(body, text, first=True)
    else:
        document.replace_tag(inertial, text if inertial.empty else text.replace("/>", ">"))
