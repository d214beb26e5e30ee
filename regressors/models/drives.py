"""Columns of the drives: rotor inertia and friction, on drive coordinates z = C q + z0, as joint torques.

A drive torque tau_z reaches the joints as ``tau_q = C' tau_z``, so each drive's column is its own torque per unit
parameter times its row of C.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from regressors.models.columns import COULOMB, OFFSET, ROTOR, VISCOUS, Column, Drives, Terms, includes
from regressors.robot.robot import Robot
from regressors.samples import Array
from regressors.symbolic.kinematics import sparse


@dataclass(frozen=True)
class DriveMotion:
    """One drive's coordinate and its derivatives, with its row of C.

    Parameters
    ----------
    number : int
        Number of the drive, the owner of its columns.
    z, dz, ddz : SX, scalar
        Drive coordinate [rad or m] and its derivatives.
    row : SX, shape (1, n)
        Row of the coupling C.
    ratio : SX, scalar
        Gear ratio F'(z).
    dratio : SX, scalar
        Derivative F''(z) of the gear ratio.
    has_rotor : bool
        True if the rotor's inertia is a parameter.
    linear : bool
        True if the drive moves a prismatic joint; units follow.
    """

    number: int
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
            DriveMotion(number, q[k], dq[k], ddq[k], eye[k, :], ca.SX(1), zero, False, linear[k])
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
                number=k + 1,
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
        Velocity over which the sign changes [rad/s or m/s].
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
        Columns to include.
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
    if terms.rotor:
        for d in (d for d in drives if d.has_rotor):
            columns.append(drive_column(d.number, ROTOR))
            torques.append(d.row.T * rotor_torque(d))
    friction: tuple[tuple[Drives, str, Callable[[DriveMotion], ca.SX]], ...] = (
        (terms.coulomb, COULOMB, lambda d: sign(d.dz, sign_width)),
        (terms.viscous, VISCOUS, lambda d: d.dz),
        (terms.offset, OFFSET, lambda d: ca.SX(1)),
    )
    for wanted, kind, function in friction:
        for d in (d for d in drives if includes(wanted, d.number)):
            columns.append(drive_column(d.number, kind, linear=d.linear))
            torques.append(d.row.T * function(d))
    return tuple(columns), ca.horzcat(ca.SX(drives[0].row.numel() if drives else 0, 0), *torques)


_DRIVE_COLUMNS = {
    ROTOR: ("Ia{}", "kg m^2", "kg m^2"),  # the motor rotates also where the joint is prismatic
    COULOMB: ("F{}c", "Nm", "N"),
    VISCOUS: ("F{}v", "Nm s/rad", "N s/m"),
    OFFSET: ("F{}o", "Nm", "N"),
}


def drive_column(number: int, kind: str, *, linear: bool = False) -> Column:
    """Column of a drive.

    Parameters
    ----------
    number : int
    kind : {"rotor", "coulomb", "viscous", "offset"}
    linear : bool
        True if the drive moves a prismatic joint.
    """
    name, *units = _DRIVE_COLUMNS[kind]
    return Column(name.format(number), units[linear], kind, number)


@dataclass(frozen=True)
class Reflection:
    """How a rotor inertia ``Ia`` becomes ``Iar = n^2 Ia``, the parameter at the drive coordinate.

    Parameters
    ----------
    ratio : float
        n, the gear's reference ratio, see `regressors.robot.gears.GearFunction.reference_ratio`.
    linear : bool
        True if the drive moves a prismatic joint.
    """

    ratio: float
    linear: bool

    def column(self, rotor: Column) -> Column:
        """Column of the reflected inertia; the rotor's own where the ratio is 1."""
        if self.ratio == 1.0 or rotor.owner is None:
            return rotor
        return Column(f"Iar{rotor.owner}", "kg" if self.linear else "kg m^2", ROTOR, rotor.owner)


def reflections(robot: Robot) -> dict[int, Reflection]:
    """Reflection of every drive's rotor inertia, by the number that its columns have as owner.

    Parameters
    ----------
    robot : Robot
    """
    if robot.transmission is None:
        return {number: Reflection(1.0, False) for number in robot.link_numbers}
    prismatic = np.array([joint.kind == "prismatic" for joint in robot.joints])
    rows = zip(robot.transmission.drives, robot.transmission.coupling, strict=True)
    return {
        number: Reflection(drive.ratio.reference_ratio, bool(np.any(row[prismatic])))
        for number, (drive, row) in enumerate(rows, 1)
    }


def drive_rows(robot: Robot) -> dict[int, Array]:
    """Row of C of every drive, moving or locked, by the drive's number, the owner of its columns.

    Parameters
    ----------
    robot : Robot

    Returns
    -------
    dict of int to ndarray, shape (n,)
        Unit vectors where the robot has no transmission.
    """
    if robot.transmission is None:
        return dict(zip(robot.link_numbers, np.eye(robot.n), strict=True))
    return dict(enumerate(robot.transmission.coupling, 1))
