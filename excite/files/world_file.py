"""World files: shape of a robot and what stands around it as YAML, schema ``excite.world/1``."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from constraints.collision.geometry import Box, Capsule, HalfSpace, Obstacle, Part, Shape, Vector, World
from excite.files.urdf_shapes import urdf_parts
from regressors.errors import InputError
from regressors.readers.documents import Document, FieldPath, parse_document, validate
from regressors.readers.urdf import read_urdf
from regressors.readers.xml_kind import URDF, xml_kind

SCHEMA = "excite.world/1"
_CONFIG = ConfigDict(extra="forbid", allow_inf_nan=False)
_Three = Annotated[list[float], Field(min_length=3, max_length=3)]
_Two = Annotated[list[str], Field(min_length=2, max_length=2)]


class _Capsule(BaseModel):
    model_config = _CONFIG
    start: _Three = Field(alias="from")
    end: _Three | None = Field(default=None, alias="to")  # a sphere has one point
    radius: float


class _Part(_Capsule):
    link: str


class _Sphere(BaseModel):
    model_config = _CONFIG
    centre: _Three
    radius: float


class _Plane(BaseModel):
    model_config = _CONFIG
    normal: _Three
    offset: float = 0.0


class _Box(BaseModel):
    model_config = _CONFIG
    centre: _Three
    size: _Three
    rpy: _Three = [0.0, 0.0, 0.0]


class _Object(BaseModel):
    model_config = _CONFIG
    capsule: _Capsule | None = None
    sphere: _Sphere | None = None
    plane: _Plane | None = None
    box: _Box | None = None


class _File(BaseModel):
    model_config = _CONFIG
    schema_: Literal["excite.world/1"] = Field(default="excite.world/1", alias="schema")
    clearance: float = 0.01
    tolerance: float = 0.005
    self_collision: bool = True
    ignore: list[_Two] = []
    robot: list[_Part] | Literal["urdf"]
    objects: dict[str, _Object] = {}


def read_world(path: Path, robot: str = "", base: str | None = None, tip: str | None = None) -> World:
    """Content of a world file.

    Parameters
    ----------
    path : Path
    robot : str
        URDF that the robot's shape is taken from if the file says ``robot: urdf``.
    base, tip : str, optional
        Names of the first and last link of the chain in it.

    Raises
    ------
    InputError
        Cannot be read, malformed (with the line), or shapes that cannot be.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read world file {path}: {getattr(error, 'strerror', None) or error}") from error
    return _world(parse_document(text, str(path)), (robot, base, tip))


def world_of(content: Mapping[str, Any], source: str = "world") -> World:
    """The world that `World.to_dict` describes.

    Parameters
    ----------
    content : mapping
        The keys of a world file.
    source : str
        Where it is from, for messages.

    Raises
    ------
    InputError
        As `read_world`.
    """
    return _world(Document(source, dict(content), {}), ("", None, None))


def _world(document: Document, chain: tuple[str, str | None, str | None]) -> World:
    content = validate(document, _File)
    if content.robot == "urdf":
        try:
            parts = urdf_capsules(*chain)
        except InputError as error:
            raise document.error([(("robot",), str(error))]) from error
    else:
        parts = tuple(_part(document, k, entry) for k, entry in enumerate(content.robot))
    obstacles = tuple(Obstacle(name, _shape(document, name, entry)) for name, entry in content.objects.items())
    ignored = tuple((pair[0], pair[1]) for pair in content.ignore)
    try:
        return World(parts, obstacles, content.clearance, content.self_collision, ignored, content.tolerance)
    except InputError as error:
        raise InputError(f"{document.source}: {error}") from error


def urdf_capsules(robot: str, base: str | None = None, tip: str | None = None) -> tuple[Part, ...]:
    """Shape of a chain of a URDF, see `excite.files.urdf_shapes.urdf_parts`.

    Parameters
    ----------
    robot : str
        The file.
    base, tip : str, optional
        Names of the first and last link of the chain.

    Raises
    ------
    InputError
        The robot is no URDF, or one without usable shapes.
    """
    if not robot.lower().endswith((".urdf", ".xml")) or (Path(robot).is_file() and xml_kind(robot) != URDF):
        what_is_given = f"{robot!r} is none" if robot else "none is given"
        raise InputError(f"capsules are taken from the <collision> elements of a URDF, but {what_is_given}")
    return urdf_parts(Path(robot), read_urdf(robot, base=base, tip=tip), base)


def capsules_text(parts: Iterable[Part]) -> str:
    """Beginning of a world file: capsules to the micrometre, their radii rounded up to hold what they held."""
    lines = [f"schema: {SCHEMA}", "robot:"]
    for part in parts:
        start, end = (", ".join(f"{x:.6f}" for x in point) for point in (part.capsule.start, part.capsule.end))
        radius = math.ceil(part.capsule.radius * 1e6 + 1) / 1e6
        name = json.dumps(part.link, ensure_ascii=False)
        lines.append(f"  - {{link: {name}, from: [{start}], to: [{end}], radius: {radius:.6f}}}")
    return "\n".join(lines) + "\n"


def _vector(values: list[float]) -> Vector:
    x, y, z = values
    return x, y, z


def _part(document: Document, number: int, entry: _Part) -> Part:
    try:
        return Part(entry.link, _capsule(entry))
    except InputError as error:
        raise document.error([(("robot", number), str(error))]) from error


def _shape(document: Document, name: str, entry: _Object) -> Shape:
    """The one shape that an object has."""
    kinds: dict[str, Callable[[Any], Shape]] = {"capsule": _capsule, "sphere": _sphere, "plane": _plane, "box": _box}
    given = [kind for kind in kinds if getattr(entry, kind) is not None]
    if len(given) != 1:
        what_is_given = ", ".join(given) or "nothing"
        raise document.error([(("objects", name), f"expected one of {', '.join(kinds)}, given {what_is_given}")])
    place: FieldPath = ("objects", name, given[0])
    try:
        return kinds[given[0]](getattr(entry, given[0]))
    except InputError as error:
        raise document.error([(place, str(error))]) from error


def _capsule(entry: _Capsule) -> Capsule:
    return Capsule(_vector(entry.start), _vector(entry.start if entry.end is None else entry.end), entry.radius)


def _sphere(entry: _Sphere) -> Capsule:
    return Capsule(_vector(entry.centre), _vector(entry.centre), entry.radius)


def _plane(entry: _Plane) -> HalfSpace:
    """Of any length of the normal; the offset is the distance along it."""
    length = math.hypot(*entry.normal)
    if length == 0:
        raise InputError("normal must not be zero")
    return HalfSpace(_vector([x / length for x in entry.normal]), entry.offset)


def _box(entry: _Box) -> Box:
    return Box(_vector(entry.centre), _vector(entry.size), _vector(entry.rpy))
