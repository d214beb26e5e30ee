"""Which kind of robot description an XML file holds: told by its outermost element; a xacro by its name only."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from xml.parsers import expat

from regressors.errors import InputError
from regressors.input_files import read_bytes

URDF, XACRO, MJCF = "URDF", "xacro", "MJCF"
_KINDS = {"robot": URDF, "mujoco": MJCF}


class _Decided(Exception):
    """Ends the parsing: nothing further down changes the answer."""


def xml_kind(path: str | Path) -> str:
    """Kind of description in an XML file.

    A name that ends in ``.xacro`` decides, then the outermost element. A text that breaks off, or whose outermost
    element is of no kind of robot, counts as URDF: the reader of URDF says what is wrong with it. So does one that
    holds xacro under another name: it is expanded only where its name, or the user, says so.
    """
    if Path(path).suffix.lower() == ".xacro":
        return XACRO
    try:
        content = read_bytes(path)
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read {str(path)!r}: {getattr(error, 'strerror', None) or error}") from error
    tag, name = _outermost(content), Path(path).name
    if tag == "sdf":
        raise InputError(f"{name}: SDF is not read, expected URDF, xacro or MJCF; give the URDF that it was made from")
    if tag == "mujocoinclude":
        raise InputError(f"{name}: a part of an MJCF, expected a whole one; give the file that includes it")
    return _KINDS.get(tag, URDF)


def _outermost(content: bytes) -> str:
    """Outermost element; nothing where there is none."""
    tags: list[str] = []

    def start(tag: str, _: object) -> None:
        tags.append(tag)
        raise _Decided

    def stop(*_: object) -> None:
        raise _Decided

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    parser.StartDoctypeDeclHandler = stop  # nothing is expanded
    with suppress(_Decided, expat.ExpatError, LookupError, ValueError):
        parser.Parse(content, True)
    return tags[0] if tags else ""
