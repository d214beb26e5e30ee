"""Distances between bodies that move with the links, and between bodies and the floor.

The squared distance of a point from a convex body is the least of ``|p - y|^2`` over the points y of the body. Its
derivative is that of ``|p - y|^2`` with the nearest y held [Danskin 1967], so it is continuous although y is not
smooth.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from constraints.geometry import Box, HalfSpace, Obstacle, Part, Shape, vector_of
from regressors.errors import percent
from regressors.robot.inertia import skew
from regressors.robot.robot import BASE, Joint, Robot, finite_ranges, placed_bodies
from regressors.robot.shapes import Capsule
from regressors.robot.symbolic.kinematics import relative_pose, sparse
from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class Gap:
    """A function whose bound keeps two bodies, or parts of them, apart."""

    # distance from a plane [m]; or squared distance of two points [m^2], one of them the nearest of a body
    value: ca.SX
    reach: float  # sum of the bodies' radii, to be subtracted from the distance [m]
    squared: bool
    # symbols in the value and their expressions, which are held constant in derivatives
    held: tuple[tuple[ca.SX, ca.SX], ...] = field(default=())


def _at(pose: Pose, point: Array) -> ca.SX:
    return pose[1] + ca.mtimes(pose[0], sparse(point))


def _clipped(value: ca.SX, low: Array | float, high: Array | float) -> ca.SX:
    return ca.fmin(ca.fmax(value, low), high)


def _to_line(point: ca.SX, pose: Pose, capsule: Capsule, reach: float) -> Gap:
    """Squared distance of a point from the line of a capsule."""
    start = _at(pose, np.array(capsule.start))
    if capsule.length == 0:
        return Gap(ca.sumsqr(point - start), reach, True)
    line = ca.mtimes(pose[0], sparse(np.subtract(capsule.end, capsule.start)))
    t = ca.SX.sym("t")
    nearest = _clipped(ca.dot(point - start, line) / capsule.length**2, 0.0, 1.0)
    return Gap(ca.sumsqr(point - start - t * line), reach, True, ((t, nearest),))


def _to_box(point: ca.SX, box: Box, reach: float) -> Gap:
    """Squared distance of a point from a fixed box in the same frame."""
    local = ca.mtimes(sparse(box.rotation.T), point - sparse(np.array(box.centre)))
    half = np.array(box.size) / 2
    y = ca.SX.sym("y", 3)
    return Gap(ca.sumsqr(local - y), reach, True, ((y, _clipped(local, -half, half)),))


def gaps(capsule: Capsule, pose: Pose, shape: Shape, other: Pose, tolerance: float) -> list[Gap]:
    """Functions that together keep a capsule and another body apart; they never exceed the true distance.

    For a plane, and for a pair with a sphere, they are exact. Otherwise one body is covered by spheres, which reduces
    the distance by up to the tolerance.
    """
    ends = [capsule.start] if capsule.length == 0 else [capsule.start, capsule.end]
    if isinstance(shape, HalfSpace):
        normal = sparse(np.array(shape.normal))
        return [
            Gap(ca.dot(normal, _at(pose, np.array(end))) - shape.offset - capsule.radius, 0.0, False) for end in ends
        ]
    centres, radius = capsule.covering(tolerance)
    if isinstance(shape, Box):
        return [_to_box(_at(pose, centre), shape, radius) for centre in centres]
    others, wide = shape.covering(tolerance)
    if len(others) < len(centres):
        return [_to_line(_at(other, centre), pose, capsule, wide + capsule.radius) for centre in others]
    return [_to_line(_at(pose, centre), other, shape, radius + shape.radius) for centre in centres]


Pose = tuple[ca.SX, ca.SX]


class Frames:
    """Tree of the frames of a robot's links and branches."""  # q (n, 1)

    def __init__(self, robot: Robot, q: ca.SX) -> None:
        self.parent: dict[str, str] = {}
        self._step: dict[str, Pose] = {}
        for name, parent, joint, row, offset in placed_bodies(robot):
            s = ca.mtimes(sparse(row[None]), q) + offset
            self.parent[name], self._step[name] = parent, relative_pose(joint, s)
        self._known: dict[tuple[str, str], Pose] = {}

    def path(self, body: str) -> list[str]:
        """A body, the body that carries it, and so on to the base."""
        bodies = [body]
        while bodies[-1] != BASE:
            bodies.append(self.parent[bodies[-1]])
        return bodies

    def common(self, first: str, second: str) -> str:
        """Nearest common ancestor of two bodies, possibly one of them."""
        below = set(self.path(second))
        return next(body for body in self.path(first) if body in below)

    def pose(self, body: str, ancestor: str) -> Pose:
        """Axes and origin of a body's frame in the frame of an ancestor, shape (3, 3) and (3, 1) [-, m]."""
        if body == ancestor:
            return ca.SX.eye(3), ca.SX(3, 1)
        if (body, ancestor) not in self._known:
            R, p = self.pose(self.parent[body], ancestor)
            step, origin = self._step[body]
            self._known[body, ancestor] = ca.mtimes(R, step), p + ca.mtimes(R, origin)
        return self._known[body, ancestor]


def link_poses(robot: Robot, q: Array) -> dict[str, Array]:
    """Pose of the base, of every link and of every branch in the base frame, shape (N, 4, 4) each."""  # q (N, n)
    poses = {BASE: np.broadcast_to(np.eye(4), (len(q), 4, 4))}
    for name, parent, joint, row, offset in placed_bodies(robot):
        poses[name] = poses[parent] @ _steps(joint, q @ row + offset)
    return poses


def _steps(joint: Joint, q: Array) -> Array:
    """Poses of a joint's link in the frame of the link before it, shape (N, 4, 4)."""
    T = np.tile(np.eye(4), (q.size, 1, 1))
    T[:, :3, :3], T[:, :3, 3] = joint.rotation, joint.translation
    if joint.kind == "prismatic":
        T[:, :3, 3] += q[:, None] * (joint.rotation @ joint.axis)
    else:
        K = skew(joint.axis)
        turn = np.eye(3) + np.sin(q)[:, None, None] * K + (1.0 - np.cos(q))[:, None, None] * (K @ K)
        T[:, :3, :3] = joint.rotation @ turn
    return T


CLEARANCE = 0.02  # m
DEEP = 0.05  # m: arms on a table reach less below it at position zero, legs and hanging arms 0.15 m and more
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


def moving_heights(robot: Robot, parts: Sequence[Part], surface: Obstacle) -> dict[str, Array]:
    """Heights above a surface of the links that joints raise or lower, at position zero and in random poses."""
    assert isinstance(surface.shape, HalfSpace)
    low, high = finite_ranges(robot)
    q = np.vstack([np.clip(0.0, low, high), np.random.default_rng(0).uniform(low, high, (_POSES, robot.n))])
    height = {link: values - surface.shape.offset for link, values in _heights(robot, parts, surface.shape, q).items()}
    return {link: values for link, values in height.items() if np.ptp(values) > 1e-9}


def why_not_mounted(height: Mapping[str, Array]) -> str | None:
    """Why a robot does not stand on a surface, judged by the heights of what moves above it; None if it may.

    At position zero, or as near to it as the limits allow, no link reaches further below the plane than 5 cm; and in at
    least 5 % of random poses within the limits all are above it.
    """
    deepest = min(height, key=lambda link: float(height[link][0]))
    depth = -float(height[deepest][0])
    if depth > DEEP:
        return f"at position zero {deepest} is {depth:.2g} m below the base, so the base does not stand on it"
    share = float(np.mean(np.min(list(height.values()), axis=0)[1:] > 0.0))
    if share < _SHARE:
        return f"the robot is above it in {percent(share)} of its poses, so the base does not stand on it"
    return None


def _heights(robot: Robot, parts: Iterable[Part], plane: HalfSpace, q: Array) -> dict[str, Array]:
    """Least height of the lines of each link's capsules along the normal, by link, shape (poses,) [m]."""
    poses = link_poses(robot, q)
    heights: dict[str, Array] = {}
    for part in (part for part in parts if part.link in poses):
        pose = poses[part.link]
        for end in (part.capsule.start, part.capsule.end):
            own = (pose[:, :3, :3] @ np.array(end) + pose[:, :3, 3]) @ np.array(plane.normal)
            heights[part.link] = np.minimum(own, heights.get(part.link, np.inf))
    return heights


_OF_LENGTH = 0.05
_SAME = 1e-6  # m: nearer points are one


def assumed_radius(robot: Robot) -> float:
    """Radius that links of unknown shape are given: 5 % of the length of the skeleton, of its longest limb [m]."""
    bones = skeleton(robot, 1.0)
    lengths = (sum(part.capsule.length for part in bones if part.link in {BASE, *limb}) for limb in robot.limbs)
    return max(_OF_LENGTH * max(lengths), _SAME)


def skeleton(robot: Robot, radius: float, links: Collection[str] | None = None) -> tuple[Part, ...]:
    """Capsules from the origin of each body's frame to the joints that it carries; a sphere where it carries none."""
    carried: dict[str, list[Joint]] = {BASE: []}
    for name, parent, joint, *_ in placed_bodies(robot):
        carried[parent].append(joint)
        carried[name] = []
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
