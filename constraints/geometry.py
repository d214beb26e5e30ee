"""Shapes of links and objects, and capsules around them.

Lengths in m, angles in rad. A sphere is a capsule of length zero.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np
import scipy

from regressors.errors import InputError, check_names
from regressors.robot.inertia import rotation_from_rpy
from regressors.robot.robot import BASE, Robot
from regressors.robot.shapes import (
    Capsule as Capsule,
    Part as Part,
    Vector as Vector,
    check_finite,
    vector_of as vector_of,
)
from regressors.samples import Array

_DEEP = 1e-3  # m: a base deeper inside an obstacle than this is an error, not a robot mounted on it


@dataclass(frozen=True)
class HalfSpace:
    """All points below a plane, ``normal . p <= offset``."""

    normal: Vector  # unit vector away from the solid side
    offset: float

    def __post_init__(self) -> None:
        check_finite("plane", *self.normal, self.offset)
        if abs(np.linalg.norm(self.normal) - 1.0) > 1e-9:
            raise InputError(f"normal must have length 1, given {np.linalg.norm(self.normal):g}")

    def distance(self, point: Array) -> float:
        """Distance from a point to the surface, negative inside."""
        return float(np.dot(self.normal, point)) - self.offset


@dataclass(frozen=True)
class Box:
    """A cuboid."""

    centre: Vector
    size: Vector  # full lengths of its sides, > 0
    rpy: Vector = (0.0, 0.0, 0.0)  # orientation of its axes, ``Rz(yaw) Ry(pitch) Rx(roll)``

    def __post_init__(self) -> None:
        check_finite("box", *self.centre, *self.size, *self.rpy)
        if not min(self.size) > 0:
            raise InputError(f"size must be greater than zero, given {', '.join(f'{side:g}' for side in self.size)}")

    @property
    def rotation(self) -> Array:
        """Rotation matrix of its axes, shape (3, 3)."""
        return rotation_from_rpy(self.rpy)

    def distance(self, point: Array) -> float:
        """Distance from a point to the surface, negative inside."""
        beyond = np.abs(self.rotation.T @ (point - self.centre)) - np.array(self.size) / 2
        return float(np.linalg.norm(np.maximum(beyond, 0.0)) + min(beyond.max(), 0.0))


Shape = Capsule | HalfSpace | Box
_KINDS = {Capsule: "capsule", HalfSpace: "plane", Box: "box"}


def _plain(shape: Shape) -> dict[str, object]:
    """Fields of a shape under their names in a world file."""
    names = {"start": "from", "end": "to"}
    fields = asdict(shape).items()
    return {names.get(name, name): list(value) if isinstance(value, tuple) else value for name, value in fields}


@dataclass(frozen=True)
class Obstacle:
    """A solid body that does not move, in the base frame."""

    name: str
    shape: Shape
    clearance: float | None = None  # least distance from it, > 0; that of the world if not given [m]
    # whether the robot is fastened to it: what no motion moves away from it stands on it, and is not checked
    mounting: bool = False

    def __post_init__(self) -> None:
        if self.clearance is not None and not (np.isfinite(self.clearance) and self.clearance > 0):
            raise InputError(f"clearance of {self.name!r} must be greater than zero, given {self.clearance:g}")


@dataclass(frozen=True)
class RangesApart:
    """Ranges of joints in which two links keep the clearance, see `constraints.hulls`."""

    links: tuple[str, str]
    within: tuple[tuple[str, float, float], ...]  # joint, least and largest position [rad or m]

    def __post_init__(self) -> None:
        for joint, lower, upper in self.within:
            check_finite(f"apart: range of {joint}", lower, upper)
            if not lower < upper:
                raise InputError(f"apart: the range of {joint} must begin below its end, given {lower:g} to {upper:g}")


@dataclass(frozen=True)
class World:
    """Shape of a robot, its obstacles, and the clearance between them."""

    parts: tuple[Part, ...]  # capsules of the robot
    obstacles: tuple[Obstacle, ...] = ()
    clearance: float = 0.01  # least distance, > 0
    self_collision: bool = True  # whether the robot's links must stay apart from each other
    ignored: tuple[tuple[str, str], ...] = ()  # names of links or obstacles that need not stay apart
    tolerance: float = 0.005  # amount by which a capsule may be thickened, > 0; smaller values are slower
    apart: tuple[RangesApart, ...] = ()  # pairs that ranges of joints keep apart, instead of their capsules

    def __post_init__(self) -> None:
        for what in ("clearance", "tolerance"):
            if not (np.isfinite(getattr(self, what)) and getattr(self, what) > 0):
                raise InputError(f"{what} must be greater than zero, given {getattr(self, what):g}")
        if not self.parts:
            raise InputError("robot: no capsule is given; give one or more for its links")
        names = [obstacle.name for obstacle in self.obstacles]
        links = list(dict.fromkeys(part.link for part in self.parts))
        for name in names:
            if names.count(name) > 1 or name in links:
                raise InputError(f"objects: {name!r} is the name of two bodies; give each its own")
        named = (name for pair in self.ignored for name in pair)
        check_names("link with a shape, or object,", named, (*links, *names))
        check_names("link with a shape", (link for each in self.apart for link in each.links), links)

    def to_dict(self) -> dict[str, object]:
        """Plain values, the keys of a world file."""
        return {
            "clearance": self.clearance,
            "tolerance": self.tolerance,
            "self_collision": self.self_collision,
            "ignore": [list(pair) for pair in self.ignored],
            "apart": [{"links": list(each.links), "within": list(map(list, each.within))} for each in self.apart],
            "robot": [part.to_dict() for part in self.parts],
            "objects": {
                obstacle.name: {
                    _KINDS[type(obstacle.shape)]: _plain(obstacle.shape),
                    **({} if obstacle.clearance is None else {"clearance": obstacle.clearance}),
                    **({"mounting": True} if obstacle.mounting else {}),
                }
                for obstacle in self.obstacles
            },
        }

    def check(self, robot: Robot) -> None:
        """Raise `InputError` for a capsule on a link that a robot does not have, or an obstacle around its base."""
        known = (BASE, *(body.name for body in robot.bodies))
        check_names(f"link of robot {robot.name!r}", (part.link for part in self.parts), known)
        moving = (joint for each in self.apart for joint, *_ in each.within)
        check_names(f"joint of robot {robot.name!r}", moving, robot.joint_names)
        for obstacle in (each for each in self.obstacles if not each.mounting):
            depth = -obstacle.shape.distance(np.zeros(3))
            if depth > _DEEP:
                raise InputError(
                    f"object {obstacle.name!r} contains the robot's base, whose origin is {depth:.4g} m inside it"
                )


_SLACK = 1e-9  # of the radius: points on the surface count as inside
_AT_FIRST, _FURTHER = 150, (200, 200)  # iterations from each axis, and from the best, with a new simplex each
_DIRECTIONS = 300


def enclosing_capsule(points: Array) -> Capsule:
    """Capsule of small volume that contains all points.

    ``radius = max_k |p_k - line|`` for the line from a to b; a and b by the simplex method of Nelder and Mead on the
    outermost points, from the best of their principal axes: a local minimum, perhaps not the global one.
    """  # points (N, 3)
    points = np.asarray(points, dtype=float)
    if points.ndim != 2 or points.shape[0] == 0 or not np.all(np.isfinite(points)):
        raise InputError("a capsule needs one point or more, all of them finite")
    corners = _outermost(points)
    centre = corners.mean(axis=0)
    axes = np.linalg.svd(corners - centre, full_matrices=False)[2]
    found = []
    for axis in axes:
        along = (corners - centre) @ axis
        start = np.concatenate([centre + 0.7 * along.min() * axis, centre + 0.7 * along.max() * axis])
        found.append(_smaller(start, corners, _AT_FIRST))
    best = min(found, key=lambda ends: _volume(ends, corners))
    for iterations in _FURTHER:
        best = _smaller(best, corners, iterations)
    radius = _radius(best, points) * (1 + _SLACK)
    return Capsule(vector_of(best[:3]), vector_of(best[3:]), max(radius, _SLACK))


def _smaller(ends: Array, points: Array, iterations: int) -> Array:
    return np.asarray(scipy.optimize.fmin(_volume, ends, (points,), 1e-5, 1e-9, iterations, disp=False))


def enclosing_cylinder(radius: float, length: float) -> Capsule:
    """Capsule of least volume about a cylinder along z: ``R^2 = radius^2 + (length / 2 - a)^2``, its ends at +-a."""
    if not (np.isfinite(radius + length) and radius > 0 and length > 0):
        raise InputError(f"a cylinder needs a radius and a length greater than zero, given {radius:g} and {length:g}")

    def volume(a: float) -> float:
        R = np.hypot(radius, length / 2 - a)
        return float(2 * R**2 * a + 4 / 3 * R**3)

    a = float(scipy.optimize.minimize_scalar(volume, bounds=(0.0, length / 2), method="bounded").x)
    return Capsule((0.0, 0.0, -a), (0.0, 0.0, a), float(np.hypot(radius, length / 2 - a)) * (1 + _SLACK))


def _outermost(points: Array) -> Array:
    """Points that are furthest in one of many directions spread evenly over the sphere (Fibonacci lattice)."""
    k = np.arange(_DIRECTIONS) + 0.5
    z, angle = 1 - 2 * k / _DIRECTIONS, np.pi * (1 + np.sqrt(5)) * k
    directions = np.array([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z])
    return np.asarray(points[np.unique([int(np.argmax(points @ direction)) for direction in directions.T])])


def _radius(ends: Array, points: Array) -> float:
    a, line = ends[:3], ends[3:] - ends[:3]
    square, off = float(line @ line), points - a
    t = np.minimum(np.maximum(off @ line / square, 0.0), 1.0) if square > 0 else np.zeros(len(points))
    x, y, z = (off - t[:, None] * line).T
    return math.sqrt((x * x + y * y + z * z).max())


def _volume(ends: Array, points: Array) -> float:
    """Volume of the capsule about a line, in units of pi m^3."""
    r = _radius(ends, points)
    return r**2 * math.dist(ends[:3], ends[3:]) + 4 / 3 * r**3
