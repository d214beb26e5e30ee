"""Which kind of robot description an XML file holds: told by its elements, whatever the file is called."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from xml.parsers import expat

from regressors.errors import InputError
from regressors.input_files import read_bytes

URDF, XACRO, MJCF = "URDF", "xacro", "MJCF"
_KINDS = {"robot": URDF, "mujoco": MJCF}
_XACRO = "xacro:"


class _Decided(Exception):
    """Ends the parsing: nothing further down changes the answer."""


def xml_kind(path: str | Path) -> str:
    """Kind of description in an XML file.

    The outermost element decides, and for ``<robot>`` whether an element of xacro is inside. A text that breaks off, or
    whose outermost element is of no kind of robot, counts as URDF: the reader of URDF says what is wrong with it.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    str
        `URDF`, `XACRO` or `MJCF`.

    Raises
    ------
    InputError
        The file cannot be read, or it is a description that no reader here knows: SDF, or a part of an MJCF.
    """
    try:
        content = read_bytes(path)
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read {str(path)!r}: {getattr(error, 'strerror', None) or error}") from error
    tags = _tags(content)
    name = Path(path).name
    if tags[:1] == ["sdf"]:
        raise InputError(f"{name}: SDF is not read, expected URDF, xacro or MJCF; give the URDF that it was made from")
    if tags[:1] == ["mujocoinclude"]:
        raise InputError(f"{name}: a part of an MJCF, expected a whole one; give the file that includes it")
    if Path(path).suffix.lower() == ".xacro" or any(tag.startswith(_XACRO) for tag in tags):
        return XACRO
    return _KINDS.get(tags[0], URDF) if tags else URDF


def _tags(content: bytes) -> list[str]:
    """Outermost element and, if it is ``<robot>``, what follows up to the first element of xacro."""
    tags: list[str] = []

    def start(tag: str, _: object) -> None:
        tags.append(tag)
        if tags[0] != "robot" or tag.startswith(_XACRO):
            raise _Decided

    def stop(*_: object) -> None:
        raise _Decided

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    parser.StartDoctypeDeclHandler = stop  # nothing is expanded
    with suppress(_Decided, expat.ExpatError, LookupError, ValueError):
        parser.Parse(content, True)
    return tags
