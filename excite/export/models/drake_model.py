"""Identified models as URDF for Drake: with rotor inertia and gear ratio of each actuator.

Drake's documentation, "Parsing URDF and SDFormat files: custom elements", `drake:rotor_inertia` and `drake:gear_ratio`:
elements of ``/robot/transmission/actuator`` with an attribute ``value``; the reflected inertia is
``gear_ratio^2 rotor_inertia``.
"""

from __future__ import annotations

from pathlib import Path

from excite.export.models.exported_model import number
from excite.export.models.identified_model import IdentifiedModel
from excite.export.models.model_drives import ModelDrive
from excite.export.models.model_format import ModelFormat, ModelText
from excite.export.models.urdf_model import urdf_copy, urdf_notes, urdf_text
from excite.export.models.xml_copy import XmlDocument, XmlSpan, start
from regressors.models.columns import ROTOR, VISCOUS

NAMESPACE = {"xmlns:drake": "https://drake.mit.edu"}
_FRICTION = (
    "Drake's MultibodyPlant has no Coulomb friction in joints: it ignores the friction of <dynamics>, which is written "
    "for programs that read it"
)


class DrakeFormat(ModelFormat):
    """URDF with Drake's actuators: rotor inertia and gear ratio, damping of joints."""

    name = "Drake"
    suffix = ".urdf"
    expresses = frozenset({ROTOR, VISCOUS})
    template_suffixes = (".urdf", ".xml")

    def text(self, model: IdentifiedModel, comment: tuple[str, ...], robot_file: Path | None = None) -> ModelText:
        """See `excite.export.models.model_format.ModelFormat.text`."""
        if robot_file is not None:
            copy = urdf_copy(model, robot_file)
            _add_actuators(copy.document, model)
            return ModelText(copy.content((*comment, *copy.notes, _FRICTION)), (*copy.notes, _FRICTION))
        notes = (*urdf_notes(model.robot), _FRICTION)
        return ModelText(urdf_text(model, (*comment, *notes), _transmissions, NAMESPACE), notes)


def _transmissions(model: IdentifiedModel) -> tuple[str, ...]:
    return tuple(_transmission(model, k) for k in range(model.robot.n))


def _transmission(model: IdentifiedModel, joint: int) -> str:
    name = model.robot.joint_names[joint]
    return "\n".join(
        [
            start("transmission", {"name": f"{name}_transmission"}),
            "  <type>transmission_interface/SimpleTransmission</type>",
            "  " + start("joint", {"name": name}),
            "    <hardwareInterface>hardware_interface/EffortJointInterface</hardwareInterface>",
            "  </joint>",
            "  " + start("actuator", {"name": f"{name}_motor"}),
            *(f"    {line}" for line in _rotor(model, joint)),
            "  </actuator>",
            "</transmission>",
        ]
    )


def _rotor(model: IdentifiedModel, joint: int) -> tuple[str, ...]:
    """Elements of the actuator of a joint: those of its only drive, or all reflected behind a gear of ratio 1."""
    drives = [drive for drive in model.joint_drives(joint) if drive.reflected is not None]
    if not drives:
        return ()
    inertia, ratio = model.armature(joint) or 0.0, 1.0
    if len(drives) == 1:
        inertia, ratio = _own(drives[0])
    elements = {"drake:rotor_inertia": inertia, "drake:gear_ratio": ratio}
    return tuple(start(tag, {"value": number(value)}, empty=True) for tag, value in elements.items())


def _own(drive: ModelDrive) -> tuple[float, float]:
    assert drive.rotor_inertia is not None
    assert drive.ratio is not None
    return drive.rotor_inertia, drive.ratio * drive.factor


def _add_actuators(document: XmlDocument, model: IdentifiedModel) -> None:
    """Write rotor inertia and gear ratio into the transmissions of a user's file, or into new ones."""
    with_rotors = {k: lines for k in range(model.robot.n) if (lines := _rotor(model, k))}
    if not with_rotors:
        return
    document.set(document.root, NAMESPACE)
    stated: dict[str | None, XmlSpan] = {}
    for transmission in document.root.below("transmission"):
        joint, actuator = transmission.child("joint"), transmission.child("actuator")
        if joint is not None and actuator is not None:
            stated[joint.attributes.get("name")] = actuator
    for k, lines in with_rotors.items():
        actuator = stated.get(model.robot.joint_names[k])
        if actuator is None:
            document.insert_in(document.root, _transmission(model, k))
            continue
        for line, tag in zip(lines, ("drake:rotor_inertia", "drake:gear_ratio"), strict=True):
            element = actuator.child(tag)
            if element is None:
                document.insert_in(actuator, line)
            else:
                document.set(element, {"value": line.split('"')[1]})
