"""Friction of a robot's drives in their torque limits: a viscous part, and bounds of the remainder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from constraints.friction.friction_bounds import FrictionBound, friction_bound
from regressors.errors import InputError
from regressors.friction.curves import FrictionCurve, FrictionCurves
from regressors.models.columns import COULOMB, VISCOUS
from regressors.models.drives import drive_column
from regressors.models.partial import PartialMotion
from regressors.robot.robot import Robot
from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class DriveFriction:
    """Friction of d drives, or of joints."""

    viscous: dict[str, float]  # viscous friction by the names of the parameters, ``F1v`` ... [Nm s/rad or N s/m]
    rest: Array  # (d, 2) lower and upper bound of the remaining friction [Nm or N]
    share: Array  # (d,) fraction of the carried torque by which friction may be larger in either direction
    largest: Array  # (d,) largest magnitude of the friction without load [Nm or N]

    def at_joints(self, robot: Robot) -> DriveFriction:
        """The same friction at the joints, through the robot's coupling."""
        if robot.transmission is None:
            return self
        if np.any(self.share > 0) and np.any(np.isfinite(robot.limits.torque)):
            raise InputError(
                f"robot {robot.name!r}: friction grows with the load of its drives, so "
                "it cannot be computed per joint, "
                "and torque limits of joints cannot be imposed; give torque limits of drives"
            )
        C = robot.transmission.coupling
        ahead, behind = np.maximum(C, 0.0).T, np.minimum(C, 0.0).T
        rest = ahead @ self.rest + behind @ self.rest[:, ::-1]
        return DriveFriction(self.viscous, rest, np.zeros(robot.n), np.abs(C).T @ self.largest)


def drive_friction(
    robot: Robot, known: Mapping[str, float], motion: PartialMotion, curves: FrictionCurves | None = None
) -> DriveFriction:
    """Friction of every drive; only the viscous part where a drive does not move or its friction is unknown."""
    curves = FrictionCurves({}) if curves is None else curves
    curves.check(robot)
    transmission = robot.transmission
    names = robot.joint_names if transmission is None else [drive.name for drive in transmission.drives]
    numbers = robot.link_numbers if transmission is None else range(1, len(names) + 1)
    turning = np.any(np.abs(_coupling(robot) @ motion.matrix) > 1e-12, axis=1)
    fastest = [_fastest(robot, k) for k in range(len(names))]
    bounds = []
    for k, (number, name) in enumerate(zip(numbers, names, strict=True)):
        curve, viscous = curves.curve(name), known.get(drive_column(number, VISCOUS).name, 0.0)
        if not turning[k]:
            bounds.append(FrictionBound(viscous, 0.0, 0.0))
        elif curve is None:
            coulomb = known.get(drive_column(number, COULOMB).name, 0.0)
            bounds.append(FrictionBound(viscous, -coulomb, coulomb))
        else:
            bounds.append(_bound(curve, name, fastest[k]))
    return DriveFriction(
        {drive_column(number, VISCOUS).name: bound.viscous for number, bound in zip(numbers, bounds, strict=True)},
        np.array([(bound.lower, bound.upper) for bound in bounds]).reshape(-1, 2),
        np.array([bound.share for bound in bounds]),
        np.array([_largest(bound, speed) for bound, speed in zip(bounds, fastest, strict=True)]),
    )


def _bound(curve: FrictionCurve, name: str, fastest: float) -> FrictionBound:
    try:
        return friction_bound(curve, fastest)
    except InputError as error:
        raise InputError(f"torque limits: friction curve of {name}: {error}") from error


def _largest(bound: FrictionBound, fastest: float) -> float:
    viscous = abs(bound.viscous) * fastest if bound.viscous != 0.0 else 0.0
    return viscous + max(abs(bound.lower), abs(bound.upper))


def _fastest(robot: Robot, k: int) -> float:
    """Largest speed of a drive within the velocity limits of the joints and its own [rad/s or m/s]."""
    row = np.abs(_coupling(robot)[k])
    joints = float(row[row > 0] @ robot.limits.velocity[row > 0])
    return joints if robot.transmission is None else min(joints, float(robot.transmission.limits.velocity[k]))


def _coupling(robot: Robot) -> Array:
    return np.eye(robot.n) if robot.transmission is None else robot.transmission.coupling
