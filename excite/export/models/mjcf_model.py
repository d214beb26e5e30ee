"""Identified models as MJCF: a copy of the user's own file, or one written from the description.

Grammar: MuJoCo, XML reference: ``body/inertial`` (``fullinertia``: xx, yy, zz, xy, xz, yz), ``joint`` (``armature``,
``damping``, ``frictionloss``), ``tendon/fixed`` (a length ``coef @ q`` with armature, damping and friction loss of its
own), ``actuator/motor``.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np

from excite.export.models.export_model import ModelFormat, ModelText
from excite.export.models.exported_model import about_centre, number, numbers, quaternion_of, stated
from excite.export.models.identified_model import COUPLED, LOOPS, DrivenRobot, IdentifiedModel
from excite.export.models.servo_model import FRICTION, ServoRobot
from excite.export.models.xml_copy import XmlDocument, XmlSpan, comment, joints_in, pose_error, share_inertia, start
from regressors.errors import InputError
from regressors.input_files import read_bytes
from regressors.models.servo_response import STRIBECK_SPEED
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
    expresses = frozenset({ROTOR, COULOMB, VISCOUS, COUPLED, LOOPS})  # loops are those of the user's own file
    template_suffixes = (".xml", ".mjcf")

    def text(self, model: IdentifiedModel, comment: tuple[str, ...], robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.export_model.ModelFormat.text`."""
        zone = (_ZONE,) if any(feature.kind == COULOMB for feature in model.features) else ()
        if robot_file is not None:
            document, notes = mjcf_copy(model, robot_file)
            notes = (*notes, *zone)
            return ModelText(document.edited((*comment, *notes)), notes)
        if model.robot.closures:
            raise InputError("an MJCF of closed loops is written as a copy of your own: give it as `robot_file`")
        notes = (*mjcf_notes(model.robot), *zone)
        return ModelText(mjcf_text(model, (*comment, *notes)), notes)

    def servo_text(self, servos: ServoRobot, robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.export_model.ModelFormat.servo_text`."""
        names, count = servos.robot.joint_names, None
        if robot_file is None:
            step, options, own = _STEP, {"timestep": number(_STEP)}, (*mjcf_notes(servos.robot), *servos.left_out)
            document = XmlDocument(mjcf_text(servos, ()).encode("utf-8"), self.name)
            elements = {element.attributes.get("name"): element for element in document.root.all()}
        else:
            document, compiled, elements, own = open_mjcf(servos, robot_file)
            joints, acting = names_of(compiled, "joint"), joint_actuators(compiled)
            step, options, count = compiled.opt.timestep, {}, [len(acting[joints.index(name)]) for name in names]
        document.set_child(document.root, "option", {**options, "integrator": "implicitfast"}, first=True)
        stuck = {"solreffriction": numbers([2.0 * step, 1.0]), "solimpfriction": "0.9999 0.9999 0.001 0.5 2"}
        for k, name in enumerate(names):
            friction = number(float(servos.resisting[k]))
            values = {**joint_values(servos, k), "frictionloss": friction, **stuck}
            document.set(_found(elements, name, "joint", document), values)
        _set_actuators(document, servos, count, step)
        notes = (*own, *_SERVO_NOTES)
        return ModelText(document.edited((*servos.comment, *servos.notes, *notes)), notes)


_STEP, _LEAST_STEP = 0.001, 0.0001  # of the simulation, and the least that histories of commands are for [s]
_SERVO_NOTES = (
    f"{FRICTION}; the solver settings of the joints make it hold what rests",
    "Fs (Stribeck friction) is in passive actuators, JOINT_stribeck, without a control, of MuJoCo 3.12 or later; "
    "for earlier ones and for MJX remove them, and add 3/4 of Fs to frictionloss",
    "K and b are gainprm and biasprm of the actuators; D is the damping of the joints, beyond any limit of torque",
    "delay, which is d and half a step more, by which the integrator is early, needs MuJoCo 3.5 or later; until it is "
    "over, the command is zero, or what mujoco.mj_initCtrlHistory sets",
)


def _set_actuators(document: XmlDocument, servos: ServoRobot, count: list[int] | None, step: float) -> None:
    """Write the servos in the place of the actuators of a file, of which each joint has a count, or as new ones."""
    sections, former = list(document.root.below("actuator")), []
    given: dict[str | None, list[XmlSpan]] = {}
    for element in (element for section in sections for element in section.children):
        joint = element.attributes.get("joint", element.attributes.get("jointinparent"))
        if element.attributes.get("name") == f"{joint}{_PASSIVE}":  # of an earlier export
            document.replace(element, "")
            former.append(joint)
        else:
            given.setdefault(joint, []).append(element)
    count = count and [each - (name in former) for name, each in zip(servos.robot.joint_names, count, strict=True)]
    added = []
    for k, name in enumerate(servos.robot.joint_names):
        own = given.get(name, [])
        if count is not None and not len(own) == count[k] <= 1:
            raise InputError(
                f"{document.source}: joint {name!r} has {count[k]} actuators, {len(own)} of them in the file itself; "
                "leave one in the file, or leave `robot_file` out"
            )
        kept = own[0].attributes.get("name", name) if own and count is not None else name
        text = start("general", _servo(servos, k, step, kept), empty=True)
        if own:
            document.replace(own[0], text)
        else:
            added.append(text)
    added += _passive(servos)
    if added and sections:
        document.insert_in(sections[0], "\n".join(added))
    elif added:
        document.insert_in(document.root, "\n".join(["<actuator>", *(f"  {text}" for text in added), "</actuator>"]))


_PASSIVE, _BRISTLE = "_stribeck", 1e-3  # deflection of LuGre's bristles that hold a joint [rad or m]


def _passive(servos: ServoRobot) -> list[str]:
    """Actuators of the friction ``Fs exp(-(dq / v)^2)``, without a control."""
    lines = []
    for name, Fs in zip(servos.robot.joint_names, servos.result.of("Fs"), strict=True):
        if Fs:
            lugre = numbers([Fs / _BRISTLE, 0.0, 1e-3 * Fs, Fs, STRIBECK_SPEED])
            motor = {"motorconst": "1e-9", "resistance": "1", "lugre": lugre}  # a positive constant is wanted
            values = {"name": f"{name}{_PASSIVE}", "joint": name, "input": "none", **motor}
            lines.append(start("dcmotor", values, empty=True))
    return lines


def _servo(servos: ServoRobot, k: int, step: float, name: str) -> dict[str, str]:
    """Attributes of an actuator with the torque ``clip(K (u(t - d) - q - b), -L, L)``."""
    joint = servos.robot.joint_names[k]
    K, b, d, L = (float(values[k]) for values in (*map(servos.result.of, "Kbd"), servos.result.torque_limit))
    limited = {"forcelimited": "true", "forcerange": numbers([-L, L])} if np.isfinite(L) else {"forcelimited": "false"}
    # between two samples, and half a step more, by which the semi-implicit integration is early
    history = {"delay": number(d + step / 2.0), "nsample": str(ceil(d / _LEAST_STEP) + 2), "interp": "linear"}
    affine = {"gainprm": numbers([K, 0, 0]), "biastype": "affine", "biasprm": numbers([-K * b, -K, 0])}
    plain = {"gear": "1", "dyntype": "none", "gaintype": "fixed"}
    return {"name": name, "joint": joint, **plain, **affine, **limited, **(history if d else {})}


_NO_MASS = 1e-9  # of a moving body without inertia, which MuJoCo refuses


def mjcf_text(model: DrivenRobot, lines: tuple[str, ...]) -> str:
    """The whole document."""
    robot = model.robot
    return "\n".join(
        [
            *([comment(lines)] if lines else []),
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


def joint_values(model: DrivenRobot, joint: int) -> dict[str, str]:
    """Attributes of a joint that hold its drive's rotor inertia and friction, those that the model knows."""
    return stated(armature=model.armature(joint), damping=model.damping(joint), frictionloss=model.friction(joint))


def _bodies(model: DrivenRobot, parent: int = 0, depth: int = 0) -> Iterator[str]:
    """The bodies that a link carries, by its number, each with those that it carries itself."""
    robot, indent = model.robot, "    " + "  " * depth
    for k, (joint, link) in enumerate(zip(robot.joints, robot.links, strict=True)):
        if robot.parents[k] != parent:
            continue
        pose = {"pos": numbers(joint.translation), "quat": numbers(quaternion_of(joint.rotation))}
        yield indent + start("body", {"name": link.name, **pose})
        theta = link.theta
        if theta is None or not np.any(theta):
            theta = np.array([_NO_MASS, 0, 0, 0, _NO_MASS, 0, 0, _NO_MASS, 0, _NO_MASS])
        yield f"{indent}  " + start("inertial", inertial_values(theta), empty=True)
        yield f"{indent}  " + start("joint", _joint(model, k, joint), empty=True)
        yield from _bodies(model, k + 1, depth + 1)
        yield indent + "</body>"


def _joint(model: DrivenRobot, k: int, joint: Joint) -> dict[str, str]:
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


def _tendons(model: DrivenRobot) -> Iterator[str]:
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


def mjcf_copy(model: DrivenRobot, file: Path) -> tuple[XmlDocument, tuple[str, ...]]:
    """Write the parameters of a model into a user's MJCF."""
    document, compiled, elements, notes = open_mjcf(model, file)
    joints = names_of(compiled, "joint")
    for k, name in enumerate(model.robot.joint_names):
        if values := joint_values(model, k):
            element = _found(elements, name, "joint", document)
            document.set(element, _without_actuators(values, compiled, joints.index(name)))
    return document, notes


def open_mjcf(model: DrivenRobot, file: Path) -> tuple[XmlDocument, Any, dict[str | None, XmlSpan], tuple[str, ...]]:
    """A user's MJCF with the inertia of a model, MuJoCo's model of the file, its elements of joints, and notes."""
    if xml_kind(str(file)) != MJCF:
        raise InputError(f"{str(file)!r} is no MJCF; leave `robot_file` out, and a new MJCF is written")
    compiled, tree = tree_of_mjcf(file, snap_angles=False)
    joints = joints_in(tree, model.described, file)
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
        if body not in bodies and not np.any(theta):  # between the joints of one body
            return
        _set_inertial(document, _found(bodies, body, "body", document), theta, _anchor(compiled, body))

    notes = share_inertia(tree, joints, model, write)
    elements = {e.attributes.get("name"): e for body in every_body for e in body.below("joint")}
    return document, compiled, elements, tuple(notes)


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
