"""A copy of the user's own MJCF in which only the identified parameters are changed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from excite.export.models.exact_numbers import number
from excite.export.models.identified_model import IdentifiedModel
from excite.export.models.mjcf_text import inertial_values, joint_values
from excite.export.models.same_robot import chain_in, moving_groups, pose_error
from excite.export.models.shared_inertia import held_note, own_part
from excite.export.models.xml_copy import XmlCopy
from excite.export.models.xml_spans import XmlDocument, XmlSpan
from excite.export.models.xml_text import start
from regressors.errors import InputError
from regressors.input_files import read_bytes
from regressors.readers.mjcf import tree_of_mjcf
from regressors.readers.mjcf_actuators import joint_actuators, reflected
from regressors.readers.mjcf_tree import names_of
from regressors.readers.urdf_tree import TreeJoint, UrdfTree
from regressors.readers.xml_kind import MJCF, xml_kind
from regressors.robot.inertia import transport
from regressors.samples import Array


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
    notes = _bodies(document, compiled, tree, chain, model)
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


def _bodies(
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
