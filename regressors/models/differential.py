"""The differential model, tau = Y(q, dq, ddq) theta [KD96] eq. (3), (21), and the torques that it says drives carry.

A drive carries the torque that moves the robot without friction, at the drive coordinate, ``tau_z = C'^-1 tau_q``,
with its own rotor, as for the curves of `regressors.robot.friction.load_and_temperature`.

Torsion springs in the joints: ``tau = Y(q, dq, ddq) theta + diag(q - q_rest) k`` [Siciliano et al. 2009, chapter 9].
Examples are balancing springs at the joints, and cables and hoses that the joints twist. Where the rest pose is not
known, a friction offset (`Terms.offset`) takes up the torque ``-k q_rest`` at q = 0, and ``q_rest`` follows from both.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from regressors.arguments import checked
from regressors.errors import InputError, UnknownName, check_names
from regressors.models.base import Base
from regressors.models.drives import (
    DriveMotion,
    drive_columns,
    drive_motions,
    drive_rows,
    friction_magnitude,
    friction_terms,
    rotor_torque,
)
from regressors.models.model import RegressorModel
from regressors.models.nominal import standard_values
from regressors.models.reduction import Reduction, inertial_columns, reduction_by, standard_columns
from regressors.robot.columns import BODY_KINDS, DIRECTED_KINDS, LOAD_SHARE, ROTOR, Column, Terms, drive_column
from regressors.robot.friction.load_and_temperature import torques_at_drives
from regressors.robot.inertia import PARAMETERS_PER_LINK
from regressors.robot.robot import Robot
from regressors.robot.symbolic.kinematics import bodies, body_regressor, effort_regressor, sparse
from regressors.robot.symbolic.vectorised import VectorisedFunction, evaluate_samples
from regressors.samples import Array, Samples


def inertial_regressor(robot: Robot, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
    """Joint torques per standard inertial parameter.

    Body i's wrench about its own origin is ``[F; N] = [F_i; N_i](q, dq, ddq) theta_i``; joint j carries its part
    along the joint's motion vector in that frame, ``Y_ji = l_j' F_i + s_j' N_i`` (zero for the joints after link i).
    """  # q, dq, ddq (n, 1)
    blocks = (effort_regressor(body) for body in bodies(robot, q, dq, ddq))
    return ca.horzcat(*(ca.vertcat(rows, ca.SX(robot.n - rows.shape[0], 10)) for rows in blocks))


def inertial_torque(robot: Robot, theta: Array, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
    """Joint torques of bodies with given parameters: each body's wrench first, then its parts at the joints.

    ``tau_j = sum_i l_j' F_i theta_i + s_j' N_i theta_i``, the product of `inertial_regressor` and theta in a fraction
    of its operations.
    """  # theta (b, 10); q, dq, ddq (n, 1)
    tau = ca.SX(robot.n, 1)
    for body, values in zip(bodies(robot, q, dq, ddq), theta, strict=True):
        force, moment = (ca.mtimes(part, sparse(values)) for part in body_regressor(body.omega, body.domega, body.a))
        rows = [ca.dot(linear, force) + ca.dot(angular, moment) for angular, linear in body.axes]
        tau += ca.vertcat(*rows, ca.SX(robot.n - len(rows), 1))
    return tau


@checked
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
    carried : mapping of str to float, optional
        Standard parameters by name of the bodies and rotors whose torque the drives carry, for load shares: any
        numbers, such as those of an estimate (`regressors.models.differential.standard_of`). Those of the robot's
        description if not given. They are fixed, so that the model stays linear in its own parameters.

    Raises
    ------
    InputError
        Load shares of a robot whose masses are not known, or that does not have one drive for each joint.
    UnknownName
        Terms of a drive, or a carried parameter, that the robot does not have.
    """

    rows_are_joint_torques = True
    jax_form = "regressors.jax_models.jax_model:DifferentialPart"
    reduction: Reduction

    def __init__(
        self,
        robot: Robot,
        terms: Terms | None = None,
        *,
        sign_width: float = 0.0,
        carried: Mapping[str, float] | None = None,
    ) -> None:
        self.robot = robot
        self.terms = terms if terms is not None else Terms()
        self.sign_width = sign_width
        self.carried = None if carried is None else dict(carried)
        self.reduction = reduction_by(robot, self.terms)
        self.carried_bodies = None
        if any(column.kind == LOAD_SHARE for column in self.reduction.standard):
            self.carried_bodies = carried_bodies(robot, self.carried)
            torques_at_drives(robot)  # refuses what has no load of each drive
        self.columns = self.reduction.columns
        units = ("Nm" if joint.kind == "revolute" else "N" for joint in robot.joints)
        self.row_labels = tuple(zip(robot.joint_names, units, strict=True))

    @property
    def options(self) -> dict[str, Any]:
        """Terms and sign width, and the carried parameters where they are given."""
        given = {} if self.carried is None else {"carried": self.carried}
        return {"terms": self.terms, "sign_width": self.sign_width, **given}

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
        return tau + ca.mtimes(self._drives(q, dq, ddq), sparse(of_drives)) if of_drives.size else tau

    def rows(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        """Joint torques per parameter, shape (n, p) [Nm per unit parameter]."""
        inertial = inertial_regressor(self.robot, q, dq, ddq)
        return self.reduction.apply(ca.horzcat(inertial, self._drives(q, dq, ddq)))

    def _drives(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        motions = drive_motions(self.robot, q, dq, ddq)
        return drive_columns(motions, self.terms, self.sign_width, self._loads(motions, q, dq, ddq))

    def friction_magnitudes(self, samples: Samples) -> Array:
        """Magnitude of every directed friction column of a drive, see `regressors.models.model.RegressorModel`."""
        terms = self.terms
        if not (terms.load_share or terms.root or terms.stribeck):  # Coulomb friction alone
            return np.ones((samples.time.size, self._magnitudes.shape[0]))
        return evaluate_samples(self._magnitudes, samples)[:, :, 0]

    @cached_property
    def _magnitudes(self) -> VectorisedFunction:
        return self._compiled(self._magnitude_expression)

    def _magnitude_expression(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        motions = drive_motions(self.robot, q, dq, ddq)
        loads = self._loads(motions, q, dq, ddq)
        directed = ((kind, d) for kind, d in friction_terms(motions, self.terms) if kind in DIRECTED_KINDS)
        return ca.vertcat(*(friction_magnitude(kind, d, self.terms, loads.get(d.number)) for kind, d in directed))

    def _loads(self, drives: tuple[DriveMotion, ...], q: ca.SX, dq: ca.SX, ddq: ca.SX) -> dict[int, ca.SX]:
        """Torque that each drive carries; none where no load share is a parameter."""
        if self.carried_bodies is None:
            return {}
        of_bodies = inertial_torque(self.robot, self.carried_bodies, q, dq, ddq)
        return carried_at_drives(self.robot, self.carried, drives, of_bodies)


RIGID = ("inertial", "rotor")


def carried_bodies(robot: Robot, carried: Mapping[str, float] | None) -> Array:
    """Parameters of the bodies whose torques the drives carry."""
    known = standard_values(robot) if carried is None else carried
    names = [column.name for column in inertial_columns(robot)]
    possible = {column.name for column in standard_columns(robot)}
    for name in known:
        if name not in possible:
            raise UnknownName("standard parameter", name, names)
    theta = np.array([known.get(name, np.nan) for name in names], dtype=float)
    if missing := [name for name, value in zip(names, theta, strict=True) if not np.isfinite(value)]:
        raise InputError(
            "friction that grows with the load needs the torque that each drive carries, but "
            f"{len(missing)} parameters of the bodies of robot {robot.name!r} are not known "
            f"({', '.join(missing[:3])}, ...); add them to the description, or give "
            "the argument carried in Python, such as standard parameters of an estimate without `load_share`"
        )
    return theta.reshape(-1, PARAMETERS_PER_LINK)


def carried_rotors(robot: Robot, carried: Mapping[str, float] | None) -> dict[int, float]:
    """Rotor inertia of every drive, by its number; zero where it is not known [kg m^2]."""
    known = standard_values(robot) if carried is None else carried
    return {number: float(known.get(drive_column(number, ROTOR).name, 0.0)) for number in drive_rows(robot)}


def carried_at_drives(
    robot: Robot, carried: Mapping[str, float] | None, drives: tuple[DriveMotion, ...], bodies: ca.SX
) -> dict[int, ca.SX]:
    """Torque that each drive carries, by the number of the drive [Nm or N]."""  # bodies (n, 1)
    inertia = carried_rotors(robot, carried)
    of_bodies = ca.mtimes(sparse(torques_at_drives(robot)), bodies)
    return {
        d.number: of_bodies[k] + (inertia[d.number] * rotor_torque(d) if d.has_rotor else 0.0)
        for k, d in enumerate(drives)
    }


def standard_of(model: RegressorModel, base: Base, coefficients: Array) -> dict[str, float]:
    """Standard parameters of bodies and rotors that reproduce given base parameters: the smallest of all that do.

    Of the many ``p`` with ``D p = beta``, that of least norm; its standard parameters give the torques ``W_b beta`` of
    the bodies and rotors in every motion. They are no masses, and may be negative; use them as `carried` of
    `regressors.models.differential.DifferentialModel`.
    """  # coefficients (b,)
    composition = model.composition
    rigid = np.array([column.group in RIGID for column in base.columns])
    rows = rigid[base.index]
    p = np.linalg.lstsq(base.D[np.ix_(rows, rigid)], np.asarray(coefficients, dtype=float)[rows], rcond=None)[0]
    values = composition.matrix[:, rigid] @ p
    kinds = (*BODY_KINDS, ROTOR)
    return {c.name: float(v) for c, v in zip(composition.standard, values, strict=True) if c.kind in kinds}


STIFFNESS = "stiffness"


class SpringModel(DifferentialModel):
    """Joint torques with the stiffness of a linear spring in every joint; it has no JAX form.

    Parameters
    ----------
    robot : Robot
    terms, sign_width, carried
        See `DifferentialModel`.
    rest : mapping of str to float, optional
        Positions, by joint name, at which the springs exert no torque [rad or m]; zero if not given.

    Raises
    ------
    UnknownName
        The rest position of a joint that the robot does not have.
    """

    def __init__(
        self,
        robot: Robot,
        terms: Terms | None = None,
        *,
        sign_width: float = 0.0,
        rest: Mapping[str, float] | None = None,
        carried: Mapping[str, float] | None = None,
    ) -> None:
        super().__init__(robot, terms, sign_width=sign_width, carried=carried)
        self.rest = dict(rest or {})
        check_names("joint", self.rest, robot.joint_names)
        units = ("Nm/rad" if joint.kind == "revolute" else "N/m" for joint in robot.joints)
        springs = (Column(f"k{j}", unit, STIFFNESS) for j, unit in zip(robot.link_numbers, units, strict=True))
        self.columns = (*self.columns, *springs)

    @property
    def options(self) -> dict[str, Any]:
        """Terms, sign width and rest positions."""
        return {**super().options, "rest": self.rest}

    def on(self, robot: Robot) -> SpringModel:
        """The same model for another form of the robot, with the springs of the joints that it has."""
        rest = {name: value for name, value in self.rest.items() if name in robot.joint_names}
        return type(self)(robot, **{**self._options_on(robot), "rest": rest})

    def rows(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        """Joint torques per parameter, shape (n, p) [Nm per unit parameter]."""
        rest = ca.DM([self.rest.get(name, 0.0) for name in self.robot.joint_names])
        return ca.horzcat(super().rows(q, dq, ddq), ca.diag(q - rest))
