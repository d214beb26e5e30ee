"""Torque that each drive carries, of bodies and rotors with fixed parameters: what friction grows with.

As for the friction curves with load shares [`regressors.robot.friction.load_share`], a drive carries the torque that
moves the robot without friction, at the drive coordinate, ``tau_z = C'^-1 tau_q``, with its own rotor.
"""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from regressors.errors import InputError, UnknownName
from regressors.models.base import Base
from regressors.models.drives import DriveMotion, drive_rows, rotor_torque
from regressors.models.model import RegressorModel
from regressors.models.nominal import standard_values
from regressors.models.reduction import inertial_columns, standard_columns
from regressors.robot.columns import BODY_KINDS, ROTOR, drive_column
from regressors.robot.friction.load_share import torques_at_drives
from regressors.robot.inertia import PARAMETERS_PER_LINK
from regressors.robot.robot import Robot
from regressors.robot.symbolic.kinematics import sparse
from regressors.samples import Array

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
