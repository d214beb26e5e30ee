"""The simulated robot: equations of motion from its own parameters, solved for the acceleration.

``tau = M(q) ddq + b(q, dq) + C' f(C dq)``, with M and b from the regressor of [KD96] eq. (3): ``M = d tau / d ddq`` and
``b = tau`` at ``ddq = 0``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from regressors.errors import InputError
from regressors.friction.curves import FrictionCurves, drives_with_friction
from regressors.models.differential import inertial_regressor
from regressors.models.drives import drive_motions, rotor_torque
from regressors.models.energy import body_energy
from regressors.robot.inertia import PARAMETERS_PER_LINK
from regressors.robot.robot import Robot
from regressors.samples import Array
from regressors.symbolic.kinematics import bodies, sparse


@dataclass(frozen=True, eq=False)
class Plant:
    """A robot with numbers for all its parameters."""

    robot: Robot
    theta: Array  # (10 b,) inertial parameters of its bodies
    rotors: Array  # (r,) inertia of the rotor of every moving drive [kg m^2]
    friction: FrictionCurves

    def torque(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        """Joint torques of the motion without friction, shape (n, 1) [Nm or N]."""
        tau = ca.mtimes(inertial_regressor(self.robot, q, dq, ddq), sparse(self.theta))
        drives = [drive for drive in drive_motions(self.robot, q, dq, ddq) if drive.has_rotor]
        for drive, inertia in zip(drives, self.rotors, strict=True):
            tau += drive.row.T * rotor_torque(drive) * float(inertia)
        return ca.densify(tau)

    def friction_torque(self, dq: ca.SX, direction: ca.SX, load: ca.SX) -> ca.SX:
        """Joint torques of friction with given directions, ``C' f(C dq, s)``, shape (n, 1) [Nm or N].

        The load, shape (n, 1), is the torque of the motion without friction; friction may grow with it.
        """
        return ca.densify(self.friction.joint_expression(self.robot, dq, direction, load))

    def carried_torque(self, dq: ca.SX, tau: ca.SX, direction: ca.SX) -> ca.SX:
        """Joint torques minus friction, shape (n, 1) [Nm or N]."""
        return ca.densify(self.friction.carried_expression(self.robot, dq, tau, direction))

    def mass_matrix(self, q: ca.SX) -> ca.SX:
        """``M(q) = d tau / d ddq``, shape (n, n) [kg m^2, or with kg m and kg]."""
        ddq = ca.SX.sym("ddq", self.robot.n)
        return ca.jacobian(self.torque(q, ca.SX.zeros(self.robot.n, 1), ddq), ddq)

    def acceleration(self, q: ca.SX, dq: ca.SX, tau: ca.SX, direction: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Acceleration under given joint torques, ``M^-1 (tau - b - C' f(C dq, s))``."""
        # q, dq, tau (n, 1); direction (k, 1); result (n, 1)
        bias = self.torque(q, dq, ca.SX.zeros(self.robot.n, 1))
        return solved(self.mass_matrix(q), self.carried_torque(dq, tau, direction) - bias)

    def energy(self, q: ca.SX, dq: ca.SX) -> ca.SX:
        """Kinetic and potential energy of bodies and rotors, scalar [J] [KD96] eq. (4), (5)."""
        still, gravity = ca.SX.zeros(self.robot.n, 1), ca.SX(ca.DM(self.robot.gravity))
        rows = ca.horzcat(*(body_energy(body, gravity) for body in bodies(self.robot, q, dq, still)))
        total = ca.mtimes(rows, sparse(self.theta))
        drives = [drive for drive in drive_motions(self.robot, q, dq, still) if drive.has_rotor]
        for drive, inertia in zip(drives, self.rotors, strict=True):
            total += float(inertia) * (drive.ratio * drive.dz) ** 2 / 2
        return total

    def with_errors(self, relative: float, rng: np.random.Generator) -> Plant:
        """A copy with random errors, as the model of a controller.

        Each body's ten parameters are scaled by one factor, so that they stay those of a real body, and so is each
        rotor and each drive's friction; factors are uniform in ``1 +- relative``.
        """
        if relative == 0.0:
            return self
        counts = (len(self.robot.bodies), len(self.rotors), len(self.friction.curves))
        per_body, per_rotor, per_curve = (rng.uniform(1 - relative, 1 + relative, count) for count in counts)
        friction = self.friction.scaled(dict(zip(self.friction.curves, per_curve.tolist(), strict=True)))
        theta = self.theta * np.repeat(per_body, PARAMETERS_PER_LINK)
        return replace(self, theta=theta, rotors=self.rotors * per_rotor, friction=friction)


def solved(M: ca.SX, rest: ca.SX) -> tuple[ca.SX, ca.SX]:
    """``M^-1 rest`` by ``M = L D L'``, and the smallest entry of D."""  # M (n, n); rest (n, 1)
    D, LT, order = ca.ldl(M)
    return ca.densify(ca.ldl_solve(rest, D, LT, order)), ca.mmin(ca.densify(D))


def plant_of(robot: Robot, friction: FrictionCurves | None = None) -> tuple[Plant, tuple[str, ...]]:
    """Plant with a robot's own parameters, and notes on assumptions about unknown ones."""
    unknown = [body.name for body in robot.bodies if body.theta is None]
    if unknown:
        raise InputError(
            f"robot {robot.name!r}: the inertia of link {', '.join(unknown)} is unknown, so its motion cannot be "
            "simulated; state mass, first_moment and inertia in the robot's file"
        )
    theta = np.concatenate([np.asarray(body.theta) for body in robot.bodies])
    notes: list[str] = []
    drives = () if robot.transmission is None else tuple(d for d in robot.transmission.drives if not d.rests)
    inertias = [(drive.name, drive.rotor_inertia) for drive in drives if drive.rotor_inertia is not None]
    nameless = [name for name, value in inertias if not np.isfinite(value)]
    if nameless:
        notes.append(f"rotor inertia of {', '.join(nameless)} is unknown and counts as zero")
    rotors = np.array([value if np.isfinite(value) else 0.0 for _, value in inertias])
    curves = FrictionCurves({**FrictionCurves.of_robot(robot).curves, **(friction.curves if friction else {})})
    curves.check(robot)
    without = [name for name, _ in drives_with_friction(robot) if name not in curves.curves]
    if without:
        notes.append(f"friction of {', '.join(without)} is unknown and counts as zero")
    return Plant(robot, theta, rotors, curves), tuple(notes)
