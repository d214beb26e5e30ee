"""Friction of the drives in limits of torques, with its bounds over states."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import singledispatch

import numpy as np

from regressors.errors import InputError, about
from regressors.models.partial import PartialMotion
from regressors.robot.columns import COULOMB, VISCOUS, drive_column
from regressors.robot.friction.curve import CoulombViscous, FrictionCurve, Scaled, Stribeck, TableFriction
from regressors.robot.friction.curves import FrictionCurves, Side
from regressors.robot.friction.load_and_temperature import Loaded, Warm
from regressors.robot.robot import Robot, drive_numbers, transmission_of
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
        # of the drives that move a joint: others may have no largest speed, and no largest friction
        largest = np.array([np.abs(row[row != 0.0]) @ self.largest[row != 0.0] for row in C.T])
        return DriveFriction(self.viscous, rest, np.zeros(robot.n), largest)


def drive_friction(
    robot: Robot, known: Mapping[str, float], motion: PartialMotion, curves: FrictionCurves | None = None
) -> DriveFriction:
    """Friction of every drive; only the viscous part where a drive does not move or its friction is unknown."""
    curves = FrictionCurves({}) if curves is None else curves
    curves.check(robot)
    transmission, numbers = transmission_of(robot), drive_numbers(robot)
    names = [drive.name for drive in transmission.drives]
    turning = np.any(np.abs(transmission.coupling @ motion.matrix) > 1e-12, axis=1)
    # within the velocity limits of the joints and the drives' own [rad/s or m/s]
    joints = (row[row > 0] @ robot.limits.velocity[row > 0] for row in np.abs(transmission.coupling))
    fastest = [min(float(x), y) for x, y in zip(joints, transmission.limits.velocity.tolist(), strict=True)]
    bounds = []
    for k, (number, name) in enumerate(zip(numbers, names, strict=True)):
        curve, viscous = curves.curve(name), known.get(drive_column(number, VISCOUS).name, 0.0)
        if not turning[k]:
            bounds.append(FrictionBound(viscous, 0.0, 0.0))
        elif curve is None:
            coulomb = known.get(drive_column(number, COULOMB).name, 0.0)
            bounds.append(FrictionBound(viscous, -coulomb, coulomb))
        else:
            with about(f"torque limits: friction curve of {name}"):
                bounds.append(friction_bound(curve, fastest[k]))
    return DriveFriction(
        {drive_column(number, VISCOUS).name: bound.viscous for number, bound in zip(numbers, bounds, strict=True)},
        np.array([(bound.lower, bound.upper) for bound in bounds]).reshape(-1, 2),
        np.array([bound.share for bound in bounds]),
        np.array([_largest(bound, speed) for bound, speed in zip(bounds, fastest, strict=True)]),
    )


def _largest(bound: FrictionBound, fastest: float) -> float:
    viscous = abs(bound.viscous) * fastest if bound.viscous != 0.0 else 0.0
    return viscous + max(abs(bound.lower), abs(bound.upper))


@dataclass(frozen=True)
class FrictionBound:
    """``lower <= f(v) - viscous v <= upper`` at every speed up to a limit, in both directions and at rest."""

    viscous: float  # viscous coefficient, which is taken as exact [Nm s/rad or N s/m]
    lower: float  # bounds of the rest [Nm or N]
    upper: float
    share: float = 0.0  # fraction of the carried torque by which friction may be larger in either direction


@singledispatch
def friction_bound(curve: FrictionCurve, fastest: float) -> FrictionBound:
    """Viscous part of a friction curve, and bounds of the rest at speeds ``|v| <= fastest``.

    Coulomb-viscous and Stribeck curves are bounded for any direction of friction between -1 and 1: at each speed, in
    both directions, and also during presliding. The bounds are those of the falling part, ``max(Fs, Fc + (Fs - Fc)
    exp(-(fastest / vs)^delta))`` of each side, and of the difference of viscous friction between the directions, each
    at its worst by itself: safe, but not the tightest. Tables are bounded with the sign of the velocity, and at rest
    between both directions. Friction that is linear in temperature is bounded at all temperatures at which it was
    measured, or at its reference temperature where these are not known.
    """
    kind = type(curve).__name__
    raise InputError(
        f"a friction curve of type {kind} has no known bound between the speeds that are tried; give a table"
    )


@friction_bound.register
def _(curve: CoulombViscous, fastest: float) -> FrictionBound:
    return FrictionBound(curve.viscous, curve.offset - curve.coulomb, curve.offset + curve.coulomb)


@friction_bound.register
def _(curve: Stribeck, fastest: float) -> FrictionBound:
    viscous = 0.5 * (curve.forward.viscous + curve.backward.viscous)
    differs = 0.5 * (curve.forward.viscous - curve.backward.viscous)  # f - viscous v holds differs |v|
    if differs != 0.0 and not np.isfinite(fastest):
        raise InputError("viscous friction that differs between the directions has no bound without a velocity limit")
    extra = 0.0 if differs == 0.0 else differs * fastest
    return FrictionBound(
        viscous,
        curve.offset - _largest_in_direction(curve.backward, fastest) + min(extra, 0.0),
        curve.offset + _largest_in_direction(curve.forward, fastest) + max(extra, 0.0),
    )


def _largest_in_direction(side: Side, fastest: float) -> float:
    """Largest friction in one direction without its viscous part; it is monotonic in speed, beginning at Fs."""
    assert side.stiction is not None
    return max(side.stiction, side.coulomb + side.drop * float(np.exp(-((fastest / side.stribeck) ** side.exponent))))


@friction_bound.register
def _(curve: TableFriction, fastest: float) -> FrictionBound:
    return _of_corners(curve, curve.torque, fastest)


def _of_corners(table: TableFriction, torque: Callable[[Array, Array], Array], fastest: float) -> FrictionBound:
    """Bound of friction that is linear in speed between a table's corners, from its torques at them."""
    last = [fastest] if np.isfinite(fastest) else []
    ahead, behind = (np.concatenate([[0.0], speed[speed < fastest], last]) for speed, _ in table.sides)
    speed, sign = np.concatenate([ahead, -behind]), np.repeat([1.0, -1.0], [ahead.size, behind.size])
    friction = torque(speed, sign)
    viscous = 0.0
    if last:  # by least squares; any value gives valid bounds of the rest, this one gives tight ones
        columns = np.column_stack([speed, sign, np.ones_like(speed)])
        viscous = float(np.linalg.lstsq(columns, friction, rcond=None)[0][0])
    rest = friction - viscous * speed
    return FrictionBound(viscous, float(rest.min()), float(rest.max()))


@friction_bound.register
def _(curve: Scaled, fastest: float) -> FrictionBound:
    bound = friction_bound(curve.curve, fastest)
    least, most = sorted((curve.factor * bound.lower, curve.factor * bound.upper))
    return FrictionBound(curve.factor * bound.viscous, least, most, abs(curve.factor) * bound.share)


@friction_bound.register
def _(curve: Loaded, fastest: float) -> FrictionBound:
    return replace(friction_bound(curve.curve, fastest), share=max(curve.shares))


@friction_bound.register
def _(curve: Warm, fastest: float) -> FrictionBound:
    ends = curve.range or (curve.reference, curve.reference)
    cold, warm = (_at(curve, temperature, fastest) for temperature in ends)  # linear in between
    viscous = 0.5 * (cold.viscous + warm.viscous)
    differs = 0.5 * abs(cold.viscous - warm.viscous)
    if differs > 0.0 and not np.isfinite(fastest):
        raise InputError("viscous friction that depends on temperature has no bound without a velocity limit")
    extra = 0.0 if differs == 0.0 else differs * fastest
    return FrictionBound(viscous, min(cold.lower, warm.lower) - extra, max(cold.upper, warm.upper) + extra)


def _at(curve: Warm, temperature: float, fastest: float) -> FrictionBound:
    table = curve.curve
    if not isinstance(table, TableFriction):
        return friction_bound(curve.at(temperature), fastest)
    if not np.isfinite(fastest):
        raise InputError("a table of friction that depends on temperature has no bound without a velocity limit")
    return _of_corners(table, lambda v, s: curve.torque_at(v, temperature, s), fastest)
