"""Limits of joint and drive torques: what the motion takes must be there, also if the parameters are uncertain."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from constraints.nonlinear import NonlinearConstraint
from regressors.columns import Terms
from regressors.differential import DifferentialModel
from regressors.errors import InputError
from regressors.kinematics import sparse
from regressors.robot import Robot
from regressors.samples import Array


def torque_limits(robot: Robot, known: Mapping[str, float], margin: float) -> list[NonlinearConstraint]:
    """Torque limits of joints and drives, each reduced by a margin.

    Inertial, gravity and rotor torques and viscous friction come from nominal parameters; Coulomb friction counts in
    full in both directions, so that its sign needs no knowledge: ``|tau| + F_c <= (1 - margin) limit``. Drive torques
    are ``tau_z = C^-T tau_q``, where the coupling can be inverted.

    Parameters
    ----------
    robot : Robot
    known : mapping of str to float
        Standard parameters of the robot, see `regressors.parameters.standard_values`; what is not there of drives
        counts as zero.
    margin : float
        Part of each limit that is kept in reserve, 0 <= margin < 1.

    Returns
    -------
    list of NonlinearConstraint
        For the joints and for the drives, as far as either have limits.

    Raises
    ------
    InputError
        A margin that is none, or a link of unknown inertia.
    """
    if not 0 <= margin < 1:
        raise InputError(f"torque margin must be 0 or more and less than 1, given {margin}")
    missing = [body.name for body in robot.bodies if body.theta is None]
    if missing:
        raise InputError(f"torque limits need the inertias of all links; unknown: {', '.join(missing)}")
    found = []
    coulomb = _coulomb(robot, known)
    labels = tuple(f"joint {name} torque" for name in robot.joint_names)
    units = tuple("Nm" if joint.kind == "revolute" else "N" for joint in robot.joints)
    C = np.eye(robot.n) if robot.transmission is None else robot.transmission.coupling
    made = _limits(
        robot, known, np.eye(robot.n), np.asarray(np.abs(C.T) @ coulomb), robot.limits.torque, labels, units, margin
    )
    found += made
    if robot.transmission is not None and C.shape == (robot.n, robot.n) and np.linalg.matrix_rank(C) == robot.n:
        labels = tuple(f"drive {drive.name} torque" for drive in robot.transmission.drives)
        limits = robot.transmission.limits.torque
        found += _limits(robot, known, np.asarray(np.linalg.inv(C).T), coulomb, limits, labels, units, margin)
    return found


def _coulomb(robot: Robot, known: Mapping[str, float]) -> Array:
    """Coulomb friction of every drive, shape (drives,); zero where it rests or is not known."""
    if robot.transmission is None:
        return np.array([known.get(f"F{number}c", 0.0) for number in robot.link_numbers])
    drives = enumerate(robot.transmission.drives, 1)
    return np.array([0.0 if drive.rests else known.get(f"F{number}c", 0.0) for number, drive in drives])


def _limits(
    robot: Robot,
    known: Mapping[str, float],
    matrix: Array,
    friction: Array,
    limits: Array,
    labels: tuple[str, ...],
    units: tuple[str, ...],
    margin: float,
) -> list[NonlinearConstraint]:
    """Limits of ``matrix @ tau``, those that are finite."""
    rows = np.flatnonzero(np.isfinite(limits))
    if rows.size == 0:
        return []
    model = DifferentialModel(robot, Terms(rotor=True, coulomb=False, viscous=True, offset=False))
    definition, names = model.definition()
    values = ca.DM(definition @ np.array([_finite(known.get(name, 0.0)) for name in names]))

    def torque(q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        return ca.mtimes(sparse(matrix[rows]), ca.mtimes(model.rows(q, dq, ddq), values))

    room = (1 - margin) * limits[rows] - friction[rows]
    for k, row in enumerate(rows):
        if room[k] <= 0:
            raise InputError(
                f"{labels[row]}: friction of {friction[row]:g} {units[row]} leaves nothing of the limit "
                f"{limits[row]:g} {units[row]} with a margin of {100 * margin:g} %"
            )
    return [
        NonlinearConstraint(
            robot.n,
            torque,
            -room,
            room,
            room.copy(),
            tuple(labels[k] for k in rows),
            tuple(units[k] for k in rows),
        )
    ]


def _finite(value: float) -> float:
    return value if np.isfinite(value) else 0.0
