"""The plane that a robot is mounted on, and the skeleton that stands for links without shapes."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

import numpy as np

from constraints.collision.clearance import link_poses
from constraints.collision.geometry import Capsule, HalfSpace, Obstacle, Part, vector_of
from regressors.robot.robot import BASE, Joint, Robot
from regressors.samples import Array

CLEARANCE = 0.02  # m
_DEEP = 0.05  # m: arms on a table reach less below it at position zero, legs and hanging arms 0.15 m and more
_SHARE = 0.05  # of random poses: arms on a table are above it in 44 % and more, legs and hanging arms in at most 1 %
_POSES = 500


def mounting_surface(name: str, normal: Array, height: float) -> Obstacle:
    """The half-space behind a robot's base."""  # normal (3,)
    return Obstacle(name, HalfSpace(vector_of(normal / np.linalg.norm(normal)), height), CLEARANCE, mounting=True)


def upwards(robot: Robot) -> Array:
    """Unit vector against gravity in the axes of the base; its z axis where there is no gravity, shape (3,)."""
    size = np.linalg.norm(robot.gravity)
    up = -robot.gravity / size if size > 0 else np.array([0.0, 0.0, 1.0])
    return np.where(np.abs(up) < 1e-12, 0.0, up)


def why_not_mounted(robot: Robot, parts: Sequence[Part], surface: Obstacle) -> str | None:
    """Why a robot does not stand on a surface, judged by what its description says; None if it may.

    At position zero, or as near to it as the limits allow, no link reaches further below the plane than 5 cm; and in at
    least 5 % of random poses within the limits all are above it.
    """
    assert isinstance(surface.shape, HalfSpace)
    low, high = (
        np.where(np.isfinite(end), end, side)
        for end, side in ((robot.limits.lower, -np.pi), (robot.limits.upper, np.pi))
    )
    q = np.vstack([np.clip(0.0, low, high), np.random.default_rng(0).uniform(low, high, (_POSES, robot.n))])
    height = {link: values - surface.shape.offset for link, values in _heights(robot, parts, surface.shape, q).items()}
    moving = {link: values for link, values in height.items() if np.ptp(values) > 1e-9}
    if not moving:
        return "no joint changes a height above it"
    deepest = min(moving, key=lambda link: float(moving[link][0]))
    depth = -float(moving[deepest][0])
    if depth > _DEEP:
        return f"at position zero {deepest} is {depth:.2g} m below the base, so the base does not stand on it"
    share = float(np.mean(np.min(list(moving.values()), axis=0)[1:] > 0.0))
    if share < _SHARE:
        return f"the robot is above it in {100 * share:.2g} % of its poses, so the base does not stand on it"
    return None


def _heights(robot: Robot, parts: Iterable[Part], plane: HalfSpace, q: Array) -> dict[str, Array]:
    """Least height of the lines of each link's capsules along the normal, by link, shape (poses,) [m]."""
    poses = link_poses(robot, q)
    heights: dict[str, Array] = {}
    for part in (part for part in parts if part.link in poses):
        pose = poses[part.link]
        for end in _ends(part.capsule):
            own = (pose[:, :3, :3] @ np.array(end) + pose[:, :3, 3]) @ np.array(plane.normal)
            heights[part.link] = np.minimum(own, heights.get(part.link, np.inf))
    return heights


def _ends(capsule: Capsule) -> list[tuple[float, float, float]]:
    return [capsule.start, capsule.end]


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
        parts += [Part(name, Capsule((0.0, 0.0, 0.0), vector_of(end), radius)) for end in ends or [np.zeros(3)]]
    return tuple(parts)


def _places(robot: Robot, joint: Joint) -> list[Array]:
    """Where a joint's frame may be in the frame that carries it: a place, or the ends of a prismatic joint's range."""
    if joint.kind != "prismatic":
        return [joint.translation]
    numbers = [k for k, own in enumerate(robot.joints) if own is joint]
    ranges = [(robot.limits.lower[k], robot.limits.upper[k]) for k in numbers] or [(0.0, 0.0)]
    ends = [end if np.isfinite(end) else 0.0 for end in ranges[0]]
    return [joint.translation + joint.rotation @ (joint.axis * end) for end in ends]
