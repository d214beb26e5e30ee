"""Limits of joint and drive torques: what the motion takes must be there, also if the parameters are uncertain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from constraints.nonlinear import Expression, NonlinearConstraint
from regressors.columns import Terms
from regressors.differential import DifferentialModel
from regressors.errors import InputError
from regressors.kinematics import sparse
from regressors.partial import PartialMotion, of_joints
from regressors.robot import Robot
from regressors.samples import Array


def torque_limits(
    robot: Robot, known: Mapping[str, float], margin: float, motion: PartialMotion | None = None
) -> list[NonlinearConstraint]:
    """Torque limits of joints and drives, each reduced by a margin.

    Inertial, gravity and rotor torques and viscous friction come from nominal parameters; the Coulomb friction of
    drives that turn counts in full in both directions, so that its sign needs no knowledge:
    ``|tau| + F_c <= (1 - margin) limit``. Drive torques are ``tau_z = C^-T tau_q``.

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

    Returns
    -------
    list of NonlinearConstraint
        For the joints and for the drives, as far as either have limits.

    Raises
    ------
    InputError
        A margin that is none, a link of unknown inertia, a robot without torque limits, drives whose torques those of
        the joints do not tell, or friction that leaves nothing of a limit.
    """
    if not 0 <= margin < 1:
        raise InputError(f"torque margin must be 0 or more and less than 1, given {margin}")
    missing = [body.name for body in robot.bodies if body.theta is None]
    if missing:
        raise InputError(f"torque limits need the inertias of all links; unknown: {', '.join(missing)}")
    motion = of_joints(robot, range(robot.n)) if motion is None else motion
    torque = _joint_torque(robot, known)
    found = [
        _limits(rows, robot.n, torque, margin)
        for rows in (_joints(robot, known, motion), *_drives(robot, known, motion))
    ]
    if not any(limit.labels for limit in found):
        raise InputError(f"robot {robot.name!r} has no torque limits; its file states them (torque, effort in a URDF)")
    return [limit.restricted(motion) for limit in found if limit.labels]


@dataclass(frozen=True, eq=False)
class _Rows:
    """Torques ``matrix @ tau_q`` with their limits and their largest Coulomb friction."""

    matrix: Array
    limits: Array
    friction: Array
    labels: tuple[str, ...]
    units: tuple[str, ...]


def _joint_torque(robot: Robot, known: Mapping[str, float]) -> Expression:
    """Torques at the joints without Coulomb friction."""
    model = DifferentialModel(robot, Terms(rotor=True, coulomb=False, viscous=True, offset=False))
    definition, names = model.definition()
    parameters = ca.DM(definition @ np.array([known.get(name, 0.0) for name in names]))
    return lambda q, dq, ddq: ca.mtimes(model.rows(q, dq, ddq), parameters)


def _coupling(robot: Robot) -> Array:
    return np.eye(robot.n) if robot.transmission is None else robot.transmission.coupling


def _coulomb(robot: Robot, known: Mapping[str, float], motion: PartialMotion) -> Array:
    """Coulomb friction of every drive, shape (drives,); zero where it does not turn or is not known."""
    count = robot.n if robot.transmission is None else len(robot.transmission.drives)
    numbers = robot.link_numbers if robot.transmission is None else range(1, count + 1)
    turning = np.any(np.abs(_coupling(robot) @ motion.matrix) > 1e-12, axis=1)
    return np.array([known.get(f"F{k}c", 0.0) if turns else 0.0 for k, turns in zip(numbers, turning, strict=True)])


def _joints(robot: Robot, known: Mapping[str, float], motion: PartialMotion) -> _Rows:
    friction = np.abs(_coupling(robot)).T @ _coulomb(robot, known, motion)
    labels = tuple(f"joint {name} torque" for name in robot.joint_names)
    units = tuple("Nm" if joint.kind == "revolute" else "N" for joint in robot.joints)
    return _Rows(np.eye(robot.n), robot.limits.torque, friction, labels, units)


def _drives(robot: Robot, known: Mapping[str, float], motion: PartialMotion) -> list[_Rows]:
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
    return [_Rows(matrix, transmission.limits.torque, _coulomb(robot, known, motion), labels, units)]


def _limits(rows: _Rows, joints: int, torque: Expression, margin: float) -> NonlinearConstraint:
    """Limits that are finite."""
    (kept,) = np.nonzero(np.isfinite(rows.limits))
    room = (1 - margin) * rows.limits[kept] - rows.friction[kept]
    for k, left in zip(kept, room, strict=True):
        if left <= 0:
            raise InputError(
                f"{rows.labels[k]}: friction of {rows.friction[k]:g} {rows.units[k]} leaves nothing of the limit "
                f"{rows.limits[k]:g} {rows.units[k]} with a margin of {100 * margin:g} %"
            )
    matrix = sparse(rows.matrix[kept])
    labels, units = (tuple(texts[k] for k in kept) for texts in (rows.labels, rows.units))
    return NonlinearConstraint(
        joints,
        lambda q, dq, ddq: ca.mtimes(matrix, torque(q, dq, ddq)),
        -room,
        room,
        room.copy(),
        labels,
        units,
    )
