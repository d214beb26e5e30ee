"""Relative poses of a robot's bodies, as expressions of only those joint positions that lie between them."""

from __future__ import annotations

import casadi as ca
import numpy as np

from regressors.robot.robot import BASE, Robot
from regressors.symbolic.kinematics import relative_pose, sparse

Pose = tuple[ca.SX, ca.SX]


class Frames:
    """Tree of the frames of a robot's links and branches.

    Parameters
    ----------
    robot : Robot
    q : SX, shape (n, 1)
        Joint positions [rad or m].
    """

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
