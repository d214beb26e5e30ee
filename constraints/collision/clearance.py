"""Distances between bodies that move with the links, and the links' frames.

The squared distance of a point from a convex body is the least of ``|p - y|^2`` over the points y of the body. Its
derivative is that of ``|p - y|^2`` with the nearest y held [Danskin 1967], so it is continuous although y is not
smooth.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from constraints.collision.geometry import Box, Capsule, HalfSpace, Shape
from regressors.robot.inertia import skew
from regressors.robot.robot import BASE, Joint, Robot
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


def _squared(vector: ca.SX) -> ca.SX:
    return ca.sumsqr(vector)


def _clipped(value: ca.SX, low: Array | float, high: Array | float) -> ca.SX:
    return ca.fmin(ca.fmax(value, low), high)


def _to_line(point: ca.SX, pose: Pose, capsule: Capsule, reach: float) -> Gap:
    """Squared distance of a point from the line of a capsule."""
    start = _at(pose, np.array(capsule.start))
    if capsule.length == 0:
        return Gap(_squared(point - start), reach, True)
    line = ca.mtimes(pose[0], sparse(np.subtract(capsule.end, capsule.start)))
    t = ca.SX.sym("t")
    nearest = _clipped(ca.dot(point - start, line) / capsule.length**2, 0.0, 1.0)
    return Gap(_squared(point - start - t * line), reach, True, ((t, nearest),))


def _to_box(point: ca.SX, box: Box, reach: float) -> Gap:
    """Squared distance of a point from a fixed box in the same frame."""
    local = ca.mtimes(sparse(box.rotation.T), point - sparse(np.array(box.centre)))
    half = np.array(box.size) / 2
    y = ca.SX.sym("y", 3)
    return Gap(_squared(local - y), reach, True, ((y, _clipped(local, -half, half)),))


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
        before = BASE
        for k, (joint, link) in enumerate(zip(robot.joints, robot.links, strict=True)):
            self.parent[link.name], self._step[link.name] = before, relative_pose(joint, q[k])
            before = link.name
        for branch in robot.branches:
            s = ca.mtimes(sparse(np.array(branch.coupling)[None]), q) + branch.offset
            self.parent[branch.name], self._step[branch.name] = branch.parent, relative_pose(branch.joint, s)
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
    before = BASE
    for k, (joint, link) in enumerate(zip(robot.joints, robot.links, strict=True)):
        poses[link.name], before = poses[before] @ _steps(joint, q[:, k]), link.name
    for branch in robot.branches:
        poses[branch.name] = poses[branch.parent] @ _steps(branch.joint, q @ branch.coupling + branch.offset)
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
