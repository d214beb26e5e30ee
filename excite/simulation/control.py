"""Control laws, torque limits of the drives, and the controlled robot as one system of differential equations.

Direction of a drive's friction with a memory: at rest it holds any torque until the drive breaks loose.

Dahl's direction follows the path, ``ds/dz = (1 - s sign(dz)) / d`` [Dahl 1968], and friction is ``f(dz, s + T ds/dt)``,
the sum kept within -1 and 1. At rest that is a spring of stiffness Fs / d which yields at Fs, damped by T as in
[Canudas de Wit et al. 1995]: without damping it oscillates at every stop, and creeps meanwhile. In steady motion it is
the curve, f(dz, sign(dz)).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from excite.simulation.plant import Plant
from excite.tasks.reference import GivenTorque
from regressors.errors import InputError, check_names
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.load_and_temperature import drives_with_friction, friction_rows, smooth_direction
from regressors.robot.robot import Robot
from regressors.robot.symbolic.kinematics import sparse
from regressors.samples import Array

# commanded joint torques (n, 1) [Nm or N] of q, dq, the reference (q, dq, ddq), and the velocity over which the
# compensation of friction changes sign
Controller = Callable[[ca.SX, ca.SX, Sequence[ca.SX], ca.SX | float], ca.SX]


def controller_of(name: str, model: Plant, bandwidth: float, middle: Array) -> Controller:
    """Static control law by its name in `excite.simulation.settings.CONTROLLERS`, with the controller's model.

    ``computed-torque``: ``tau = M (ddq_d + 2 w (dq_d - dq) + w^2 (q_d - q)) + b(q, dq) + C' f(C dq_d)``; friction is
    compensated at the desired velocity, whose sign does not chatter. ``pd``:
    ``tau = g(q) + I (w^2 (q_d - q) + 2 w (dq_d - dq))``, with I the joints' inertia in the middle of the motion.
    """  # middle (n,)
    w = 2 * np.pi * bandwidth  # [rad/s]

    def computed_torque(q: ca.SX, dq: ca.SX, wanted: Sequence[ca.SX], width: ca.SX | float) -> ca.SX:
        q_d, dq_d, ddq_d = wanted
        command = ddq_d + 2 * w * (dq_d - dq) + w**2 * (q_d - q)
        direction = smooth_direction(model.robot, dq_d, width)
        tau = model.torque(q, dq, command)
        return tau + ca.densify(model.friction.joint_expression(model.robot, dq_d, direction, tau))

    if name == "computed-torque":
        return computed_torque
    q = ca.SX.sym("q", model.robot.n)
    M = ca.Function("mass", [q], [model.mass_matrix(q)])(middle)
    inertia = ca.DM(np.diag(np.array(M)).copy())  # (n, 1) [kg m^2, or kg]

    def proportional_derivative(q: ca.SX, dq: ca.SX, wanted: Sequence[ca.SX], width: ca.SX | float) -> ca.SX:
        (q_d, dq_d, _), still = wanted, ca.SX.zeros(model.robot.n, 1)
        return model.torque(q, still, still) + inertia * (w**2 * (q_d - q) + 2 * w * (dq_d - dq))

    return proportional_derivative


def own_drives(robot: Robot) -> list[int]:
    """Rows of C of the joints' own drives; none where these do not determine the joints."""
    C = np.zeros((0, robot.n)) if robot.transmission is None else robot.transmission.coupling
    own = [k - 1 for k in robot.link_numbers if k <= len(C)]
    return own if len(own) == robot.n == np.linalg.matrix_rank(C[own]) else []


def _limited_drives(robot: Robot) -> tuple[tuple[str, ...], Array, Array] | None:
    """Names, rows of C and limits of the joints' own drives; None without limits or where q is not determined."""
    own, transmission = own_drives(robot), robot.transmission
    if transmission is None or not np.any(np.isfinite(transmission.limits.torque[own])):
        return None
    return tuple(transmission.drives[k].name for k in own), transmission.coupling[own], transmission.limits.torque[own]


def saturated(robot: Robot, tau: ca.SX) -> ca.SX:
    """Joint torques after saturation of the commanded ones: drives first, ``tau = C' tau_z``, then joints."""
    if (drives := _limited_drives(robot)) is not None:
        _, C, bounds = drives
        tau_z = ca.mtimes(sparse(np.linalg.inv(C).T), tau)
        tau = ca.mtimes(sparse(C.T), _clipped(tau_z, bounds))
    return ca.densify(_clipped(tau, robot.limits.torque))


def limited_torques(robot: Robot, tau: Array) -> tuple[tuple[str, ...], Array, Array]:
    """Names, limited torques, shape (N, k), and their limits, shape (k,), from joint torques, shape (N, n)."""
    labels, torques, bounds = [f"joint {name}" for name in robot.joint_names], tau, robot.limits.torque
    if (drives := _limited_drives(robot)) is not None:
        names, C, limits = drives
        labels = [*(f"drive {name}" for name in names), *labels]
        torques, bounds = np.hstack([tau @ np.linalg.inv(C), tau]), np.concatenate([limits, bounds])
    limited = np.isfinite(bounds)
    return tuple(np.array(labels)[limited].tolist()), torques[:, limited], bounds[limited]


def _clipped(tau: ca.SX, bounds: Array) -> ca.SX:
    parts = [ca.fmin(ca.fmax(tau[k], -x), x) if np.isfinite(x) else tau[k] for k, x in enumerate(bounds.tolist())]
    return ca.vertcat(*parts)


@dataclass(frozen=True, eq=False)
class ControlledRobot:
    """A robot and its controller."""

    plant: Plant
    controller: Controller
    limited: bool = False  # whether torques saturate at the limits of joints and drives
    ramped: RampedDrive | None = None  # drive with prescribed torque ramps while the others are controlled
    # True if torques from outside act on the joints besides; they follow the reference in the inputs
    struck: bool = False

    def instant(self, width: float, sticking: Sticking | None = None) -> tuple[list[ca.SX], list[ca.SX]]:
        """Symbols (state, reference, memory) and expressions (rate of the state, effort, command, ddq, least pivot).

        The state is (q, dq, work, loss), the reference (q, dq, ddq), torques from outside where there are any, and the
        torque of a ramp. The memory is a position, friction's directions there, and 1 where the ramped loop is open.
        """
        robot = self.plant.robot
        n = robot.n
        q, dq, energies = ca.SX.sym("q", n), ca.SX.sym("dq", n), ca.SX.sym("energies", 2)
        wanted = [ca.SX.sym(name, n) for name in ("q_d", "dq_d", "ddq_d")]
        torque, is_open, before = ca.SX.sym("torque"), ca.SX.sym("open"), ca.SX.sym("before", n)
        s = ca.SX.sym("s", friction_rows(robot).shape[0])
        if sticking is None:
            direction = smooth_direction(robot, dq, width)
        else:
            direction = sticking_direction(robot, q - before, dq, s, sticking)
        command = self.controller(q, dq, wanted, width)
        if self.ramped is not None:
            command = self.ramped.command(q, command, torque, is_open)
        effort = saturated(robot, command) if self.limited else command
        outside = ca.SX.sym("outside", n if self.struck else 0)
        acting = effort + outside if self.struck else effort
        ddq, least = self.plant.acceleration(q, dq, acting, direction)
        power = ca.dot(acting, dq)
        lost = ca.dot(acting - self.plant.carried_torque(dq, acting, direction), dq)
        rate = ca.vertcat(dq, ddq, power, lost)
        symbols = [ca.vertcat(q, dq, energies), ca.vertcat(*wanted, outside, torque), ca.vertcat(before, s, is_open)]
        return symbols, ca.cse([rate, effort, command, ddq, least])

    def without_friction(self) -> ControlledRobot:
        """The robot with the same controller, but no friction."""
        return replace(self, plant=replace(self.plant, friction=FrictionCurves({})))

    def steep_friction(self, width: float) -> tuple[ca.Function, ca.Function]:
        """Mass matrix of q; and of dq the friction at the joints, which no load changes, and its slope."""
        n = self.plant.robot.n
        q, dq = ca.SX.sym("q", n), ca.SX.sym("dq", n)
        f = -self.plant.carried_torque(dq, ca.SX.zeros(n, 1), smooth_direction(self.plant.robot, dq, width))
        slope = ca.densify(ca.jacobian(f, dq))
        return ca.Function("mass", [q], [self.plant.mass_matrix(q)]), ca.Function("f", [dq], ca.cse([f, slope]))

    def turned(self, sticking: Sticking | None) -> ca.Function:
        """Directions of friction after a displacement of the joints; unchanged without presliding."""
        robot = self.plant.robot
        way, s = ca.SX.sym("way", robot.n), ca.SX.sym("s", friction_rows(robot).shape[0])
        after = s if sticking is None else followed(robot, way, s, sticking.distance)
        return ca.Function("turned", [way, s], [after])

    def fastest_rate(self, leads: Array | None = None) -> ca.Function:
        """Jacobian of the motion's rate with respect to (q, dq) as a function of (q, dq, reference, size).

        The size is the velocity over which friction changes sign, or the presliding distance if its lead times per
        square root of distance are given. Torques do not saturate.
        """
        robot = self.plant.robot
        n, size = robot.n, ca.SX.sym("size")
        q, dq = ca.SX.sym("q", n), ca.SX.sym("dq", n)
        before = ca.SX.sym("q_before", n), ca.SX.sym("dq_before", n)
        wanted = [ca.SX.sym(name, n) for name in ("q_d", "dq_d", "ddq_d")]
        if leads is None:
            direction = smooth_direction(robot, dq, size)
        else:
            lead = ca.DM(leads) * ca.sqrt(size)
            direction = steepest_direction(robot, q - before[0], dq - before[1], dq, size, lead)
        tau = self.controller(q, dq, wanted, size)
        rate = ca.vertcat(dq, self.plant.acceleration(q, dq, tau, direction)[0])
        state = ca.vertcat(q, dq)
        jacobian = ca.substitute(ca.jacobian(rate, state), ca.vertcat(*before), state)
        reference = ca.vertcat(*wanted)
        return ca.Function("jacobian", [state, reference, size], [ca.densify(jacobian)])


@dataclass(frozen=True, eq=False)
class RampedDrive:
    """A drive with prescribed torque until it has moved; then the position controller takes over."""

    model: Plant  # the controller's model, whose gravity is compensated
    drive: str
    catch: float  # distance from the ramp's start at which the controller takes over until the next ramp [rad or m]

    def __post_init__(self) -> None:
        C = self._coupling
        if C.shape[0] != C.shape[1] or np.linalg.matrix_rank(C) < C.shape[1]:
            raise InputError(
                f"robot {self.model.robot.name!r}: its joints are not determined by its drives, so torque ramps of "
                f"{self.drive} cannot be separated from the torques of other drives"
            )

    @property
    def _coupling(self) -> Array:
        """Rows of C of the moving drives, this one first."""
        rows = dict(drives_with_friction(self.model.robot))
        check_names("drive" if self.model.robot.transmission else "joint", [self.drive], rows)
        return np.array([rows[self.drive], *(row for name, row in rows.items() if name != self.drive)])

    def command(self, q: ca.SX, command: ca.SX, torque: ca.SX, is_open: ca.SX) -> ca.SX:
        """Joint torques, with gravity plus the ramp at this drive if its loop is open, else the controller's."""
        # q, command (n, 1)
        C, still = self._coupling, ca.SX.zeros(self.model.robot.n, 1)
        to_drive = sparse(np.linalg.inv(C)[:, :1].T)  # tau_z = C^-T tau
        wanted = ca.mtimes(to_drive, self.model.torque(q, still, still)) + torque
        return command + sparse(C[:1].T) * (is_open * (wanted - ca.mtimes(to_drive, command)))

    def latch(self) -> ca.Function:
        """Map (q, memory, number of the ramp) to memory: that number, the drive's z at its start, 1 once caught."""
        q, memory, number = ca.SX.sym("q", self.model.robot.n), ca.SX.sym("memory", 3), ca.SX.sym("number")
        z = ca.mtimes(sparse(self._coupling[:1]), q)
        begins = ca.ne(number, memory[0])
        start = ca.if_else(begins, z, memory[1])
        caught = ca.fmax(ca.if_else(begins, 0, memory[2]), ca.fabs(z - start) > self.catch)
        return ca.Function("latch", [q, memory, number], [ca.densify(ca.vertcat(number, start, caught))])


def broken_loose(ramps: GivenTorque, time: Array, z: Array, catch: float) -> list[bool]:
    """Whether each ramp moved its drive by the distance ``catch``."""  # time, z (N,)
    number = ramps.at(time)[:, 1]
    ways = (z[number == k] for k in range(1, ramps.count + 1))
    return [bool(way.size and np.abs(way - way[0]).max() > catch) for way in ways]


_DAMPING = 0.5  # of critical damping; more would need smaller steps


@dataclass(frozen=True)
class Sticking:
    """Presliding friction: it changes direction over a distance, and holds at rest."""

    distance: float  # d > 0 [rad or m]
    lead: tuple[float, ...]  # T of each drive with friction [s]


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

    F is half the range of torques between break-away in both directions, and ``1 / m = c' M^-1 c``, c its row.
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
