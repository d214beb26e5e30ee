"""Columns of the drives: rotor inertia and friction, on drive coordinates z = C q + z0, as joint torques.

A drive torque tau_z reaches the joints as ``tau_q = C' tau_z``, so each drive's column is its own torque per unit
parameter times its row of C.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from regressors.models.columns import Column, Terms
from regressors.robot.robot import Robot
from regressors.symbolic.kinematics import sparse


@dataclass(frozen=True)
class DriveMotion:
    """One drive's coordinate and its derivatives, with its row of C.

    Parameters
    ----------
    label : str
        Number of the drive, as it stands in parameter names.
    z, dz, ddz : SX, scalar
        Drive coordinate [rad or m] and its derivatives.
    row : SX, shape (1, n)
        Row of the coupling C.
    ratio : SX, scalar
        Gear ratio F'(z).
    dratio : SX, scalar
        Its derivative F''(z).
    has_rotor : bool
        True if the rotor's inertia is a parameter.
    linear : bool
        True if the drive moves a prismatic joint; units follow.
    """

    label: str
    z: ca.SX
    dz: ca.SX
    ddz: ca.SX
    row: ca.SX
    ratio: ca.SX
    dratio: ca.SX
    has_rotor: bool
    linear: bool


def drive_motions(robot: Robot, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> tuple[DriveMotion, ...]:
    """Motion of every drive whose joint moves; one per joint where the robot has no transmission.

    Parameters
    ----------
    robot : Robot
    q, dq, ddq : SX, shape (n, 1)
    """
    transmission = robot.transmission
    if transmission is None:
        eye, zero = ca.SX.eye(robot.n), ca.SX(1, 1)
        linear = [joint.kind == "prismatic" for joint in robot.joints]
        return tuple(
            DriveMotion(str(number), q[k], dq[k], ddq[k], eye[k, :], ca.SX(1), zero, False, linear[k])
            for k, number in enumerate(robot.link_numbers)
        )
    motions = []
    for k, drive in enumerate(transmission.drives):
        if drive.rests:
            continue
        row = sparse(transmission.coupling[k : k + 1])
        symbol = ca.SX.sym("z")
        ratio = drive.ratio.ratio(symbol)
        dratio = ca.gradient(ratio, symbol)
        z = ca.mtimes(row, q) + transmission.offset[k]
        ratio, dratio = (ca.substitute(e, symbol, z) for e in (ratio, dratio))
        moved = [robot.joints[j].kind for j in range(robot.n) if transmission.coupling[k, j] != 0.0]
        motions.append(
            DriveMotion(
                label=str(k + 1),
                z=z,
                dz=ca.mtimes(row, dq),
                ddz=ca.mtimes(row, ddq),
                row=row,
                ratio=ratio,
                dratio=ca.sparsify(dratio),
                has_rotor=drive.rotor_inertia is not None,
                linear="prismatic" in moved,
            )
        )
    return tuple(motions)


def rotor_torque(drive: DriveMotion) -> ca.SX:
    """Torque at the drive coordinate per unit rotor inertia, ``F'^2 ddz + F' F'' dz^2`` [1/s^2].

    From the rotor's kinetic energy ``1/2 Ia (F'(z) dz)^2`` by Lagrange's equation.
    """
    return drive.ratio**2 * drive.ddz + drive.ratio * drive.dratio * drive.dz**2


def sign(velocity: ca.SX, width: float) -> ca.SX:
    """Direction of motion: the exact sign for ``width`` = 0, else ``tanh(velocity / width)``.

    Parameters
    ----------
    velocity : SX
    width : float
        Velocity over which the sign turns [rad/s or m/s].
    """
    return ca.sign(velocity) if width == 0.0 else ca.tanh(velocity / width)


def drive_columns(
    drives: tuple[DriveMotion, ...], terms: Terms, sign_width: float = 0.0
) -> tuple[tuple[Column, ...], ca.SX]:
    """Columns of the drives as joint torques: rotors first, then Coulomb, viscous and offset friction.

    Parameters
    ----------
    drives : tuple of DriveMotion
    terms : Terms
        Which columns are wanted.
    sign_width : float
        See `sign`; zero for the exact Coulomb friction of [KD96] eq. (1).

    Returns
    -------
    columns : tuple of Column
    torques : SX, shape (n, len(columns))
        ``tau_q = torques @ parameters``.
    """
    columns: list[Column] = []
    torques: list[ca.SX] = []
    force, rate, inertia = ("Nm", "Nm s/rad", "kg m^2")
    if terms.rotor:
        for d in (d for d in drives if d.has_rotor):
            columns.append(Column(f"Ia{d.label}", inertia, "rotor"))
            torques.append(d.row.T * rotor_torque(d))
    friction: tuple[tuple[bool, str, str, Callable[[DriveMotion], ca.SX]], ...] = (
        (terms.coulomb, "c", force, lambda d: sign(d.dz, sign_width)),
        (terms.viscous, "v", rate, lambda d: d.dz),
        (terms.offset, "o", force, lambda d: ca.SX(1)),
    )
    for wanted, suffix, unit, function in friction:
        for d in drives if wanted else ():
            columns.append(Column(f"F{d.label}{suffix}", _linear(unit) if d.linear else unit, "friction"))
            torques.append(d.row.T * function(d))
    return tuple(columns), ca.horzcat(ca.SX(drives[0].row.numel() if drives else 0, 0), *torques)


def _linear(unit: str) -> str:
    return {"Nm": "N", "Nm s/rad": "N s/m"}[unit]
