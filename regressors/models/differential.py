"""The differential model, tau = Y(q, dq, ddq) theta [KD96] eq. (3), (21)."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from regressors.models.columns import Terms
from regressors.models.drives import drive_columns, drive_motions
from regressors.models.model import RegressorModel
from regressors.models.reduction import Reduction
from regressors.models.standard_columns import inertial_columns
from regressors.robot.inertia import PARAMETERS_PER_LINK
from regressors.robot.robot import Robot
from regressors.samples import Array
from regressors.symbolic.body import body_regressor
from regressors.symbolic.kinematics import bodies, sparse


def inertial_regressor(robot: Robot, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
    """Joint torques per standard inertial parameter.

    Body i's wrench about its own origin is ``[F; N] = [F_i; N_i](q, dq, ddq) theta_i``; joint j carries its part
    along the joint's motion vector in that frame, ``Y_ji = l_j' F_i + s_j' N_i`` (zero for the joints after link i).

    Parameters
    ----------
    robot : Robot
    q, dq, ddq : SX, shape (n, 1)

    Returns
    -------
    SX, shape (n, 10 b)
        In Nm (N for a prismatic joint) per unit parameter, of the b bodies of the robot: links, then branches.
    """
    n = robot.n
    blocks = []
    for body in bodies(robot, q, dq, ddq):
        force, moment = body_regressor(body.omega, body.domega, body.a)
        rows = [ca.mtimes(linear.T, force) + ca.mtimes(angular.T, moment) for angular, linear in body.axes]
        blocks.append(ca.vertcat(*rows, ca.SX(n - len(rows), 10)))
    return ca.horzcat(*blocks)


def inertial_torque(robot: Robot, theta: Array, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
    """Joint torques of bodies with given parameters: each body's wrench first, then its parts at the joints.

    ``tau_j = sum_i l_j' F_i theta_i + s_j' N_i theta_i``, the product of `inertial_regressor` and theta in a fraction
    of its operations.

    Parameters
    ----------
    robot : Robot
    theta : ndarray, shape (b, 10)
        Parameters of the robot's bodies, links, then branches.
    q, dq, ddq : SX, shape (n, 1)

    Returns
    -------
    SX, shape (n, 1)
        In Nm (N for a prismatic joint).
    """
    tau = ca.SX(robot.n, 1)
    for body, values in zip(bodies(robot, q, dq, ddq), theta, strict=True):
        force, moment = (ca.mtimes(part, sparse(values)) for part in body_regressor(body.omega, body.domega, body.a))
        rows = [ca.dot(linear, force) + ca.dot(angular, moment) for angular, linear in body.axes]
        tau += ca.vertcat(*rows, ca.SX(robot.n - len(rows), 1))
    return tau


class DifferentialModel(RegressorModel):
    """Joint torques, linear in inertial, rotor and friction parameters [KD96] eq. (1)-(3).

    Parameters
    ----------
    robot : Robot
    terms : Terms, optional
        Optional columns beside the links' parameters.
    sign_width : float
        Velocity over which the sign of Coulomb friction changes [rad/s]; zero for the exact sign. A positive width
        makes the model differentiable for an optimiser.
    """

    rows_are_joint_torques = True
    jax_form = "regressors.jax_models.jax_differential:DifferentialPart"
    reduction: Reduction

    def __init__(self, robot: Robot, terms: Terms | None = None, *, sign_width: float = 0.0) -> None:
        self.robot = robot
        self.terms = terms if terms is not None else Terms()
        self.sign_width = sign_width
        symbols = [ca.SX.sym(name, robot.n) for name in ("q", "dq", "ddq")]
        extra, _ = drive_columns(drive_motions(robot, *symbols), self.terms)
        self.reduction = Reduction.of(robot, (*inertial_columns(robot), *extra), reflected=self.terms.reflected)
        self.columns = self.reduction.columns
        units = ("Nm" if joint.kind == "revolute" else "N" for joint in robot.joints)
        self.row_labels = tuple(zip(robot.joint_names, units, strict=True))

    @property
    def options(self) -> dict[str, Any]:
        """Terms and sign width."""
        return {"terms": self.terms, "sign_width": self.sign_width}

    def torque(self, parameters: Array, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        """``rows @ parameters`` by each body's wrench, shape (n, 1) [Nm or N].

        Parameters
        ----------
        parameters : ndarray, shape (p,)
        q, dq, ddq : SX, shape (n, 1)
        """
        standard = self.reduction.matrix @ parameters
        inertial, of_drives = np.split(standard, [PARAMETERS_PER_LINK * len(self.robot.bodies)])
        tau = inertial_torque(self.robot, inertial.reshape(-1, PARAMETERS_PER_LINK), q, dq, ddq)
        _, drives = drive_columns(drive_motions(self.robot, q, dq, ddq), self.terms, self.sign_width)
        return tau + ca.mtimes(drives, sparse(of_drives)) if of_drives.size else tau

    def rows(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        """Joint torques per parameter, shape (n, p) [Nm per unit parameter]."""
        inertial = inertial_regressor(self.robot, q, dq, ddq)
        _, drives = drive_columns(drive_motions(self.robot, q, dq, ddq), self.terms, self.sign_width)
        return self.reduction.apply(ca.horzcat(inertial, drives))
