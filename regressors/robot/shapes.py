"""Shapes of a robot's links: capsules in the frames of the links, and their entries in files.

Lengths in m. A sphere is a capsule of length zero.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from regressors.errors import InputError
from regressors.robot.inertia import Array

Vector = tuple[float, float, float]


def vector_of(values: Iterable[float]) -> Vector:
    """Three numbers."""
    x, y, z = map(float, values)
    return x, y, z


def check_finite(what: str, *values: float) -> None:
    """Raise `InputError` for a number that is not finite."""
    if not np.all(np.isfinite(values)):
        raise InputError(f"{what}: expected finite numbers, given {', '.join(f'{value:g}' for value in values)}")


@dataclass(frozen=True)
class Capsule:
    """All points within a radius of a line from one point to another."""

    start: Vector  # ends of the line; the same for a sphere
    end: Vector
    radius: float  # > 0

    def __post_init__(self) -> None:
        check_finite("capsule", *self.start, *self.end, self.radius)
        if not self.radius > 0:
            raise InputError(f"radius must be greater than zero, given {self.radius:g}")

    @property
    def length(self) -> float:
        """Length of the line."""
        return float(np.linalg.norm(np.subtract(self.end, self.start)))

    def distance(self, point: Array) -> float:
        """Distance from a point to the surface, negative inside."""
        line = np.subtract(self.end, self.start)
        along = line @ (point - self.start) / (line @ line) if self.length > 0 else 0.0
        return float(np.linalg.norm(point - self.start - np.clip(along, 0.0, 1.0) * line)) - self.radius

    def moved(self, pose: Array) -> Capsule:
        """The same capsule in the frame in which its own frame has a pose, shape (4, 4)."""
        start, end = (pose[:3, :3] @ np.array(point) + pose[:3, 3] for point in (self.start, self.end))
        return Capsule(tuple(start.tolist()), tuple(end.tolist()), self.radius)

    def covering(self, tolerance: float) -> tuple[Array, float]:
        """Spheres of one radius whose union covers the capsule.

        With equal distances h between their centres, the first and the last one at its ends,
        ``R^2 = radius^2 + (h / 2)^2``; the fewest with ``R <= radius + tolerance``.
        """  # result (count, 3)
        if self.length == 0:
            return np.array([self.start]), self.radius
        widest = 2 * np.sqrt((self.radius + tolerance) ** 2 - self.radius**2)
        count = int(np.ceil(self.length / widest)) + 1
        spacing = self.length / (count - 1)
        return np.linspace(self.start, self.end, count), float(np.hypot(self.radius, spacing / 2))


@dataclass(frozen=True)
class Part:
    """A capsule on a link of the robot, in the link's frame."""

    link: str  # name of a link, of a branch, or of the base
    capsule: Capsule

    def to_dict(self) -> dict[str, object]:
        """Plain values, as in the list ``shapes`` of a robot's file and ``robot`` of a world file."""
        capsule = self.capsule
        return {"link": self.link, "from": list(capsule.start), "to": list(capsule.end), "radius": capsule.radius}

    @classmethod
    def from_dict(cls, plain: Mapping[str, Any]) -> Part:
        """Inverse of `to_dict`."""
        capsule = Capsule(vector_of(plain["from"]), vector_of(plain["to"]), float(plain["radius"]))
        return cls(str(plain["link"]), capsule)
