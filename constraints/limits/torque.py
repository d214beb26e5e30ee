"""Limits of joint and drive torques, with a margin for the uncertainty of the parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from constraints.friction.drive_friction import DriveFriction, drive_friction
from constraints.limit import Limit
from constraints.nonlinear import Expression, NonlinearConstraint
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.columns import Terms
from regressors.models.differential import DifferentialModel
from regressors.models.nominal import standard_values
from regressors.models.partial import PartialMotion, of_joints
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.robot import Robot
from regressors.robot.symbolic.kinematics import sparse
from regressors.samples import Array, Index


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
    `constraints.friction.drive_friction.friction_bound`: ``-(1 - margin) limit - lower <= tau <= (1 - margin) limit -
    upper``, which is safe, but not the tightest. Where friction grows by a share k of the carried torque, inertial,
    gravity and rotor torques count 1 + k times.
    """
    if not 0 <= margin < 1:
        raise InputError(f"torque margin must be 0 or more and less than 1, given {margin}")
    check_inertias(robot, "torque limits")
    motion = of_joints(robot, range(robot.n)) if motion is None else motion
    drives = drive_friction(robot, known, motion, friction)
    torque = joint_torque(robot, {**known, **drives.viscous})
    carried = joint_torque(robot, {**known, **dict.fromkeys(drives.viscous, 0.0)})
    return [
        _limits(rows, robot.n, torque, carried, margin).restricted(motion) for rows in limited_torques(robot, drives)
    ]


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


def limited_torques(robot: Robot, friction: DriveFriction) -> list[LimitedTorques]:
    """Torques of joints and of drives, where these have limits."""
    limited = [rows for rows in (_joints(robot, friction), *_drives(robot, friction)) if rows.kept.size]
    if not limited:
        raise InputError(f"robot {robot.name!r} has no torque limits; its file states them (torque, effort in a URDF)")
    return limited


def check_inertias(robot: Robot, what: str) -> None:
    """Raise `InputError` where the inertia of a link is not known."""
    missing = [body.name for body in robot.bodies if body.theta is None]
    if missing:
        raise InputError(f"{what} need the inertias of all links; unknown: {', '.join(missing)}")


def joint_torque(robot: Robot, known: Mapping[str, float]) -> Expression:
    """Torques at the joints [Nm or N], with viscous friction only."""
    model = DifferentialModel(robot, Terms(rotor=True, coulomb=False, viscous=True, offset=False))
    definition, names = model.definition()
    parameters = np.asarray(definition @ np.array([known.get(name, 0.0) for name in names]))
    return lambda q, dq, ddq: model.torque(parameters, q, dq, ddq)


def _joints(robot: Robot, friction: DriveFriction) -> LimitedTorques:
    labels = tuple(f"joint {name} torque" for name in robot.joint_names)
    units = tuple("Nm" if joint.kind == "revolute" else "N" for joint in robot.joints)
    return LimitedTorques(np.eye(robot.n), robot.limits.torque, friction.at_joints(robot), labels, units)


def _drives(robot: Robot, friction: DriveFriction) -> list[LimitedTorques]:
    """Rows for the drives, where they have limits."""
    transmission = robot.transmission
    if transmission is None or not np.any(np.isfinite(transmission.limits.torque)):
        return []
    matrix = drive_torque_matrix(robot)
    C = transmission.coupling
    prismatic = np.array([joint.kind == "prismatic" for joint in robot.joints])
    units = tuple("N" if np.any(row[prismatic] != 0.0) else "Nm" for row in C)
    labels = tuple(f"drive {drive.name} torque" for drive in transmission.drives)
    return [LimitedTorques(matrix, transmission.limits.torque, friction, labels, units)]


def drive_torque_matrix(robot: Robot) -> Array:
    """``C^-T``: torques of the drives from those of the joints, shape (n, n), for a robot with a transmission."""
    assert robot.transmission is not None
    C = robot.transmission.coupling
    if C.shape[0] != robot.n or np.linalg.matrix_rank(C) < robot.n:
        raise InputError(
            f"robot {robot.name!r}: the torques of its {C.shape[0]} drives are not determined by those of its "
            f"{robot.n} joints, so torque limits of drives cannot be imposed"
        )
    return np.asarray(np.linalg.inv(C).T)


def _limits(
    rows: LimitedTorques, joints: int, torque: Expression, carried: Expression, margin: float
) -> NonlinearConstraint:
    """Constraint on the finite limits, from torques with viscous friction and carried torques without it."""
    kept, (lower, upper) = rows.kept, rows.allowed(margin)
    share = rows.friction.share[kept]
    matrix, loaded = sparse(rows.matrix[kept]), sparse(share[:, None] * rows.matrix[kept])

    def expression(q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        total = ca.mtimes(matrix, torque(q, dq, ddq))
        return total + ca.mtimes(loaded, carried(q, dq, ddq)) if loaded.nnz() else total

    labels, units = (tuple(texts[k] for k in kept) for texts in (rows.labels, rows.units))
    return NonlinearConstraint(
        joints, expression, lower, upper, 0.5 * (upper - lower), labels, units, quantity="torque"
    )


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
