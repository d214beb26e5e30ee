"""Poses of a robot's bodies: relative ones as expressions of the joint positions between them, and all of a motion."""

from __future__ import annotations

import casadi as ca
import numpy as np

from regressors.robot.inertia import skew
from regressors.robot.robot import BASE, Joint, Robot
from regressors.samples import Array
from regressors.symbolic.kinematics import relative_pose, sparse

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
