"""Limits of joint torques, as of given parameters or of all that are plausible.

The torque is linear in the standard parameters u, ``tau = Y(q, dq, ddq) u``, so that its largest value over the box
``|u_i - u^_i| <= d_i`` is exactly ``Y u^ + sum_i |Y_i| d_i`` [Ben-Tal, El Ghaoui, Nemirovski 2009, section 1.3], and
the least one likewise. Both are functions of the motion as any other, and are enclosed over continuous time.

[Ben-Tal, El Ghaoui, Nemirovski 2009] "Robust Optimization", Princeton University Press.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from constraints.drive_friction import DriveFriction, drive_friction
from constraints.nonlinear import Expression, Limit, NonlinearConstraint
from regressors.arguments import checked
from regressors.errors import InputError, listed_names
from regressors.models.differential import DifferentialModel
from regressors.models.model import RegressorModel
from regressors.models.nominal import standard_values, stated_deviations
from regressors.models.partial import PartialMotion, of_joints
from regressors.robot.columns import COULOMB, VISCOUS, Terms, drive_column
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.load_and_temperature import moving_drive_numbers
from regressors.robot.plausibility import implausible_inertias, undescribed
from regressors.robot.robot import Robot, linear_drives, transmission_of
from regressors.robot.symbolic.kinematics import sparse
from regressors.robot.symbolic.loops import loops_of
from regressors.samples import Array, Index

_SHOWN = 3  # links whose inertias are not plausible


def torque_limits(
    robot: Robot,
    known: Mapping[str, float],
    margin: float,
    motion: PartialMotion | None = None,
    friction: FrictionCurves | None = None,
) -> list[NonlinearConstraint]:
    """Torque limits of joints and drives, each reduced by a margin.

    Inertial, gravity and rotor torques and viscous friction come from nominal parameters; the Coulomb friction of
    moving drives counts in full in both directions, so that its sign is not needed: ``|tau| + F_c <= (1 - margin)
    limit``. Drive torques are ``tau_z = C^-T tau_q``. A drive with a friction curve uses the curve instead, ``F_v dz``
    and a rest between two bounds that hold in both directions up to the drive's velocity limit, see
    `constraints.drive_friction.friction_bound`: ``-(1 - margin) limit - lower <= tau <= (1 - margin) limit -
    upper``, which is safe, but not the tightest. Where friction grows by a share k of the carried torque, inertial,
    gravity and rotor torques count 1 + k times.
    """
    if not 0 <= margin < 1:
        raise InputError(f"torque margin must be 0 or more and less than 1, given {margin}")
    check_inertias(robot, "torque limits")
    motion = of_joints(robot, range(robot.n)) if motion is None else motion
    drives = drive_friction(robot, known, motion, friction)
    torques = viscous_and_carried(robot, known, drives)
    return [_limits(rows, rows.total(*torques), margin).restricted(motion) for rows in limited_torques(robot, drives)]


@dataclass(frozen=True, eq=False)
class LimitedTorques:
    """Torques ``matrix @ tau_q`` with their limits and their friction, some of them without a limit."""

    matrix: Array  # (k, n)
    limits: Array  # (k,) infinite where there is none [Nm or N]
    friction: DriveFriction
    labels: tuple[str, ...]
    units: tuple[str, ...]

    @property
    def kept(self) -> Index:
        """Numbers of those that have a limit."""
        return np.flatnonzero(np.isfinite(self.limits))

    def allowed(self, margin: float) -> tuple[Array, Array]:
        """Lower and upper bound of the torques that have a limit, less friction and a margin."""
        rest, share = self.friction.rest[self.kept], self.friction.share[self.kept]
        most = (1 - margin) * self.limits[self.kept]
        # where friction grows with the load, it must not break the limit while the load pulls the other way
        alone = np.where(share > 0, self.friction.largest[self.kept], np.abs(rest).max(axis=1, initial=0.0))
        for k, friction, left in zip(self.kept, alone, most - alone, strict=True):
            if left <= 0:
                raise InputError(
                    f"{self.labels[k]}: friction of {friction:g} {self.units[k]} exceeds the limit of "
                    f"{self.limits[k]:g} {self.units[k]} less a margin of {100 * margin:g} %; give a smaller margin"
                )
        return -most - rest[:, 0], most - rest[:, 1]

    def total(self, torque: Expression, carried: Expression) -> Expression:
        """Limited torques, with the friction that grows with what is carried."""
        matrix = sparse(self.matrix[self.kept])
        loaded = sparse(self.friction.share[self.kept][:, None] * self.matrix[self.kept])

        def expression(q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
            total = ca.mtimes(matrix, torque(q, dq, ddq))
            return total + ca.mtimes(loaded, carried(q, dq, ddq)) if loaded.nnz() else total

        return expression


def limited_torques(robot: Robot, friction: DriveFriction) -> list[LimitedTorques]:
    """Torques of joints and of drives, where these have limits."""
    limited = [rows for rows in (_joints(robot, friction), *_drives(robot, friction)) if rows.kept.size]
    if not limited:
        raise InputError(f"robot {robot.name!r} has no torque limits; its file states them (torque, effort in a URDF)")
    return limited


def check_inertias(robot: Robot, what: str) -> None:
    """Raise `InputError` where the inertia of a link is not known."""
    if missing := undescribed(robot):
        raise InputError(f"{what} need the inertias of all links; unknown: {', '.join(missing)}")


def joint_torque(robot: Robot, known: Mapping[str, float]) -> Expression:
    """Torques at the joints [Nm or N], with viscous friction only."""
    model = DifferentialModel(robot, Terms(coulomb=False))
    definition, names = model.definition()
    parameters = np.asarray(definition @ np.array([known.get(name, 0.0) for name in names]))
    return at_drives(robot, lambda q, dq, ddq: model.torque(parameters, q, dq, ddq))


def at_drives(robot: Robot, torques: Expression) -> Expression:
    """Torques of the drives that do the same as those of all joints of a tree; the same ones without closed loops."""
    if not robot.closures:
        return torques
    loops = loops_of(robot)
    return lambda q, dq, ddq: loops.at_drives(q, torques(q, dq, ddq))


def viscous_and_carried(
    robot: Robot, known: Mapping[str, float], drives: DriveFriction
) -> tuple[Expression, Expression]:
    """Torques at the joints with viscous friction, and those that the drives carry, without it."""
    rubs = [drive.name for drive, rest in zip(transmission_of(robot).drives, drives.rest, strict=True) if rest.any()]
    if passive := [name for name in rubs if name in robot.passive]:
        raise InputError(
            f"robot {robot.name!r}: the Coulomb friction of {listed_names(passive)}, which no drive moves, is not "
            "counted in torques of drives; leave it out of the description, or leave the limits of torques out"
        )
    viscous = joint_torque(robot, {**known, **drives.viscous})
    return viscous, joint_torque(robot, {**known, **dict.fromkeys(drives.viscous, 0.0)})


def _joints(robot: Robot, friction: DriveFriction) -> LimitedTorques:
    labels = tuple(f"joint {name} torque" for name in robot.joint_names)
    units = tuple("Nm" if joint.kind == "revolute" else "N" for joint in robot.joints)
    return LimitedTorques(np.eye(robot.n), robot.limits.torque, friction.at_joints(robot), labels, units)


def _drives(robot: Robot, friction: DriveFriction) -> list[LimitedTorques]:
    """Rows for the drives, where they have limits; those of locked joints and drives have none."""
    transmission = transmission_of(robot)
    limits = np.where([drive.rests for drive in transmission.drives], np.inf, transmission.limits.torque)
    if not np.any(np.isfinite(limits)):
        return []
    units = tuple("N" if linear else "Nm" for linear in linear_drives(robot))
    labels = tuple(f"drive {drive.name} torque" for drive in transmission.drives)
    return [LimitedTorques(drive_torque_matrix(robot), limits, friction, labels, units)]


def drive_torque_matrix(robot: Robot) -> Array:
    """Torques of the m drives from those of the n joints, ``C^-T`` of the drives that do not rest, shape (m, n)."""
    transmission = transmission_of(robot)
    turning = [k for k, drive in enumerate(transmission.drives) if not drive.rests]
    C = transmission.coupling[turning]
    if C.shape[0] != robot.n or np.linalg.matrix_rank(C) < robot.n:
        raise InputError(
            f"robot {robot.name!r}: the torques of its {C.shape[0]} drives are not determined by those of its "
            f"{robot.n} joints, so torque limits of drives cannot be imposed"
        )
    matrix = np.zeros((len(transmission.drives), robot.n))
    matrix[turning] = np.linalg.inv(C).T
    return matrix


def _limits(rows: LimitedTorques, torque: Expression, margin: float) -> NonlinearConstraint:
    """Constraint on the finite limits."""
    lower, upper = rows.allowed(margin)
    labels, units = (tuple(texts[k] for k in rows.kept) for texts in (rows.labels, rows.units))
    joints, scale = rows.matrix.shape[1], 0.5 * (upper - lower)
    return NonlinearConstraint(joints, torque, lower, upper, scale, labels, units, quantity="torque")


@checked
@dataclass(frozen=True)
class TorqueLimit(Limit):
    """The torque limits of joints and drives, each reduced by a margin.

    Parameters
    ----------
    margin : float
        Fraction of each limit that is kept in reserve, 0 <= margin < 1.
    friction : FrictionCurves, optional
        Curves of some of the drives, which replace the friction in the robot's description.
    """

    margin: float = 0.0
    friction: FrictionCurves | None = None

    def imposed(self, robot: Robot, motion: PartialMotion) -> Sequence[NonlinearConstraint]:
        """See `torque_limits`, with the parameters of the robot's description."""
        return torque_limits(robot, standard_values(robot), self.margin, motion, self.friction)


@checked
@dataclass(frozen=True)
class PlausibleTorqueLimit(Limit):
    """The torque limits of joints and drives, kept by every robot of a box of parameters around the description.

    Each mass, first moment, entry of an inertia tensor, rotor inertia and friction coefficient is off by up to a share
    of its size, see `regressors.models.nominal.stated_deviations`, independently of the others: a first
    moment by a share of its length, an entry of an inertia tensor by a share of the largest principal moment. The box
    contains robots that no body could have, so the limit is never too loose for those that may exist. Parameters that
    the description does not state count as zero, as in `constraints.torque`; friction curves count as known.

    Parameters
    ----------
    uncertainty : float
        Share, greater than 0.
    friction : FrictionCurves, optional
        Curves of some of the drives, which replace the friction in the robot's description.
    """

    uncertainty: float
    friction: FrictionCurves | None = None

    def imposed(self, robot: Robot, motion: PartialMotion) -> Sequence[NonlinearConstraint]:
        """One constraint for the joints and one for the drives, where these have torque limits.

        Raises
        ------
        InputError
            An uncertainty that is not greater than zero, a robot without torque limits, friction that uses up a limit,
            or see `constraints.torque.torque_limits`.
        """
        if not 0 < self.uncertainty < np.inf:
            raise InputError(f"torque uncertainty must be a number greater than 0, given {self.uncertainty}")
        check_inertias(robot, "torque limits")
        known = standard_values(robot)
        numbers = moving_drive_numbers(robot)
        coulomb = {drive_column(number, COULOMB).name for number in numbers.values()}
        largest = {name: value * (1 + self.uncertainty * (name in coulomb)) for name, value in known.items()}
        drives = drive_friction(robot, largest, motion, self.friction)
        torques = viscous_and_carried(robot, known, drives)
        curves = {} if self.friction is None else self.friction.curves
        exact = {drive_column(number, VISCOUS).name: 0.0 for name, number in numbers.items() if name in curves}
        model = DifferentialModel(robot, Terms(coulomb=False))
        terms = deviation_terms(model, {**stated_deviations(robot, self.uncertainty), **exact})
        limited = limited_torques(robot, drives)
        return [_robust_limits(rows, rows.total(*torques), terms).restricted(motion) for rows in limited]


def deviation_terms(model: RegressorModel, deviations: Mapping[str, float]) -> Expression:
    """``Y diag(d)``, shape (r, parameters that deviate)."""
    definition, names = model.definition()
    d = np.array([deviations.get(name, 0.0) for name in names])
    scaled = sparse(definition[:, d > 0] * d[d > 0])
    return at_drives(model.robot, lambda q, dq, ddq: ca.mtimes(model.rows(q, dq, ddq), scaled))


def _robust_limits(rows: LimitedTorques, torque: Expression, terms: Expression) -> NonlinearConstraint:
    """Largest torques below their limits, and least ones above; each with friction at its largest."""
    kept, (lower, upper) = rows.kept, rows.allowed(0.0)
    matrix, share = sparse(rows.matrix[kept]), ca.DM(1 + rows.friction.share[kept])

    def expression(q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        nominal = torque(q, dq, ddq)
        deviation = share * ca.sum2(ca.fabs(ca.mtimes(matrix, terms(q, dq, ddq))))
        return ca.vertcat(nominal + deviation, nominal - deviation)

    none, ends = np.full(kept.size, np.inf), ("largest", "least")
    labels = tuple(f"{rows.labels[k]} of plausible robots, {end}" for end in ends for k in kept)
    bounds = np.concatenate([-none, lower]), np.concatenate([upper, none]), np.tile(0.5 * (upper - lower), 2)
    texts, joints = (labels, 2 * tuple(rows.units[k] for k in kept)), rows.matrix.shape[1]
    return NonlinearConstraint(joints, expression, *bounds, *texts, quantity="torque of plausible robots")


def why_no_torques(robot: Robot) -> str | None:
    """Why limits of torques cannot be checked; None if they can."""
    limited = (robot.limits.torque, transmission_of(robot).limits.torque)
    if not np.any(np.isfinite(np.concatenate(limited))):
        return "no limit is stated"
    doubts = implausible_inertias(robot)
    if not doubts:
        return None
    shown = [f"{name}: {reason}" for name, reason in list(doubts.items())[:_SHOWN]]
    more = f", and {len(doubts) - _SHOWN} more" if len(doubts) > _SHOWN else ""
    return f"inertial parameters are not plausible: {'; '.join(shown)}{more}"
