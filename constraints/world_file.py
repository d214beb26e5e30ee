"""World files: shape of a robot and obstacles as YAML, schema ``excite.world/1``."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, StrictBool

from constraints.geometry import Box, HalfSpace, Obstacle, Part, RangesApart, World, vector_of
from constraints.hulls import ranges_apart, touching_pairs
from constraints.shapes import Carried, carried_links, lowest_point, urdf_shape, urdf_solids
from regressors.arguments import checked
from regressors.errors import InputError, about
from regressors.quantities import Tips
from regressors.readers.documents import Angles, Document, Length, Point, read_document, validate
from regressors.readers.urdf import parse_urdf, urdf_content
from regressors.readers.urdf_elements import URDF, xml_kind
from regressors.robot.robot import Robot
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
    apart: list[RangesApart] = []
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
    return _world(read_document(path, "world file"), UrdfShapes(robot, base, tip, snap_angles))


def world_of(content: Mapping[str, Any], source: str = "world") -> World:
    """The world that `World.to_dict` describes."""
    return _world(Document(source, dict(content), {}), UrdfShapes(""))


def _world(document: Document, urdf: UrdfShapes) -> World:
    content = validate(document, _File)
    if content.robot == "urdf":
        with document.at("robot"):
            parts, left_out = urdf.capsules()
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
        own = (content.clearance, content.self_collision, ignored, content.tolerance, tuple(content.apart))
        world = World(parts, obstacles, *own)
        by_hulls = content.robot == "urdf" and content.self_collision and not content.apart
        return urdf.ranges_apart(world) if by_hulls else world


@dataclass(frozen=True)
class UrdfShapes:
    """The ``<collision>`` shapes of what moves of a URDF, or of a xacro that expands to one."""

    file: str
    base: str | None = None  # name of the first link that may move
    tip: Tips = None
    snap_angles: bool = True

    def capsules(self) -> tuple[tuple[Part, ...], tuple[tuple[str, str], ...]]:
        """Capsules around them, see `constraints.shapes.urdf_shape`, and what was left out."""
        if not self._is_urdf():
            what_is_given = f"{self.file!r} is not one" if self.file else "none is given"
            raise InputError(f"capsules are taken from the <collision> elements of a URDF, but {what_is_given}")
        return urdf_shape(Path(self.file), self._links()[1])

    def lowest(self, normal: Array) -> float | None:
        """Height of the lowest point of the robot's base, see `lowest_point`; None if not known."""
        # normal (3,)
        return lowest_point(Path(self.file), self._links()[1], normal) if self._is_urdf() else None

    def ranges_apart(self, world: World, robot: Robot | None = None, tool: Iterable[Part] = ()) -> World:
        """The world with ranges of joints for links whose capsules touch, see `constraints.hulls`.

        The robot may have other limits than its file. Parts of a tool count with the shapes of the link that they are
        on; links without a shape in the file are left out.
        """
        own, links = self._links()
        robot = own if robot is None else robot
        touching = touching_pairs(robot, world.parts, world.clearance)
        solids = urdf_solids(Path(self.file), links, {link for pair in touching for link in pair})
        for part in (part for part in tool if part.link in solids):
            solids[part.link].append((np.array([[part.capsule.start, part.capsule.end]]), part.capsule.radius))
        return replace(world, apart=ranges_apart(robot, touching, solids, world.clearance))

    def _links(self) -> tuple[Robot, Iterator[Carried]]:
        path, content = Path(self.file), urdf_content(Path(self.file))
        snap = self.snap_angles
        robot = parse_urdf(content, name_of_source=path.name, base=self.base, tip=self.tip, snap_angles=snap)
        return robot, carried_links(path, robot, self.base, snap_angles=snap, content=content)

    def _is_urdf(self) -> bool:
        suffix, is_file = Path(self.file).suffix.lower(), Path(self.file).is_file()
        return suffix == ".xacro" or (suffix in (".urdf", ".xml") and (not is_file or xml_kind(self.file) == URDF))


def world_text(world: World) -> str:
    """Beginning of a world file: capsules to the micrometre, radii rounded up so that they contain the same points."""
    lines = [f"schema: {SCHEMA}", "robot:"]
    for part in world.parts:
        start, end = (", ".join(f"{x:.6f}" for x in point) for point in (part.capsule.start, part.capsule.end))
        radius = math.ceil(part.capsule.radius * 1e6 + 1) / 1e6
        name = json.dumps(part.link, ensure_ascii=False)
        lines.append(f"  - {{link: {name}, from: [{start}], to: [{end}], radius: {radius:.6f}}}")
    lines += ["apart:"] if world.apart else []
    for each in world.apart:
        links, within = (json.dumps(value, ensure_ascii=False) for value in (each.links, each.within))
        lines.append(f"  - {{links: {links}, within: {within}}}")
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
