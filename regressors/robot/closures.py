"""Closures of a robot's loops: what holds two of its bodies together where the tree of joints was cut open.

An ideal closure does no work: its forces are in no energy equation of the whole mechanism [KD96] eq. (4)-(7).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from regressors.errors import InputError, check_names
from regressors.robot.inertia import is_rotation
from regressors.robot.shapes import Vector, check_finite, vector_of

Axes = tuple[Vector, Vector, Vector]


@dataclass(frozen=True)
class Closure:
    """A point of one body stays at a point of another; where axes are given, the bodies do not turn either (a weld)."""

    bodies: tuple[str, str]  # names of links or branches, or `BASE`
    points: tuple[Vector, Vector]  # in the frame of each body [m]
    axes: Axes | None = None  # rows of the rotation from the second body's axes to the first one's

    def __post_init__(self) -> None:
        check_finite(self.label, *self.points[0], *self.points[1])
        if self.bodies[0] == self.bodies[1]:
            raise InputError(f"{self.label}: expected two bodies, given {self.bodies[0]!r} twice")
        if self.axes is not None and not is_rotation(np.array(self.axes)):
            raise InputError(f"{self.label}: its axes are not a rotation matrix")

    @property
    def label(self) -> str:
        """What it closes, in messages."""
        return f"the loop that closes between {' and '.join(self.bodies)}"

    @classmethod
    def from_dict(cls, plain: Mapping[str, Any]) -> Closure | MimicJoint:
        """Closure of plain lists; a mimic joint where these name joints."""
        if plain.get("joints"):
            follower, leader = map(str, plain["joints"])
            return MimicJoint((follower, leader), float(plain["multiplier"]), float(plain["offset"]))
        first, second = map(vector_of, plain["points"])
        a, b = map(str, plain["bodies"])
        axes = plain.get("axes")
        held = None if axes is None else (vector_of(axes[0]), vector_of(axes[1]), vector_of(axes[2]))
        return cls((a, b), (first, second), held)


@dataclass(frozen=True)
class MimicJoint:
    """A joint follows another one by a belt, a rod or a gear, ``q_1 = multiplier q_2 + offset`` [rad or m]."""

    joints: tuple[str, str]  # the one that follows, and the one that it follows
    multiplier: float = 1.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        check_finite(self.label, self.multiplier, self.offset)
        if self.joints[0] == self.joints[1]:
            raise InputError(f"{self.label}: expected two joints, given {self.joints[0]!r} twice")

    @property
    def label(self) -> str:
        """What follows what, in messages."""
        return f"the joint {self.joints[0]} that follows {self.joints[1]}"


def check_closures(
    robot: str,
    closures: Sequence[Closure | MimicJoint],
    passive: Sequence[str],
    joints: Sequence[str],
    bodies: Sequence[str],
) -> None:
    """Raise `InputError` for closures of bodies, or passive joints, that a robot does not have."""
    for closure in closures:
        what, known = ("joint", joints) if isinstance(closure, MimicJoint) else ("body", bodies)
        ends = closure.joints if isinstance(closure, MimicJoint) else closure.bodies
        check_names(f"{what} of robot {robot!r}, in {closure.label},", ends, known)
    check_names(f"passive joint of robot {robot!r}", passive, joints)
    if passive and not closures:
        raise InputError(
            f"robot {robot!r}: passive joints ({', '.join(passive)}) are those of closed loops, but it has no loop; "
            "state `loops:`, or leave out `passive:`"
        )
