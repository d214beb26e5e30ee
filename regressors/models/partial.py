"""Partial motions: only some joints, or some drives, move; the others are held.

The motion is ``q = N s + q0`` with fewer coordinates s than joints; a held joint rests, while a held drive keeps its
own coordinate, so that joints behind a coupling may move (the IRp-6's motor 2 alone turns joint 3 back).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from regressors.errors import InputError
from regressors.quantities import place_of
from regressors.robot.robot import Robot
from regressors.robot.symbolic.kinematics import sparse
from regressors.robot.symbolic.loops import Loops, dense, loops_of
from regressors.robot.symbolic.vectorised import VectorisedFunction
from regressors.samples import Array, Samples


@dataclass(frozen=True, eq=False)
class PartialMotion:
    """Affine map from the moving coordinates to the joints, ``q = N s + q0``."""

    straight: ClassVar[bool] = True  # whether N is the same everywhere
    labels: tuple[str, ...]  # names of the moving coordinates, such as ``q2`` or ``z2``
    units: tuple[str, ...]  # ``rad`` or ``m``
    matrix: Array  # (n, k) N
    offset: Array  # (n,) q0 [rad or m]

    @property
    def complete(self) -> bool:
        """True if every joint moves on its own."""
        return np.array_equal(self.matrix, np.eye(len(self.offset)))

    def directions(self, q: ca.SX) -> ca.SX:
        """``dq / ds`` in a configuration, shape (n, k)."""  # q (n, 1)
        return sparse(self.matrix)

    @property
    def chosen(self) -> NDArray[np.bool_]:
        """Which joints the coordinates move, but for those that only follow, shape (n,)."""
        return np.asarray(self.matrix.any(axis=1))

    @property
    def following(self) -> int:
        """Number of joints that follow others since loops close."""
        return 0

    def poses(self, s: Array) -> Array:
        """Joint positions, shape (..., n), from those of the moving coordinates, shape (..., k)."""
        return np.asarray(s @ self.matrix.T + self.offset)

    def functions(self, matrix: Array, offset: Array) -> tuple[Array, Array]:
        """``matrix q + offset`` as a function of the moving coordinates."""  # matrix (m, n)
        return matrix @ self.matrix, offset + matrix @ self.offset

    def coordinates(self, q: Array) -> Array:
        """Moving coordinates, shape (..., k), of joint positions, shape (..., n)."""
        return np.asarray((q - self.offset) @ np.linalg.pinv(self.matrix).T)

    def torques(self, q: Array, measured: Array) -> Array:
        """``N' tau`` of the torques of all joints, shape (N, k)."""  # q, measured (N, n)
        return np.asarray(measured @ self.matrix)

    def states(self, states: Samples) -> Samples:
        """Projection of states onto those that this motion can reach."""
        project = self.matrix @ np.linalg.pinv(self.matrix)
        project[np.abs(project) < 1e-12] = 0.0  # what is held must be held exactly
        q = (states.q - self.offset) @ project.T + self.offset
        return Samples(states.time, q, states.dq @ project.T, states.ddq @ project.T, states.dddq @ project.T)


@dataclass(frozen=True, eq=False)
class ClosedMotion(PartialMotion):
    """Motion of the independent joints of closed loops, ``q = q(s)``; N and q0 are those of one configuration."""

    straight: ClassVar[bool] = False
    loops: Loops

    def __getstate__(self) -> dict[str, object]:
        """Return the state without compiled functions, which are rebuilt when needed."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    def directions(self, q: ca.SX) -> ca.SX:
        """``N(q)``, shape (n, k); with drives at dependent joints too, ``N (N_d' N_d)^(-1/2)`` of these drives' rows.

        White noise of all torques is then white in all equations.
        """  # q (n, 1)
        N = self.loops.directions(q)
        if not self.loops.redundant:
            return N
        driven = N[list(self.loops.driven), :]
        return ca.solve(ca.chol(ca.mtimes(driven.T, driven)).T, N.T).T

    @property
    def independent(self) -> PartialMotion:
        """The motion of the independent joints on their own, each its own coordinate."""
        k = len(self.labels)
        return PartialMotion(self.labels, self.units, np.eye(k), np.zeros(k))

    @property
    def chosen(self) -> NDArray[np.bool_]:
        """The independent joints."""
        return np.isin(np.arange(self.loops.robot.n), self.loops.independent)

    @property
    def following(self) -> int:
        """Number of the dependent joints."""
        return len(self.loops.dependent)

    def poses(self, s: Array) -> Array:
        """Joint positions in which the loops are closed."""
        q, _ = self.loops.solved(np.atleast_2d(s))
        return q.reshape(*np.shape(s)[:-1], q.shape[1])

    def functions(self, matrix: Array, offset: Array) -> tuple[Array, Array]:
        """The same of functions that do not depend on dependent joints."""
        return matrix[:, self.loops.independent], offset

    def coordinates(self, q: Array) -> Array:
        """Positions of the independent joints."""
        return np.asarray(q[..., self.loops.independent])

    @cached_property
    def _directions(self) -> VectorisedFunction:
        q = ca.SX.sym("q", self.loops.robot.n)
        return VectorisedFunction([q], self.directions(q))

    def torques(self, q: Array, measured: Array) -> Array:
        """``N(q)' tau``, shape (N, k), of the torques of all joints."""  # q, measured (N, n)
        return np.asarray(np.einsum("tjk,tj->tk", dense(self._directions, q), measured))

    def states(self, states: Samples) -> Samples:
        """States with the dependent joints where the independent ones put them."""
        q, left = self.loops.closed(states.q)
        self.loops.check(states.time, q, left, self.loops.robot.name)
        return self.loops.rates(Samples(states.time, q, states.dq, states.ddq, states.dddq))


def of_loops(robot: Robot) -> ClosedMotion:
    """Motion of a robot with closed loops."""
    loops = loops_of(robot)
    units = tuple(robot.joints[k].unit for k in loops.independent)
    q = ca.SX(ca.DM(loops.reference))
    motion = ClosedMotion(loops.names, units, np.eye(robot.n)[:, loops.independent], loops.reference, loops)
    return replace(motion, matrix=np.array(ca.DM(ca.densify(ca.evalf(motion.directions(q))))))


def of_joints(robot: Robot, moving: Sequence[int]) -> PartialMotion:
    """Motion of some joints, the others at zero or at the nearest position limit."""
    keep = sorted(set(moving))
    if not keep:
        raise InputError(f"robot {robot.name!r}: no joint moves; choose from {', '.join(robot.joint_names)}")
    rest = np.clip(np.zeros(robot.n), robot.limits.lower, robot.limits.upper)
    rest[keep] = 0.0
    units = tuple(robot.joints[k].unit for k in keep)
    return PartialMotion(tuple(robot.joint_names[k] for k in keep), units, np.eye(robot.n)[:, keep], rest)


def drive_names(robot: Robot) -> tuple[str, ...]:
    """Names of the drives that can move a robot's joints on their own."""
    if robot.transmission is None:
        return robot.joint_names
    return tuple(robot.transmission.drives[k].name for k in _own_drives(robot))


def _own_drives(robot: Robot) -> list[int]:
    """Drives of the moving joints: those of the same numbers; further ones may move along with them."""
    drives = robot.transmission.drives if robot.transmission is not None else ()
    numbers = (number - 1 for number in robot.link_numbers)
    return [k for k in numbers if k < len(drives) and not drives[k].rests]


def of_drives(robot: Robot, moving: Sequence[str]) -> PartialMotion:
    """Motion of some drives, the others holding their coordinate z at its value for q = 0."""
    if robot.transmission is None:
        return of_joints(robot, [robot.joint_index(name) for name in moving])
    names = drive_names(robot)
    C = robot.transmission.coupling[_own_drives(robot)]
    if C.shape[0] != robot.n or np.linalg.matrix_rank(C) < robot.n:
        raise InputError(f"robot {robot.name!r}: its {C.shape[0]} drives do not fix its {robot.n} joints")
    keep = sorted({place_of("drive", name, names) for name in moving})
    if not keep:
        raise InputError(f"robot {robot.name!r}: no drive moves; choose from {', '.join(names)}")
    N = np.asarray(np.linalg.inv(C)[:, keep] + 0.0, dtype=float)
    rest = np.clip(np.zeros(robot.n), robot.limits.lower, robot.limits.upper)
    prismatic = [joint.kind == "prismatic" for joint in robot.joints]
    units = tuple("m" if np.any(column) else "rad" for column in N[prismatic].T)
    return PartialMotion(tuple(names[k] for k in keep), units, N, rest)
