"""Limits of joint and drive torques: what the motion takes must be there, also if the parameters are uncertain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from constraints.friction_bounds import FrictionBound, friction_bound
from constraints.nonlinear import Expression, NonlinearConstraint
from regressors.columns import Terms
from regressors.differential import DifferentialModel
from regressors.errors import InputError
from regressors.friction import FrictionCurve, FrictionCurves
from regressors.kinematics import sparse
from regressors.partial import PartialMotion, of_joints
from regressors.robot import Robot
from regressors.samples import Array


def torque_limits(
    robot: Robot,
    known: Mapping[str, float],
    margin: float,
    motion: PartialMotion | None = None,
    friction: FrictionCurves | None = None,
) -> list[NonlinearConstraint]:
    """Torque limits of joints and drives, each reduced by a margin.

    Inertial, gravity and rotor torques and viscous friction come from nominal parameters; the Coulomb friction of
    drives that turn counts in full in both directions, so that its sign needs no knowledge:
    ``|tau| + F_c <= (1 - margin) limit``. Drive torques are ``tau_z = C^-T tau_q``. A drive with a friction curve has
    the friction of its curve instead, ``F_v dz`` and a rest between two bounds that hold in both directions up to the
    drive's velocity limit, see `constraints.friction_bounds.friction_bound`:
    ``-(1 - margin) limit - lower <= tau <= (1 - margin) limit - upper``, which is safe, but not the tightest.

    Parameters
    ----------
    robot : Robot
        The whole robot: what its resting joints must hold counts too.
    known : mapping of str to float
        Standard parameters of the robot, see `regressors.parameters.standard_values`; what is not there of drives
        counts as zero.
    margin : float
        Part of each limit that is kept in reserve, 0 <= margin < 1.
    motion : PartialMotion, optional
        From the moving coordinates, which the constraints are functions of, to the robot's joints; all of them if not
        given.
    friction : FrictionCurves, optional
        Of some of the drives, instead of the friction that is known of these as parameters.

    Returns
    -------
    list of NonlinearConstraint
        For the joints and for the drives, as far as either have limits.

    Raises
    ------
    InputError
        A margin that is none, a link of unknown inertia, a robot without torque limits, drives whose torques those of
        the joints do not tell, friction without a bound, or friction that leaves nothing of a limit.
    UnknownName
        A curve of a drive that the robot does not have.
    """
    if not 0 <= margin < 1:
        raise InputError(f"torque margin must be 0 or more and less than 1, given {margin}")
    missing = [body.name for body in robot.bodies if body.theta is None]
    if missing:
        raise InputError(f"torque limits need the inertias of all links; unknown: {', '.join(missing)}")
    motion = of_joints(robot, range(robot.n)) if motion is None else motion
    bounds = _bounds(robot, known, motion, friction)
    torque = _joint_torque(robot, {**known, **{f"F{label}v": bound.viscous for label, bound in bounds.items()}})
    rest = np.array([(bound.lower, bound.upper) for bound in bounds.values()]).reshape(-1, 2)
    found = [_limits(rows, robot.n, torque, margin) for rows in (_joints(robot, rest), *_drives(robot, rest))]
    if not any(limit.labels for limit in found):
        raise InputError(f"robot {robot.name!r} has no torque limits; its file states them (torque, effort in a URDF)")
    return [limit.restricted(motion) for limit in found if limit.labels]


@dataclass(frozen=True, eq=False)
class _Rows:
    """Torques ``matrix @ tau_q`` with their limits and the friction that comes on top, its lower and upper bound."""

    matrix: Array
    limits: Array
    friction: Array
    labels: tuple[str, ...]
    units: tuple[str, ...]


def _joint_torque(robot: Robot, known: Mapping[str, float]) -> Expression:
    """Torques at the joints, of friction the viscous part only."""
    model = DifferentialModel(robot, Terms(rotor=True, coulomb=False, viscous=True, offset=False))
    definition, names = model.definition()
    parameters = ca.DM(definition @ np.array([known.get(name, 0.0) for name in names]))
    return lambda q, dq, ddq: ca.mtimes(model.rows(q, dq, ddq), parameters)


def _coupling(robot: Robot) -> Array:
    return np.eye(robot.n) if robot.transmission is None else robot.transmission.coupling


def _bounds(
    robot: Robot, known: Mapping[str, float], motion: PartialMotion, curves: FrictionCurves | None
) -> dict[str, FrictionBound]:
    """Friction of every drive by its number; the rest is zero where it does not turn or is not known."""
    if curves is None:
        curves = FrictionCurves({})
    curves.check(robot)
    transmission = robot.transmission
    names = robot.joint_names if transmission is None else [drive.name for drive in transmission.drives]
    numbers = robot.link_numbers if transmission is None else range(1, len(names) + 1)
    turning = np.any(np.abs(_coupling(robot) @ motion.matrix) > 1e-12, axis=1)
    found = {}
    for k, (number, name) in enumerate(zip(numbers, names, strict=True)):
        curve, label = curves.curve(name), str(number)
        coulomb = known.get(f"F{label}c", 0.0)
        found[label] = FrictionBound(known.get(f"F{label}v", 0.0), -coulomb, coulomb)
        if not turning[k]:
            found[label] = replace(found[label], lower=0.0, upper=0.0)
        elif curve is not None:
            found[label] = _bound(curve, name, _fastest(robot, k))
    return found


def _bound(curve: FrictionCurve, name: str, fastest: float) -> FrictionBound:
    try:
        return friction_bound(curve, fastest)
    except InputError as error:
        raise InputError(f"torque limits: friction curve of {name}: {error}") from error


def _fastest(robot: Robot, k: int) -> float:
    """Largest speed of a drive within the velocity limits of the joints and its own [rad/s or m/s]."""
    row = np.abs(_coupling(robot)[k])
    joints = float(row[row > 0] @ robot.limits.velocity[row > 0])
    return joints if robot.transmission is None else min(joints, float(robot.transmission.limits.velocity[k]))


def _joints(robot: Robot, rest: Array) -> _Rows:
    C = _coupling(robot)
    ahead, behind = np.maximum(C, 0.0).T, np.minimum(C, 0.0).T
    friction = ahead @ rest + behind @ rest[:, ::-1]
    labels = tuple(f"joint {name} torque" for name in robot.joint_names)
    units = tuple("Nm" if joint.kind == "revolute" else "N" for joint in robot.joints)
    return _Rows(np.eye(robot.n), robot.limits.torque, friction, labels, units)


def _drives(robot: Robot, rest: Array) -> list[_Rows]:
    """The same of the drives, where they have limits."""
    transmission = robot.transmission
    if transmission is None or not np.any(np.isfinite(transmission.limits.torque)):
        return []
    C = transmission.coupling
    if C.shape[0] != robot.n or np.linalg.matrix_rank(C) < robot.n:
        raise InputError(
            f"robot {robot.name!r}: torques of its {C.shape[0]} drives do not follow from those of its {robot.n} "
            "joints, so their limits cannot be imposed"
        )
    prismatic = np.array([joint.kind == "prismatic" for joint in robot.joints])
    units = tuple("N" if np.any(row[prismatic] != 0.0) else "Nm" for row in C)
    labels = tuple(f"drive {drive.name} torque" for drive in transmission.drives)
    matrix = np.asarray(np.linalg.inv(C).T)
    return [_Rows(matrix, transmission.limits.torque, rest, labels, units)]


def _limits(rows: _Rows, joints: int, torque: Expression, margin: float) -> NonlinearConstraint:
    """Limits that are finite."""
    (kept,) = np.nonzero(np.isfinite(rows.limits))
    most = (1 - margin) * rows.limits[kept]
    lower, upper = -most - rows.friction[kept, 0], most - rows.friction[kept, 1]
    for k, left in zip(kept, np.minimum(-lower, upper), strict=True):
        if left <= 0:
            raise InputError(
                f"{rows.labels[k]}: friction of {np.abs(rows.friction[k]).max():g} {rows.units[k]} leaves nothing of "
                f"the limit {rows.limits[k]:g} {rows.units[k]} with a margin of {100 * margin:g} %"
            )
    matrix = sparse(rows.matrix[kept])
    labels, units = (tuple(texts[k] for k in kept) for texts in (rows.labels, rows.units))
    return NonlinearConstraint(
        joints,
        lambda q, dq, ddq: ca.mtimes(matrix, torque(q, dq, ddq)),
        lower,
        upper,
        0.5 * (upper - lower),
        labels,
        units,
    )
