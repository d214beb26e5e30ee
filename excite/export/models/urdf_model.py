"""Identified models as URDF: a copy of the user's own file, or one written from the description.

Grammar: ROS wiki, urdf/XML/link, urdf/XML/joint, urdf/XML/Transmissions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from excite.export.models.exported_model import about_centre, number, numbers, rpy_of, upper
from excite.export.models.identified_model import IdentifiedModel
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
from regressors.models.columns import COULOMB, VISCOUS
from regressors.readers.urdf_tree import TreeJoint, UrdfTree, parse_tree
from regressors.robot.robot import Joint, Robot
from regressors.samples import Array


class UrdfFormat(ModelFormat):
    """URDF [ROS wiki, urdf/XML/link, urdf/XML/joint]: inertia of links, ``<dynamics damping friction>`` of joints."""

    name = "URDF"
    suffix = ".urdf"
    expresses = frozenset({COULOMB, VISCOUS})
    template_suffixes = (".urdf", ".xml")

    def text(self, model: IdentifiedModel, comment: tuple[str, ...], robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.model_format.ModelFormat.text`."""
        if robot_file is not None:
            copy = urdf_copy(model, robot_file)
            return ModelText(copy.content((*comment, *copy.notes)), copy.notes)
        notes = urdf_notes(model.robot)
        return ModelText(urdf_text(model, (*comment, *notes), lambda _: (), {}), notes)


UNLIMITED = (
    1e9  # for an effort, velocity or range without a limit: readers need a number, and take zero for none at all
)
_DOWN = np.array([0.0, 0.0, -1.0])
_STANDARD = 9.81
Extra = Callable[[IdentifiedModel], tuple[str, ...]]


def urdf_text(model: IdentifiedModel, lines: tuple[str, ...], extra: Extra, attributes: dict[str, str]) -> str:
    """The whole document."""
    robot = model.robot
    base = base_name(robot)
    body = [
        '<?xml version="1.0" encoding="utf-8"?>',
        comment(lines),
        start("robot", {"name": robot.name, **attributes}),
        *_root(robot, base),
        start("link", {"name": base}, empty=True),
    ]
    for k, (joint, link) in enumerate(zip(robot.joints, robot.links, strict=True)):
        body += [start("link", {"name": link.name}), *_inertial(link.theta), "</link>"]
        body += _joint(model, k, joint, base if k == 0 else robot.links[k - 1].name)
    return "\n".join([*body, *extra(model), "</robot>", ""])


def base_name(robot: Robot) -> str:
    """Name of the link that does not move, which no other link has."""
    name = "base"
    while name in {body.name for body in robot.bodies}:
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
    free = [
        joint.name
        for k, joint in enumerate(robot.joints)
        if not np.all(np.isfinite([robot.limits.velocity[k], robot.limits.torque[k]]))
    ]
    if free:
        notes.append(
            f"no limit of velocity or torque is known of {', '.join(free)}: {UNLIMITED:g} stands for none, which URDF "
            "cannot express"
        )
    if np.any(np.isfinite([robot.limits.acceleration, robot.limits.jerk])):
        notes.append("a URDF holds no limits of acceleration and jerk")
    if robot.transmission is not None and _limits_of_drives(robot):
        notes.append("a URDF holds no limits of drives: the joints have those that the description states of joints")
    return tuple(notes)


def _limits_of_drives(robot: Robot) -> bool:
    assert robot.transmission is not None
    limits = robot.transmission.limits
    return bool(np.any(np.isfinite([limits.lower, limits.velocity, limits.acceleration, limits.torque])))


def _root(robot: Robot, base: str) -> Iterator[str]:
    """A link above the base whose z axis is up, where gravity does not act along -z of the base."""
    R = upright(robot.gravity)
    if not np.array_equal(R, np.eye(3)):
        name = "world"
        while name in {base, *(body.name for body in robot.bodies)}:
            name += "_"
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


def inertial_attributes(theta: Array) -> dict[str, dict[str, str]]:
    """Attributes of the elements of ``<inertial>`` of a body."""
    mass, centre, inertia = about_centre(theta)
    return {
        "origin": {"xyz": numbers(centre), "rpy": "0 0 0"},
        "mass": {"value": number(mass)},
        "inertia": {name: number(value) for name, value in upper(inertia).items()},
    }


def _inertial(theta: Array | None) -> Iterator[str]:
    if theta is not None:
        yield "  <inertial>"
        for tag, attributes in inertial_attributes(theta).items():
            yield "    " + start(tag, attributes, empty=True)
        yield "  </inertial>"


def dynamics_attributes(model: IdentifiedModel, joint: int) -> dict[str, str]:
    """Attributes of ``<dynamics>`` of a joint, those that the model knows."""
    known = {"damping": model.damping(joint), "friction": model.friction(joint)}
    return {name: number(value) for name, value in known.items() if value is not None}


def _joint(model: IdentifiedModel, k: int, joint: Joint, parent: str) -> Iterator[str]:
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
    yield "</joint>"


_NEAR = 1e-9  # of a pose that is the same


def urdf_copy(model: IdentifiedModel, file: Path) -> XmlCopy:
    """Write the parameters of a model into a user's URDF."""
    try:
        content = read_bytes(file)
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read {str(file)!r}: {getattr(error, 'strerror', None) or error}") from error
    tree = parse_tree(content, file.name, snap_angles=False)
    document = XmlDocument(content, file.name)
    chain = chain_in(tree, model.described, file)
    notes = [*_rounded_note(tree, content, model, file), *_links(tree, document, chain, model)]
    joints = {element.attributes.get("name"): element for element in document.root.below("joint")}
    for k, joint in enumerate(chain):
        if attributes := dynamics_attributes(model, k):
            _set_dynamics(document, joints[joint.name], attributes)
    return XmlCopy(document, tuple(notes))


def _rounded_note(tree: UrdfTree, content: bytes, model: IdentifiedModel, file: Path) -> tuple[str, ...]:
    """Check that the file is that of the robot; a note where the robot has right angles for rounded ones."""
    snapped = parse_tree(content, file.name, snap_angles=True)
    error = pose_error((tree, snapped), model.described, file)
    if error <= _NEAR:
        return ()
    return (
        "the angles of the file are rounded, where the identified model has right angles "
        f"(poses differ by up to {error:.1g}); the file keeps its own",
    )


def _links(tree: UrdfTree, document: XmlDocument, chain: list[TreeJoint], model: IdentifiedModel) -> list[str]:
    """Set the inertia of every link whose group moved; the other links of a group keep theirs, where they can."""
    elements = {element.attributes.get("name"): element for element in document.root.below("link")}
    notes = []
    for name, child, others in moving_groups(tree, chain, model):
        own, factor = own_part(model.composites[name], [(theta, T) for _, theta, T in others])
        _set_inertial(document, elements[child], own)
        if factor != 1.0:
            for other, _, _ in others:
                _scale_inertial(document, elements[other], factor)
        if others:
            notes.append(held_note(child, [other for other, _, _ in others], factor))
    return notes


def _set_inertial(document: XmlDocument, link: XmlSpan, theta: Array) -> None:
    stated = link.child("inertial")
    wanted = inertial_attributes(theta)
    if stated is None:
        parts = "".join(f"\n  {start(tag, attributes, empty=True)}" for tag, attributes in wanted.items())
        document.insert_in(link, f"<inertial>{parts}\n</inertial>", first=True)
        return
    for tag, attributes in wanted.items():
        element = stated.child(tag)
        if element is None:
            document.insert_in(stated, start(tag, attributes, empty=True), first=True)
            continue
        if tag == "origin" and not any(_floats(element.attributes.get("rpy", "0 0 0"))):
            attributes = {"xyz": attributes["xyz"]}
        document.set(element, attributes)


def _scale_inertial(document: XmlDocument, link: XmlSpan, factor: float) -> None:
    stated = link.child("inertial")
    assert stated is not None
    for tag in ("mass", "inertia"):
        element = stated.child(tag)
        assert element is not None
        names = [name for name in element.attributes if name == "value" or name.startswith("i")]
        scaled = {name: number(factor * float(element.attributes[name])) for name in names}
        document.set(element, scaled)


def _floats(text: str) -> list[float]:
    return [float(word) for word in text.split()]


def _set_dynamics(document: XmlDocument, joint: XmlSpan, attributes: dict[str, str]) -> None:
    stated = joint.child("dynamics")
    if stated is not None:
        document.set(stated, attributes)
    else:
        document.insert_in(joint, start("dynamics", attributes, empty=True))
