"""Columns of the drives: rotor inertia and friction, on drive coordinates z = C q + z0, as joint torques.

A drive torque tau_z reaches the joints as ``tau_q = C' tau_z``, so each drive's column is its own torque per unit
parameter times its row of C.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from regressors.robot.columns import (
    ASYMMETRY,
    COULOMB,
    FRICTION_KINDS,
    LOAD_SHARE,
    OFFSET,
    ROOT,
    ROTOR,
    STRIBECK,
    VISCOUS,
    Column,
    Terms,
    drive_column,
)
from regressors.robot.robot import Robot, drive_numbers, linear_drives, transmission_of
from regressors.robot.symbolic.kinematics import sparse
from regressors.samples import Array


@dataclass(frozen=True)
class DriveMotion:
    """One drive's coordinate and its derivatives, with its row of C."""

    number: int  # number of the drive, the owner of its columns
    z: ca.SX  # drive coordinate [rad or m] and its derivatives
    dz: ca.SX
    ddz: ca.SX
    row: ca.SX  # (1, n) row of the coupling C
    ratio: ca.SX  # gear ratio F'(z)
    dratio: ca.SX  # derivative F''(z) of the gear ratio
    has_rotor: bool  # True if the rotor's inertia is a parameter
    linear: bool  # True if the drive moves a prismatic joint; units follow


def drive_motions(robot: Robot, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> tuple[DriveMotion, ...]:
    """Motion of every drive whose joint moves; one per joint where the robot has no transmission."""
    # q, dq, ddq (n, 1)
    transmission, motions = transmission_of(robot), []
    drives = zip(drive_numbers(robot), transmission.drives, linear_drives(robot), strict=True)
    for k, (number, drive, linear) in enumerate(drives):
        if drive.rests:
            continue
        row = sparse(transmission.coupling[k : k + 1])
        symbol = ca.SX.sym("z")
        ratio = drive.ratio.ratio(symbol)
        dratio = ca.gradient(ratio, symbol)
        z = ca.mtimes(row, q) + transmission.offset[k]
        ratio, dratio = (ca.substitute(e, symbol, z) for e in (ratio, dratio))
        rates = ca.mtimes(row, dq), ca.mtimes(row, ddq)
        has_rotor = drive.rotor_inertia is not None
        motions.append(DriveMotion(number, z, *rates, row, ratio, ca.sparsify(dratio), has_rotor, linear))
    return tuple(motions)


def rotor_torque(drive: DriveMotion) -> ca.SX:
    """Torque at the drive per unit rotor inertia, ``F'^2 ddz + F' F'' dz^2``, by Lagrange's equation [1/s^2]."""
    return drive.ratio**2 * drive.ddz + drive.ratio * drive.dratio * drive.dz**2


def sign(velocity: ca.SX, width: float) -> ca.SX:
    """Direction of motion: the exact sign for ``width`` = 0, else ``tanh(velocity / width)``."""
    return ca.sign(velocity) if width == 0.0 else ca.tanh(velocity / width)


SMALLEST_SPEED = 1e-30  # speed that keeps the root's slope finite at standstill; friction there is zero in all digits


def friction_magnitude(kind: str, drive: DriveMotion, terms: Terms, carried: ca.SX | None = None) -> ca.SX:
    """Friction against the direction of motion per unit parameter: 1, ``|tau|``, ``sqrt|dz|`` or ``exp(-(dz/v)^2)``."""
    if kind == COULOMB:
        return ca.SX(1)
    if kind == ROOT:
        return ca.sqrt(ca.fabs(drive.dz) + SMALLEST_SPEED)
    if kind == STRIBECK:
        return ca.exp(-((drive.dz / terms.stribeck_speed) ** 2))
    assert kind == LOAD_SHARE
    assert carried is not None
    return ca.fabs(carried)


_UNDIRECTED: dict[str, Callable[[DriveMotion], ca.SX]] = {
    VISCOUS: lambda d: d.dz,
    OFFSET: lambda d: ca.SX(1),
    ASYMMETRY: lambda d: ca.fabs(d.dz),
}


def friction_terms(drives: tuple[DriveMotion, ...], terms: Terms) -> tuple[tuple[str, DriveMotion], ...]:
    """Kind and drive of every friction column, in the order of the columns: by kind, then by drive."""
    return tuple((kind, d) for kind in FRICTION_KINDS for d in drives if terms.include(kind, d.number))


def friction_torque(
    kind: str, drive: DriveMotion, terms: Terms, sign_width: float = 0.0, carried: ca.SX | None = None
) -> ca.SX:
    """Friction torque at the drive coordinate per unit parameter, see `Terms`."""
    if kind in _UNDIRECTED:
        return _UNDIRECTED[kind](drive)
    return friction_magnitude(kind, drive, terms, carried) * sign(drive.dz, sign_width)


def drive_columns(drives: tuple[DriveMotion, ...], terms: Terms, sign_width: float, loads: dict[int, ca.SX]) -> ca.SX:
    """Joint torques of the columns of `column_list`."""  # result (n, len(columns))
    torques = [d.row.T * rotor_torque(d) for d in drives if d.has_rotor and terms.rotor]
    for kind, d in friction_terms(drives, terms):
        torques.append(d.row.T * friction_torque(kind, d, terms, sign_width, loads.get(d.number)))
    return ca.horzcat(ca.SX(drives[0].row.numel() if drives else 0, 0), *torques)


def column_list(drives: tuple[DriveMotion, ...], terms: Terms) -> tuple[Column, ...]:
    """Columns of the drives: rotors first, then friction by kind."""
    rotors = (drive_column(d.number, ROTOR) for d in drives if d.has_rotor and terms.rotor)
    return (*rotors, *(drive_column(d.number, kind, linear=d.linear) for kind, d in friction_terms(drives, terms)))


@dataclass(frozen=True)
class Reflection:
    """How a rotor inertia ``Ia`` becomes ``Iar = n^2 Ia``, the parameter at the drive coordinate."""

    ratio: float  # n, the gear's reference ratio, see `regressors.robot.gears.GearFunction.reference_ratio`
    linear: bool  # True if the drive moves a prismatic joint

    def column(self, rotor: Column) -> Column:
        """Column of the reflected inertia; the rotor's own where the ratio is 1."""
        if self.ratio == 1.0 or rotor.owner is None:
            return rotor
        return Column(f"Iar{rotor.owner}", "kg" if self.linear else "kg m^2", ROTOR, rotor.owner)


def reflections(robot: Robot) -> dict[int, Reflection]:
    """Reflection of every drive's rotor inertia, by the number that its columns have as owner."""
    ratios = (drive.ratio.reference_ratio for drive in transmission_of(robot).drives)
    return dict(zip(drive_numbers(robot), map(Reflection, ratios, linear_drives(robot)), strict=True))


def drive_rows(robot: Robot) -> dict[int, Array]:
    """Row of C of every drive, moving or locked, by the drive's number, the owner of its columns."""
    return dict(zip(drive_numbers(robot), transmission_of(robot).coupling, strict=True))
