"""Capsules along the links of a robot whose shape is not known: lines between the origins of its joints."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from constraints.collision.geometry import Capsule, Part, Vector
from regressors.robot.robot import BASE, Joint, Robot
from regressors.samples import Array

_OF_LENGTH = 0.05
_SAME = 1e-6  # m: nearer points are one


def assumed_radius(robot: Robot) -> float:
    """Radius that links of unknown shape are given: 5 % of the length of the robot's skeleton [m]."""
    return max(_OF_LENGTH * sum(part.capsule.length for part in skeleton(robot, 1.0)), _SAME)


def skeleton(robot: Robot, radius: float, links: Collection[str] | None = None) -> tuple[Part, ...]:
    """Capsules from the origin of each body's frame to the joints that it carries; a sphere where it carries none."""
    carried: dict[str, list[Joint]] = {BASE: []}
    above = BASE
    for joint, link in zip(robot.joints, robot.links, strict=True):
        carried[above].append(joint)
        carried[link.name], above = [], link.name
    for branch in robot.branches:
        carried.setdefault(branch.name, [])
        carried[branch.parent].append(branch.joint)
    parts = []
    for name, joints in carried.items():
        if links is not None and name not in links:
            continue
        ends = [point for joint in joints for point in _places(robot, joint) if np.linalg.norm(point) > _SAME]
        parts += [Part(name, Capsule((0.0, 0.0, 0.0), _vector(end), radius)) for end in ends or [np.zeros(3)]]
    return tuple(parts)


def _places(robot: Robot, joint: Joint) -> list[Array]:
    """Where a joint's frame may be in the frame that carries it: a place, or the ends of a prismatic joint's range."""
    if joint.kind != "prismatic":
        return [joint.translation]
    numbers = [k for k, own in enumerate(robot.joints) if own is joint]
    ranges = [(robot.limits.lower[k], robot.limits.upper[k]) for k in numbers] or [(0.0, 0.0)]
    ends = [end if np.isfinite(end) else 0.0 for end in ranges[0]]
    return [joint.translation + joint.rotation @ (joint.axis * end) for end in ends]


def _vector(values: Array) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
