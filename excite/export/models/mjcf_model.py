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

from excite.export.models.exported_model import about_centre, number, numbers, quaternion_of
from excite.export.models.identified_model import IdentifiedModel
from excite.export.models.model_drives import ModelDrive
from excite.export.models.model_feature import COUPLED
from excite.export.models.model_format import ModelFormat, ModelText
from excite.export.models.nearest_bodies import held_note, own_part
from excite.export.models.xml_copy import (
    XmlCopy,
    XmlDocument,
    XmlSpan,
    chain_in,
    comment,
    moving_groups,
    pose_error,
    start,
)
from regressors.errors import InputError
from regressors.input_files import read_bytes
from regressors.models.columns import COULOMB, ROTOR, VISCOUS
from regressors.readers.mjcf import tree_of_mjcf
from regressors.readers.mjcf_actuators import joint_actuators, reflected
from regressors.readers.mjcf_tree import names_of
from regressors.readers.urdf_tree import TreeJoint, UrdfTree
from regressors.readers.xml_kind import MJCF, xml_kind
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
        """See `excite.export.models.model_format.ModelFormat.text`."""
        zone = (_ZONE,) if any(feature.kind == COULOMB for feature in model.features) else ()
        if robot_file is not None:
            copy = mjcf_copy(model, robot_file)
            notes = (*copy.notes, *zone)
            return ModelText(copy.content((*comment, *notes)), notes)
        notes = (*mjcf_notes(model.robot), *zone)
        return ModelText(mjcf_text(model, (*comment, *notes)), notes)


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


def mjcf_copy(model: IdentifiedModel, file: Path) -> XmlCopy:
    """Write the parameters of a model into a user's MJCF."""
    if xml_kind(str(file)) != MJCF:
        raise InputError(f"{str(file)!r} is no MJCF; leave `robot_file` out, and a new MJCF is written")
    compiled, tree = tree_of_mjcf(file, snap_angles=False)
    chain = chain_in(tree, model.described, file)
    snapped = tree_of_mjcf(file)[1]
    pose_error((tree, snapped), model.described, file)
    document = XmlDocument(read_bytes(file), file.name)
    _check_compiler(document)
    notes = _changed_bodies(document, compiled, tree, chain, model)
    joints = names_of(compiled, "joint")
    elements = {e.attributes.get("name"): e for e in document.root.all() if e.tag == "joint" and _is_in_body(e)}
    for k, name in enumerate(model.robot.joint_names):
        if values := joint_values(model, k):
            own = _without_actuators(values, compiled, joints.index(name))
            document.set(_found(elements, name, "joint", document), own)
    return XmlCopy(document, tuple(notes))


def _check_compiler(document: XmlDocument) -> None:
    for element in document.root.below("compiler"):
        if element.attributes.get("inertiafromgeom") == "true":
            raise InputError(
                f"{document.source}: inertiafromgeom='true' of its compiler leaves no inertia to state; set it to "
                "'auto', or leave `robot_file` out"
            )


def _is_in_body(element: XmlSpan) -> bool:
    return element.parent is not None and element.parent.tag == "body"


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


def _changed_bodies(
    document: XmlDocument, compiled: Any, tree: UrdfTree, chain: list[TreeJoint], model: IdentifiedModel
) -> list[str]:
    """Set the inertia of every body whose group moved; the other bodies of a group keep theirs, where they can."""
    elements = {element.attributes.get("name"): element for element in document.root.all() if element.tag == "body"}
    notes = []
    for name, child, others in moving_groups(tree, chain, model):
        own, factor = own_part(model.composites[name], [(theta, T) for _, theta, T in others])
        _set_inertial(document, _found(elements, child, "body", document), own, _anchor(compiled, child))
        if factor != 1.0:
            for other, theta, _ in others:
                element = _found(elements, other, "body", document)
                _set_inertial(document, element, factor * theta, _anchor(compiled, other))
        if others:
            notes.append(held_note(child, [other for other, _, _ in others], factor))
    return notes


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
    stated = body.child("inertial")
    if stated is None:
        document.insert_in(body, text, first=True)
    else:
        document.replace_tag(stated, text if stated.empty else text.replace("/>", ">"))
