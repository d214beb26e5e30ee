"""Control laws, torque limits of the drives, and the controlled robot as one system of differential equations."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import casadi as ca
import numpy as np

from excite.simulation.direction import Sticking, followed, friction_rows, steepest_direction, sticking_direction
from excite.simulation.plant import Plant
from excite.simulation.ramps import RampedDrive
from regressors.friction.curves import smooth_direction
from regressors.robot.robot import Robot
from regressors.samples import Array
from regressors.symbolic.kinematics import sparse


@dataclass(frozen=True)
class Wanted:
    """The reference at one instant; each SX of shape (n, 1)."""

    q: ca.SX  # [rad, rad/s, rad/s^2, or with m]
    dq: ca.SX
    ddq: ca.SX


class Controller(ABC):
    """A static control law, without internal states."""

    @abstractmethod
    def torque(self, q: ca.SX, dq: ca.SX, wanted: Wanted, width: ca.SX | float) -> ca.SX:
        """Commanded joint torques, shape (n, 1) [Nm or N].

        The width is the velocity over which the compensation of friction changes sign.
        """


@dataclass(frozen=True, eq=False)
class ComputedTorque(Controller):
    """``tau = M (ddq_d + 2 w (dq_d - dq) + w^2 (q_d - q)) + b(q, dq) + C' f(C dq_d)``, with the model's M, b, f.

    Friction is compensated at the desired velocity, whose sign does not chatter.
    """

    model: Plant  # the controller's model
    frequency: float  # w [rad/s]

    def torque(self, q: ca.SX, dq: ca.SX, wanted: Wanted, width: ca.SX | float) -> ca.SX:
        """The equation of the class."""
        w = self.frequency
        command = wanted.ddq + 2 * w * (wanted.dq - dq) + w**2 * (wanted.q - q)
        direction = smooth_direction(self.model.robot, wanted.dq, width)
        tau = self.model.torque(q, dq, command)
        return tau + self.model.friction_torque(wanted.dq, direction, tau)


@dataclass(frozen=True, eq=False)
class ProportionalDerivative(Controller):
    """``tau = g(q) + I (w^2 (q_d - q) + 2 w (dq_d - dq))``, with I the joints' inertia in the middle of the motion."""

    model: Plant  # the controller's model
    frequency: float  # w [rad/s]
    inertia: Array  # (n,) diagonal of the model's mass matrix [kg m^2, or kg]

    def torque(self, q: ca.SX, dq: ca.SX, wanted: Wanted, width: ca.SX | float) -> ca.SX:
        """The equation of the class."""
        w, still = self.frequency, ca.SX.zeros(self.model.robot.n, 1)
        return self.model.torque(q, still, still) + ca.DM(self.inertia) * (
            w**2 * (wanted.q - q) + 2 * w * (wanted.dq - dq)
        )


def controller_of(name: str, model: Plant, bandwidth: float, middle: Array) -> Controller:
    """Controller by its name in `excite.simulation.settings.CONTROLLERS`."""  # middle (n,)
    frequency = 2 * np.pi * bandwidth
    if name == "computed-torque":
        return ComputedTorque(model, frequency)
    q = ca.SX.sym("q", model.robot.n)
    M = ca.Function("mass", [q], [model.mass_matrix(q)])(middle)
    return ProportionalDerivative(model, frequency, np.diag(np.array(M)).copy())


@dataclass(frozen=True, eq=False)
class TorqueLimits:
    """Largest torques of joints and of drives."""

    robot: Robot

    @property
    def drives(self) -> tuple[tuple[str, ...], Array, Array] | None:
        """Names, rows of C and limits of the joints' own drives; None without limits or where q is not determined."""
        transmission = self.robot.transmission
        if transmission is None:
            return None
        own = [k - 1 for k in self.robot.link_numbers if k <= len(transmission.drives)]
        C, bounds = transmission.coupling[own], transmission.limits.torque[own]
        if C.shape[0] != self.robot.n or np.linalg.matrix_rank(C) < self.robot.n or not np.any(np.isfinite(bounds)):
            return None
        return tuple(transmission.drives[k].name for k in own), C, bounds

    def saturated(self, tau: ca.SX) -> ca.SX:
        """Joint torques after saturation of the commanded ones: drives first, ``tau = C' tau_z``, then joints."""
        if self.drives is not None:
            _, C, bounds = self.drives
            tau_z = ca.mtimes(sparse(np.linalg.inv(C).T), tau)
            tau = ca.mtimes(sparse(C.T), _clipped(tau_z, bounds))
        return ca.densify(_clipped(tau, self.robot.limits.torque))

    def of(self, tau: Array) -> tuple[tuple[str, ...], Array, Array]:
        """Names, limited torques, shape (N, k), and their limits, shape (k,), from joint torques, shape (N, n)."""
        bounded = np.isfinite(self.robot.limits.torque)
        names = tuple(f"joint {name}" for name, ok in zip(self.robot.joint_names, bounded, strict=True) if ok)
        torques, bounds = tau[:, bounded], self.robot.limits.torque[bounded]
        if self.drives is None:
            return names, torques, bounds
        drives, C, limits = self.drives
        limited = np.isfinite(limits)
        at_drives = (tau @ np.linalg.inv(C))[:, limited]
        labels = tuple(f"drive {name}" for name, ok in zip(drives, limited, strict=True) if ok)
        return (*labels, *names), np.hstack([at_drives, torques]), np.concatenate([limits[limited], bounds])


def _clipped(tau: ca.SX, bounds: Array) -> ca.SX:
    parts = [
        ca.fmin(ca.fmax(tau[k], -float(bound)), float(bound)) if np.isfinite(bound) else tau[k]
        for k, bound in enumerate(bounds)
    ]
    return ca.vertcat(*parts)


@dataclass(frozen=True, eq=False)
class ControlledRobot:
    """A robot, its controller and its torque limits."""

    plant: Plant
    controller: Controller
    limits: TorqueLimits | None  # None for unlimited drives
    ramped: RampedDrive | None = None  # drive with prescribed torque ramps while the others are controlled
    # True if torques from outside act on the joints besides; they follow the reference in the inputs
    struck: bool = False

    def instant(self, width: float, sticking: Sticking | None = None) -> tuple[list[ca.SX], list[ca.SX]]:
        """Symbols (state, reference, memory) and expressions (rate of the state, effort, command, ddq, least pivot).

        The state is (q, dq, work, loss), the reference (q, dq, ddq), torques from outside where there are any, and the
        torque of a ramp. The memory is a position
        of the joints, the directions of friction at that position, and 1 if the loop of the ramped drive is open.
        """
        robot = self.plant.robot
        n = robot.n
        q, dq, energies = ca.SX.sym("q", n), ca.SX.sym("dq", n), ca.SX.sym("energies", 2)
        wanted = Wanted(*(ca.SX.sym(name, n) for name in ("q_d", "dq_d", "ddq_d")))
        torque, is_open, before = ca.SX.sym("torque"), ca.SX.sym("open"), ca.SX.sym("before", n)
        s = ca.SX.sym("s", friction_rows(robot).shape[0])
        if sticking is None:
            direction = smooth_direction(robot, dq, width)
        else:
            direction = sticking_direction(robot, q - before, dq, s, sticking)
        command = self.controller.torque(q, dq, wanted, width)
        if self.ramped is not None:
            command = self.ramped.command(q, command, torque, is_open)
        effort = command if self.limits is None else self.limits.saturated(command)
        outside = ca.SX.sym("outside", n if self.struck else 0)
        acting = effort + outside if self.struck else effort
        ddq, least = self.plant.acceleration(q, dq, acting, direction)
        power = ca.dot(acting, dq)
        lost = ca.dot(acting - self.plant.carried_torque(dq, acting, direction), dq)
        rate = ca.vertcat(dq, ddq, power, lost)
        symbols = [
            ca.vertcat(q, dq, energies),
            ca.vertcat(wanted.q, wanted.dq, wanted.ddq, outside, torque),
            ca.vertcat(before, s, is_open),
        ]
        return symbols, ca.cse([rate, effort, command, ddq, least])

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
        wanted = Wanted(*(ca.SX.sym(name, n) for name in ("q_d", "dq_d", "ddq_d")))
        if leads is None:
            direction = smooth_direction(robot, dq, size)
        else:
            lead = ca.DM(leads) * ca.sqrt(size)
            direction = steepest_direction(robot, q - before[0], dq - before[1], dq, size, lead)
        tau = self.controller.torque(q, dq, wanted, size)
        rate = ca.vertcat(dq, self.plant.acceleration(q, dq, tau, direction)[0])
        state = ca.vertcat(q, dq)
        jacobian = ca.substitute(ca.jacobian(rate, state), ca.vertcat(*before), state)
        reference = ca.vertcat(wanted.q, wanted.dq, wanted.ddq)
        return ca.Function("jacobian", [state, reference, size], [ca.densify(jacobian)])
