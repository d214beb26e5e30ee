"""A copy of the user's own URDF in which only the identified parameters are changed."""

from __future__ import annotations

from pathlib import Path

from excite.export.models.exact_numbers import number
from excite.export.models.identified_model import IdentifiedModel
from excite.export.models.same_robot import chain_in, moving_groups, pose_error
from excite.export.models.shared_inertia import held_note, own_part
from excite.export.models.urdf_text import dynamics_attributes, inertial_attributes
from excite.export.models.xml_copy import XmlCopy
from excite.export.models.xml_spans import XmlDocument, XmlSpan
from excite.export.models.xml_text import start
from regressors.errors import InputError
from regressors.input_files import read_bytes
from regressors.readers.urdf_tree import TreeJoint, UrdfTree, parse_tree
from regressors.samples import Array

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
