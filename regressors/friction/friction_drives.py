"""Drives that have friction, and maps between torques at drives and at joints [KD96] section 5.2."""

from __future__ import annotations

import casadi as ca
import numpy as np

from regressors.errors import InputError
from regressors.robot.robot import Robot
from regressors.samples import Array
from regressors.symbolic.kinematics import sparse

_NOTHING = 1e-12  # of a drive's velocity along a direction


def drives_with_friction(robot: Robot) -> tuple[tuple[str, Array], ...]:
    """Name and row of C of every drive whose joint moves; joints themselves where the robot has no transmission."""
    transmission = robot.transmission
    if transmission is None:
        return tuple(zip(robot.joint_names, np.eye(robot.n), strict=True))
    rows = zip(transmission.drives, transmission.coupling, strict=True)
    return tuple((drive.name, row) for drive, row in rows if not drive.rests)


def moving_drive_numbers(robot: Robot) -> dict[str, int]:
    """Number in parameter names of every drive whose joint moves, by name."""
    if robot.transmission is None:
        return dict(zip(robot.joint_names, robot.link_numbers, strict=True))
    return {drive.name: k for k, drive in enumerate(robot.transmission.drives, 1) if not drive.rests}


def drive_temperatures(robot: Robot, temperature: Array) -> Array:
    """Temperatures of the drives with friction: each takes the temperature of its own joint.

    Where there are as many drives as joints, a drive's own joint is the one of the same number, if the drive moves it,
    such as in a differential wrist ``z4 = q4 + q5, z5 = q4 - q5``; otherwise it is the last joint that the drive moves.
    """  # temperature (N, n)
    rows = [row for _, row in drives_with_friction(robot)]
    paired = len(rows) == robot.n
    own = [k if paired and row[k] != 0.0 else int(np.flatnonzero(row)[-1]) for k, row in enumerate(rows)]
    return np.asarray(temperature)[:, own]


def smooth_direction(robot: Robot, dq: ca.SX, width: ca.SX | float) -> ca.SX:
    """``tanh(dz / width)`` of every drive with friction."""  # dq (n, 1)
    rows = np.array([row for _, row in drives_with_friction(robot)]).reshape(-1, robot.n)
    return ca.densify(ca.tanh(ca.mtimes(sparse(rows), dq) / width))


def torques_at_drives(robot: Robot) -> Array:
    """Matrix from joint torques to those of the drives with friction, ``tau = C' tau_z`` solved for ``tau_z``."""
    drives = drives_with_friction(robot)
    C = np.array([row for _, row in drives]).reshape(-1, robot.n)
    if C.shape[0] != robot.n or np.linalg.matrix_rank(C) < robot.n:
        raise InputError(
            f"friction that grows with load needs one drive for each joint; here {robot.n} joints "
            f"({', '.join(robot.joint_names)}) have the drives {', '.join(name for name, _ in drives)}"
        )
    return np.asarray(np.linalg.inv(C.T))


def carried_along(robot: Robot, moved: Array) -> Array:
    """Matrix from torques along directions, ``N' tau``, to joint torques with the same load on moved drives."""
    # moved (n, r)
    C = np.array([row for _, row in drives_with_friction(robot)]).reshape(-1, robot.n)
    along = C @ moved
    turning = np.any(np.abs(along) > _NOTHING, axis=1)
    if np.count_nonzero(turning) != along.shape[1] or np.linalg.matrix_rank(along[turning]) < along.shape[1]:
        names = [name for (name, _), turns in zip(drives_with_friction(robot), turning, strict=True) if turns]
        raise InputError(
            f"friction grows with load, and torques along {along.shape[1]} direction(s) "
            "do not determine the load of each "
            f"of the drives {', '.join(names)}; take all joints, or drives that move alone"
        )
    return np.asarray(C[turning].T @ np.linalg.inv(along[turning]).T)
