"""Identified models as URDF: a copy of the user's own file, or one written from the description.

Grammar: ROS wiki, urdf/XML/link, urdf/XML/joint, urdf/XML/Transmissions.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import ClassVar

import numpy as np

from excite.export.models.export_model import ModelFormat, ModelText
from excite.export.models.exported_model import about_centre, number, numbers, rpy_of, stated
from excite.export.models.identified_model import DrivenRobot, IdentifiedModel
from excite.export.models.servo_model import FRICTION, ServoRobot
from excite.export.models.xml_copy import XmlDocument, XmlSpan, comment, joints_in, pose_error, share_inertia, start
from regressors.errors import reading
from regressors.input_files import read_bytes
from regressors.readers.urdf_tree import parse_tree
from regressors.robot.closures import MimicJoint
from regressors.robot.columns import COULOMB, ROTOR, VISCOUS
from regressors.robot.robot import Joint, Robot
from regressors.samples import Array


class UrdfFormat(ModelFormat):
    """URDF [ROS wiki, urdf/XML/link, urdf/XML/joint]: inertia of links, ``<dynamics damping friction>`` of joints."""

    name = "URDF"
    suffix = ".urdf"
    expresses = frozenset({COULOMB, VISCOUS})
    template_suffixes = (".urdf", ".xml")
    namespace: ClassVar[Mapping[str, str]] = {}
    further: ClassVar[tuple[str, ...]] = ()  # notes

    def text(self, model: IdentifiedModel, comment: tuple[str, ...], robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.export_model.ModelFormat.text`."""
        if robot_file is not None:
            document, notes = urdf_copy(model, robot_file)
            self.add_drives(document, model)
            notes = (*notes, *self.further)
            return ModelText(document.edited((*comment, *notes)), notes)
        notes = (*urdf_notes(model.robot), *self.further)
        return ModelText(urdf_text(model, (*comment, *notes), self.drives(model), self.namespace), notes)

    def servo_text(self, servos: ServoRobot, robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.export_model.ModelFormat.servo_text`."""
        own = (*_SERVO_NOTES, *self.further)
        if robot_file is None:
            notes = (*urdf_notes(servos.robot), *servos.left_out, *own)
            lines = (*servos.comment, *servos.notes, *notes)
            return ModelText(urdf_text(servos, lines, self.drives(servos), self.namespace), notes)
        document, notes = urdf_copy(servos, robot_file)
        self.add_drives(document, servos)
        speed = np.where(np.isfinite(servos.result.speed_limit), servos.robot.limits.velocity, np.inf)
        found = servos.result.torque_limit, speed
        joints = {element.attributes.get("name"): element for element in document.root.below("joint")}
        for name, effort, velocity in zip(servos.robot.joint_names, *found, strict=True):
            known = {"effort": effort, "velocity": velocity}
            if limits := {key: number(value) for key, value in known.items() if np.isfinite(value)}:
                document.set_child(joints[name], "limit", limits)
        notes = (*notes, *own)
        return ModelText(document.edited((*servos.comment, *servos.notes, *notes)), notes)

    def drives(self, model: DrivenRobot) -> tuple[str, ...]:
        """Elements of the drives, behind the joints."""
        return ()

    def add_drives(self, document: XmlDocument, model: DrivenRobot) -> None:
        """Write what is known of the drives into a user's file."""


_SERVO_NOTES = (
    f"{FRICTION}, and, since a URDF has no other, 3/4 of Fs (Stribeck friction)",
    "damping is D of the servo: give a position controller of the simulator the stiffness K, and no damping of its own",
    "a URDF has no place for K, b and d, and a plain one none for J: they are in the comment of the file",
)


class DrakeFormat(UrdfFormat):
    """URDF with Drake's actuators: rotor inertia and gear ratio, damping of joints.

    Drake's documentation, "Parsing URDF and SDFormat files: custom elements", `drake:rotor_inertia` and
    `drake:gear_ratio`: elements of ``/robot/transmission/actuator`` with an attribute ``value``; the reflected inertia
    is ``gear_ratio^2 rotor_inertia``.
    """

    name = "Drake"
    expresses = frozenset({ROTOR, VISCOUS})
    namespace: ClassVar[Mapping[str, str]] = {"xmlns:drake": "https://drake.mit.edu"}
    further = (
        "Drake's MultibodyPlant has no Coulomb friction in joints: it ignores the friction of <dynamics>, which is "
        "written for programs that read it",
    )

    def drives(self, model: DrivenRobot) -> tuple[str, ...]:
        """A transmission of every joint."""
        return tuple(_transmission(model, k) for k in range(model.robot.n))

    def add_drives(self, document: XmlDocument, model: DrivenRobot) -> None:
        """Rotor inertia and gear ratio in the transmissions of the file, or in new ones."""
        with_rotors = {k: rotor for k in range(model.robot.n) if (rotor := _rotor(model, k))}
        if with_rotors:
            document.set(document.root, self.namespace)
        actuators: dict[str | None, XmlSpan] = {}
        for transmission in document.root.below("transmission"):
            joint, actuator = transmission.child("joint"), transmission.child("actuator")
            if joint is not None and actuator is not None:
                actuators[joint.attributes.get("name")] = actuator
        for k, rotor in with_rotors.items():
            actuator = actuators.get(model.robot.joint_names[k])
            if actuator is None:
                document.insert_in(document.root, _transmission(model, k))
                continue
            for tag, value in rotor.items():
                document.set_child(actuator, tag, {"value": value})


def _transmission(model: DrivenRobot, joint: int) -> str:
    name = model.robot.joint_names[joint]
    rotor = [f"    {start(tag, {'value': value}, empty=True)}" for tag, value in _rotor(model, joint).items()]
    return "\n".join(
        [
            start("transmission", {"name": f"{name}_transmission"}),
            "  <type>transmission_interface/SimpleTransmission</type>",
            "  " + start("joint", {"name": name}),
            "    <hardwareInterface>hardware_interface/EffortJointInterface</hardwareInterface>",
            "  </joint>",
            "  " + start("actuator", {"name": f"{name}_motor"}),
            *rotor,
            "  </actuator>",
            "</transmission>",
        ]
    )


def _rotor(model: DrivenRobot, joint: int) -> dict[str, str]:
    """Rotor inertia and gear ratio of a joint: those of its only drive, or all reflected behind a gear of ratio 1."""
    drives = [drive for drive in model.joint_drives(joint) if drive.reflected is not None]
    if not drives:
        return {}
    inertia, ratio = model.armature(joint), 1.0
    if len(drives) == 1:
        inertia, ratio = drives[0].rotor_inertia, (drives[0].ratio or 0.0) * drives[0].factor
    return stated(**{"drake:rotor_inertia": inertia, "drake:gear_ratio": ratio})


UNLIMITED = 1e9  # for an effort, velocity or range without a limit: readers need a number, and take zero for none
_DOWN = np.array([0.0, 0.0, -1.0])
_STANDARD = 9.81


def urdf_text(
    model: DrivenRobot, lines: tuple[str, ...], drives: tuple[str, ...], attributes: Mapping[str, str]
) -> str:
    """The whole document."""
    robot = model.robot
    base = _free_name("base", robot)
    body = [
        '<?xml version="1.0" encoding="utf-8"?>',
        comment(lines),
        start("robot", {"name": robot.name, **attributes}),
        *_root(robot, base),
        start("link", {"name": base}, empty=True),
    ]
    for k, (joint, link, parent) in enumerate(zip(robot.joints, robot.links, robot.parents, strict=True)):
        body += [start("link", {"name": link.name}), *_inertial(link.theta), "</link>"]
        body += _joint(model, k, joint, robot.links[parent - 1].name if parent else base)
    return "\n".join([*body, *drives, "</robot>", ""])


def _free_name(name: str, robot: Robot, *taken: str) -> str:
    """A name for a link that does not move, which no other link has."""
    while name in {*taken, *(body.name for body in robot.bodies)}:
        name += "_"
    return name


def urdf_notes(robot: Robot) -> tuple[str, ...]:
    """What a URDF that is written from a description does not hold, or holds as another number."""
    notes = []
    g = float(np.linalg.norm(robot.gravity))
    if abs(g - _STANDARD) > 1e-9:
        notes.append(
            f"a URDF does not hold the magnitude of gravity, {g:g} m/s^2: give it to the program that loads it"
        )
    known = np.isfinite(robot.limits.velocity) & np.isfinite(robot.limits.torque)
    if free := [name for name, limited in zip(robot.joint_names, known, strict=True) if not limited]:
        notes.append(
            f"no limit of velocity or torque is known of {', '.join(free)}: {UNLIMITED:g} stands for none, which URDF "
            "cannot express"
        )
    if np.any(np.isfinite([robot.limits.acceleration, robot.limits.jerk])):
        notes.append("a URDF holds no limits of acceleration and jerk")
    of_drives = None if robot.transmission is None else robot.transmission.limits
    if of_drives is not None and np.any(
        np.isfinite([of_drives.lower, of_drives.velocity, of_drives.acceleration, of_drives.torque])
    ):
        notes.append("a URDF holds no limits of drives: the joints have those that the description states of joints")
    return tuple(notes)


def _root(robot: Robot, base: str) -> Iterator[str]:
    """A link above the base whose z axis is up, where gravity does not act along -z of the base."""
    R = upright(robot.gravity)
    if not np.array_equal(R, np.eye(3)):
        name = _free_name("world", robot, base)
        yield start("link", {"name": name}, empty=True)
        yield start("joint", {"name": f"{name}_to_{base}", "type": "fixed"})
        yield "  " + start("origin", {"xyz": "0 0 0", "rpy": numbers(rpy_of(R))}, empty=True)
        yield from _ends(name, base)
        yield "</joint>"


def upright(gravity: Array) -> Array:
    """Rotation R with ``R g = |g| (0, 0, -1)``, of the base in a world whose z axis is up, shape (3, 3)."""
    size = float(np.linalg.norm(gravity))
    if size == 0.0:
        return np.eye(3)
    down = np.asarray(gravity) / size
    v, c = np.cross(down, _DOWN), float(down @ _DOWN)
    if np.linalg.norm(v) < 1e-12:
        return np.eye(3) if c > 0 else np.diag([1.0, -1.0, -1.0])
    K = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.asarray(np.eye(3) + K + K @ K / (1 + c))


def _ends(parent: str, child: str) -> Iterator[str]:
    yield "  " + start("parent", {"link": parent}, empty=True)
    yield "  " + start("child", {"link": child}, empty=True)


_INERTIA = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}


def inertial_attributes(theta: Array) -> dict[str, dict[str, str]]:
    """Attributes of the elements of ``<inertial>`` of a body."""
    mass, centre, inertia = about_centre(theta)
    return {
        "origin": {"xyz": numbers(centre), "rpy": "0 0 0"},
        "mass": {"value": number(mass)},
        "inertia": {name: number(inertia[place]) for name, place in _INERTIA.items()},
    }


def _inertial(theta: Array | None) -> Iterator[str]:
    if theta is not None:
        yield "  <inertial>"
        for tag, attributes in inertial_attributes(theta).items():
            yield "    " + start(tag, attributes, empty=True)
        yield "  </inertial>"


def dynamics_attributes(model: DrivenRobot, joint: int) -> dict[str, str]:
    """Attributes of ``<dynamics>`` of a joint, those that the model knows."""
    return stated(damping=model.damping(joint), friction=model.friction(joint))


def _joint(model: DrivenRobot, k: int, joint: Joint, parent: str) -> Iterator[str]:
    limits, robot = model.robot.limits, model.robot
    bounded = bool(np.isfinite(limits.lower[k]))
    kind = "prismatic" if joint.kind == "prismatic" else "revolute" if bounded else "continuous"
    yield start("joint", {"name": joint.name, "type": kind})
    rotation = numbers(rpy_of(joint.rotation))
    yield "  " + start("origin", {"xyz": numbers(joint.translation), "rpy": rotation}, empty=True)
    yield from _ends(parent, robot.links[k].name)
    yield "  " + start("axis", {"xyz": numbers(joint.axis)}, empty=True)
    reach = {"lower": limits.lower[k], "upper": limits.upper[k]}
    if not bounded:
        reach = {} if kind == "continuous" else {"lower": -UNLIMITED, "upper": UNLIMITED}
    most = {"effort": limits.torque[k], "velocity": limits.velocity[k]}
    bounds = {name: number(np.clip(value, -UNLIMITED, UNLIMITED)) for name, value in {**reach, **most}.items()}
    yield "  " + start("limit", bounds, empty=True)
    if dynamics := dynamics_attributes(model, k):
        yield "  " + start("dynamics", dynamics, empty=True)
    for each in robot.closures:
        if isinstance(each, MimicJoint) and each.joints[0] == joint.name:
            followed = {"joint": each.joints[1], "multiplier": number(each.multiplier), "offset": number(each.offset)}
            yield "  " + start("mimic", followed, empty=True)
    yield "</joint>"


_NEAR = 1e-9  # of a pose that is the same


def urdf_copy(model: DrivenRobot, file: Path) -> tuple[XmlDocument, tuple[str, ...]]:
    """Write the parameters of a model into a user's URDF."""
    with reading(repr(str(file))):
        content = read_bytes(file)
    tree = parse_tree(content, file.name, snap_angles=False)
    document = XmlDocument(content, file.name)
    joints = joints_in(tree, model.described, file)
    notes = []
    away = pose_error((tree, parse_tree(content, file.name, snap_angles=True)), model.described, file)
    if away > _NEAR:
        notes.append(
            "the angles of the file are rounded, where the identified model has right angles "
            f"(poses differ by up to {away:.1g}); the file keeps its own"
        )
    links = {element.attributes.get("name"): element for element in document.root.below("link")}

    def write(link: str, theta: Array, factor: float) -> None:
        if factor == 1.0:
            _set_inertial(document, links[link], theta)
        else:
            _scale_inertial(document, links[link], factor)

    notes += share_inertia(tree, joints, model, write)
    elements = {element.attributes.get("name"): element for element in document.root.below("joint")}
    for k, joint in enumerate(joints):
        if attributes := dynamics_attributes(model, k):
            document.set_child(elements[joint.name], "dynamics", attributes)
    return document, tuple(notes)


def _set_inertial(document: XmlDocument, link: XmlSpan, theta: Array) -> None:
    inertial = link.child("inertial")
    wanted = inertial_attributes(theta)
    if inertial is None:
        parts = "".join(f"\n  {start(tag, attributes, empty=True)}" for tag, attributes in wanted.items())
        document.insert_in(link, f"<inertial>{parts}\n</inertial>", first=True)
        return
    for tag, attributes in wanted.items():
        element = inertial.child(tag)
        if tag == "origin" and element and not any(map(float, element.attributes.get("rpy", "0").split())):
            attributes = {"xyz": attributes["xyz"]}
        document.set_child(inertial, tag, attributes, first=True)


def _scale_inertial(document: XmlDocument, link: XmlSpan, factor: float) -> None:
    inertial = link.child("inertial")
    assert inertial is not None
    for tag in ("mass", "inertia"):
        element = inertial.child(tag)
        assert element is not None
        known = {name: value for name, value in element.attributes.items() if name == "value" or name.startswith("i")}
        document.set(element, {name: number(factor * float(value)) for name, value in known.items()})
