"""Descriptions of robots in other formats than URDF, recognised by what is in the file."""

from __future__ import annotations

from collections.abc import Mapping

from regressors.readers.urdf_elements import XmlElement
from regressors.readers.urdf_words import READ

_FORMATS: Mapping[str, str] = {
    "mujoco": "a MuJoCo model (MJCF), not a URDF; `load_robot` reads its file",
    "sdf": "an SDF model, which is not read here; give the URDF of the same robot, from which most SDF files are made",
    "world": "an SDF world, which is not read here; give the URDF of the robot",
    "COLLADA": "a COLLADA mesh, not a robot; give the URDF that names it",
}


def refuse_foreign(outermost: XmlElement) -> None:
    """Raise `InputError` where a document is no URDF, saying what it is and what to do."""
    if outermost.tag in _FORMATS:
        outermost.fail(_FORMATS[outermost.tag])
    macro = next((element for element in outermost.all() if _is_macro(element)), None)
    if macro is not None:
        where = "a xacro macro" if macro.tag.startswith("xacro:") else "an expression of xacro"
        macro.fail(
            f"{where}: the text is a template, which is not expanded by its content alone; rename the file to "
            f"{macro.source.removesuffix('.urdf').removesuffix('.xml')}.urdf.xacro, or give `xacro=True`, if you trust "
            "whom it is from"
        )
    if outermost.tag != "robot":
        outermost.fail("expected <robot> as the outermost element, as of a URDF")


def _is_macro(element: XmlElement) -> bool:
    expression = any("${" in value or "$(" in value for value in element.attributes.values())
    return element.tag.startswith("xacro:") or (element.tag in READ and expression)  # files of meshes may have both
