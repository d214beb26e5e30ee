"""Direction of a drive's friction with a memory: at rest it holds any torque until the drive breaks loose.

Dahl's direction follows the path, ``ds/dz = (1 - s sign(dz)) / d`` [Dahl 1968], and friction is ``f(dz, s + T ds/dt)``,
the sum kept within -1 and 1. At rest that is a spring of stiffness Fs / d which yields at Fs, damped by T as in
[Canudas de Wit et al. 1995]: without damping it oscillates at every stop, and creeps meanwhile. In steady motion it is
the curve, f(dz, sign(dz)).
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from excite.simulation.plant import Plant
from regressors.friction.curves import drives_with_friction
from regressors.robot.robot import Robot
from regressors.samples import Array
from regressors.symbolic.kinematics import sparse

_DAMPING = 0.5  # of critical damping; more would need smaller steps


@dataclass(frozen=True)
class Sticking:
    """Presliding friction: it changes direction over a distance, and holds at rest."""

    distance: float  # d > 0 [rad or m]
    lead: tuple[float, ...]  # T of each drive with friction [s]


def friction_rows(robot: Robot) -> Array:
    """Rows of C of the drives with friction, shape (k, n)."""
    return np.array([row for _, row in drives_with_friction(robot)]).reshape(-1, robot.n)


def followed(robot: Robot, way: ca.SX, start: ca.SX, distance: float) -> ca.SX:
    """Dahl's direction after a displacement without reversal, ``s = u + (s0 - u) exp(-|dz| / d)``, ``u = sign(dz)``."""
    # way (n, 1); start (k, 1)
    dz = ca.mtimes(sparse(friction_rows(robot)), way)
    ahead = ca.sign(dz)
    return ca.densify(ahead + (start - ahead) * ca.exp(-ca.fabs(dz) / distance))


def sticking_direction(robot: Robot, way: ca.SX, dq: ca.SX, start: ca.SX, sticking: Sticking) -> ca.SX:
    """``s + T ds/dt`` of presliding friction, between -1 and 1."""  # way, dq (n, 1); start (k, 1)
    s = followed(robot, way, start, sticking.distance)
    dz = ca.mtimes(sparse(friction_rows(robot)), dq)
    rate = (1 - s * ca.sign(dz)) * dz / sticking.distance
    return ca.densify(ca.fmin(ca.fmax(s + ca.DM(sticking.lead) * rate, -1), 1))


def steepest_direction(robot: Robot, way: ca.SX, gain: ca.SX, dq: ca.SX, distance: ca.SX, lead: ca.SX) -> ca.SX:
    """``sign(dz) + 2 (z + T v) / d``, as steep as presliding friction at a reversal of the motion."""
    # way, gain (n, 1); dq (n, 1); lead (k, 1)
    rows = sparse(friction_rows(robot))
    moved = ca.mtimes(rows, way) + lead * ca.mtimes(rows, gain)
    return ca.densify(ca.sign(ca.mtimes(rows, dq)) + 2 * moved / distance)


def leads(plant: Plant, pose: Array) -> Array:
    """T of each drive per square root of d, ``T = 2 zeta sqrt(d m / F)``, shape (k,) [s / sqrt(rad or m)].

    F is half the range of torques between break-away in both directions, and ``1 / m = c' M^-1 c`` of the drive's row
    c.
    """  # pose (n,)
    q = ca.SX.sym("q", plant.robot.n)
    M = np.array(ca.Function("mass", [q], [plant.mass_matrix(q)])(pose))
    damping = []
    for name, row in drives_with_friction(plant.robot):
        ahead, behind = _resting(plant, name)
        half, mobility = (ahead - behind) / 2, float(row @ np.linalg.pinv(M) @ row)
        damping.append(2 * _DAMPING / np.sqrt(half * mobility) if half > 0 and mobility > 0 else 0.0)
    return np.array(damping, dtype=float)


def unloaded(plant: Plant, dq: Array) -> Array:
    """Initial directions: sign of the velocity; at rest, the one at which friction is zero, shape (k,)."""  # dq (n,)
    directions = []
    for name, row in drives_with_friction(plant.robot):
        dz, (ahead, behind) = float(row @ dq), _resting(plant, name)
        balanced = -(ahead + behind) / (ahead - behind) if ahead > behind else 0.0
        directions.append(float(np.sign(dz)) if dz else float(np.clip(balanced, -1.0, 1.0)))
    return np.array(directions)


def _resting(plant: Plant, name: str) -> tuple[float, float]:
    """Break-away torques of a drive, forward and backward."""
    curve = plant.friction.curve(name)
    return (0.0, 0.0) if curve is None else (float(curve.torque(0.0, 1.0)), float(curve.torque(0.0, -1.0)))
