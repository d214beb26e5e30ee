"""World files: shape of a robot and obstacles as YAML, schema ``excite.world/1``."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StrictBool

from constraints.geometry import Box, HalfSpace, Obstacle, Part, World, vector_of
from constraints.shapes import Carried, carried_links, lowest_point, urdf_shape
from regressors.arguments import checked
from regressors.errors import InputError, about
from regressors.quantities import Tips
from regressors.readers.documents import Angles, Document, Length, Point, read_document, validate
from regressors.readers.urdf import parse_urdf, urdf_content
from regressors.readers.urdf_elements import URDF, xml_kind
from regressors.robot.shapes import Capsule
from regressors.samples import Array

SCHEMA = "excite.world/1"
_Two = Annotated[list[str], Field(min_length=2, max_length=2)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, defer_build=True)


class _Capsule(_Section):
    start: Point = Field(alias="from")
    end: Point | None = Field(default=None, alias="to")  # a sphere has one point
    radius: Length

    def shape(self) -> Capsule:
        return Capsule(vector_of(self.start), vector_of(self.start if self.end is None else self.end), self.radius)


class _Part(_Capsule):
    link: str


class _Sphere(_Section):
    centre: Point
    radius: Length

    def shape(self) -> Capsule:
        return Capsule(vector_of(self.centre), vector_of(self.centre), self.radius)


class _Plane(_Section):
    normal: Point  # of any length
    offset: Length = 0.0  # distance along it

    def shape(self) -> HalfSpace:
        length = math.hypot(*self.normal)
        if length == 0:
            raise InputError("normal must not be zero")
        return HalfSpace(vector_of([x / length for x in self.normal]), self.offset)


class _Box(_Section):
    centre: Point
    size: Point
    rpy: Angles = [0.0, 0.0, 0.0]

    def shape(self) -> Box:
        return Box(vector_of(self.centre), vector_of(self.size), vector_of(self.rpy))


class _Object(_Section):
    capsule: _Capsule | None = None
    sphere: _Sphere | None = None
    plane: _Plane | None = None
    box: _Box | None = None
    clearance: Length | None = None
    mounting: StrictBool = False


class _File(_Section):
    schema_: Literal["excite.world/1"] = Field(default="excite.world/1", alias="schema")
    clearance: Length = 0.01
    tolerance: Length = 0.005
    self_collision: StrictBool = True
    ignore: list[_Two] = []
    robot: list[_Part] | Literal["urdf"]
    objects: dict[str, _Object] = {}


@checked
def read_world(
    path: str | Path, robot: str = "", base: str | None = None, tip: Tips = None, *, snap_angles: bool = True
) -> World:
    """Read a world file.

    Parameters
    ----------
    path : path
    robot : str
        URDF that supplies the robot's shape if the file has ``robot: urdf``.
    base : str, optional
        Name of the first link in it that may move.
    tip : str or sequence of str, optional
        Name of the last link of the chain in it, or names of the last links of a tree.
    snap_angles : bool
        Take rounded right angles in it for right angles.

    Raises
    ------
    InputError
        Cannot be read, is malformed (with the line), or has invalid shapes.
    """
    return _world(read_document(path, "world file"), partial(urdf_capsules, robot, base, tip, snap_angles=snap_angles))


def world_of(content: Mapping[str, Any], source: str = "world") -> World:
    """The world that `World.to_dict` describes."""
    return _world(Document(source, dict(content), {}), partial(urdf_capsules, ""))


_Shape = tuple[tuple[Part, ...], tuple[tuple[str, str], ...]]


def _world(document: Document, urdf: Callable[[], _Shape]) -> World:
    content = validate(document, _File)
    if content.robot == "urdf":
        with document.at("robot"):
            parts, left_out = urdf()
            if left_out:
                raise InputError(f"{left_out[0][1]}; put it there, or list capsules of your own instead of 'urdf'")
    else:
        parts = ()
        for k, entry in enumerate(content.robot):
            with document.at("robot", k):
                parts += (Part(entry.link, entry.shape()),)
    obstacles = tuple(_obstacle(document, name, each) for name, each in content.objects.items())
    ignored = tuple((pair[0], pair[1]) for pair in content.ignore)
    with about(document.source):
        return World(parts, obstacles, content.clearance, content.self_collision, ignored, content.tolerance)


def urdf_capsules(robot: str, base: str | None = None, tip: Tips = None, *, snap_angles: bool = True) -> _Shape:
    """Shape of what moves of a URDF, see `constraints.shapes.urdf_shape`, and what was left out of it."""
    if not _is_urdf(robot):
        what_is_given = f"{robot!r} is not one" if robot else "none is given"
        raise InputError(f"capsules are taken from the <collision> elements of a URDF, but {what_is_given}")
    return urdf_shape(Path(robot), _links(robot, base, tip, snap_angles))


def urdf_lowest(
    robot: str, normal: Array, base: str | None = None, tip: Tips = None, *, snap_angles: bool = True
) -> float | None:
    """Height of the lowest point of a robot's base, see `lowest_point`; None if not known."""
    # normal (3,)
    return lowest_point(Path(robot), _links(robot, base, tip, snap_angles), normal) if _is_urdf(robot) else None


def _links(robot: str, base: str | None, tip: Tips, snap_angles: bool) -> Iterator[Carried]:
    path, content = Path(robot), urdf_content(Path(robot))
    read = parse_urdf(content, name_of_source=path.name, base=base, tip=tip, snap_angles=snap_angles)
    return carried_links(path, read, base, snap_angles=snap_angles, content=content)


def _is_urdf(robot: str) -> bool:
    """Whether a robot is named by the file of a URDF, or of a xacro that expands to one."""
    suffix, is_file = Path(robot).suffix.lower(), Path(robot).is_file()
    return suffix == ".xacro" or (suffix in (".urdf", ".xml") and (not is_file or xml_kind(robot) == URDF))


def capsules_text(parts: Iterable[Part]) -> str:
    """Beginning of a world file: capsules to the micrometre, radii rounded up so that they contain the same points."""
    lines = [f"schema: {SCHEMA}", "robot:"]
    for part in parts:
        start, end = (", ".join(f"{x:.6f}" for x in point) for point in (part.capsule.start, part.capsule.end))
        radius = math.ceil(part.capsule.radius * 1e6 + 1) / 1e6
        name = json.dumps(part.link, ensure_ascii=False)
        lines.append(f"  - {{link: {name}, from: [{start}], to: [{end}], radius: {radius:.6f}}}")
    return "\n".join(lines) + "\n"


def _obstacle(document: Document, name: str, entry: _Object) -> Obstacle:
    """An object with its single shape."""
    kinds = ("capsule", "sphere", "plane", "box")
    given = [kind for kind in kinds if getattr(entry, kind) is not None]
    if len(given) != 1:
        what_is_given = ", ".join(given) or "nothing"
        raise document.error([(("objects", name), f"expected one of {', '.join(kinds)}, given {what_is_given}")])
    with document.at("objects", name, given[0]):
        shape = getattr(entry, given[0]).shape()
    with document.at("objects", name):
        return Obstacle(name, shape, entry.clearance, entry.mounting)
