"""Friction of one drive from measured pairs of speed and torque, or from any function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from regressors.errors import InputError
from regressors.robot.friction.curve import FrictionCurve, by_direction, directed
from regressors.samples import Array

_FUNCTION_POINTS = 201
_BESIDE_ZERO = 1e-12  # rad/s or m/s


@dataclass(frozen=True, eq=False)
class TableFriction(FrictionCurve):
    """Measured pairs of speed and torque, linear in between, constant beyond the ends.

    Speeds of one sign apply to both directions, ``f(-dz) = -f(dz)``. Between the slowest speeds on the two sides of
    zero the torque is that of the slowest speed on either side, and jumps at zero.
    """

    speed: Array  # (K,) strictly increasing, none of them zero [rad/s or m/s]; all positive, or of both signs
    friction: Array  # (K,) friction torque at these speeds [Nm or N]

    def __post_init__(self) -> None:
        speed, friction = (np.array(x, dtype=float).reshape(-1) for x in (self.speed, self.friction))
        if speed.size == 0 or speed.shape != friction.shape:
            raise InputError(f"friction table: {speed.size} speeds and {friction.size} torques; expected pairs")
        if not (np.all(np.isfinite(speed)) and np.all(np.isfinite(friction))):
            raise InputError("friction table: speeds and torques must be finite numbers")
        if not np.all(np.diff(speed) > 0):
            k = int(np.argmin(np.diff(speed) > 0))
            raise InputError(f"friction table: speeds must increase, given {speed[k]:g} before {speed[k + 1]:g}")
        if np.any(speed == 0.0):
            raise InputError("friction table: friction is not unique at speed zero; leave that row out")
        if speed[-1] < 0:
            raise InputError("friction table: all speeds are negative; give positive ones, or both signs")
        for name, array in (("speed", speed), ("friction", friction)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @property
    def sides(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Speeds and torques as positive numbers, for positive and for negative velocity."""
        ahead = self.speed > 0
        forward = (self.speed[ahead], self.friction[ahead])
        if np.all(ahead):
            return forward, forward
        return forward, (-self.speed[~ahead][::-1], -self.friction[~ahead][::-1])

    def torque(self, dz: ArrayLike, direction: ArrayLike | None = None) -> Array:
        """The table's value at each velocity, ``(1 + s) / 2 f(|dz|) + (1 - s) / 2 f(-|dz|)``."""
        v, s = directed(dz, direction)
        return np.asarray(by_direction(s, *(np.interp(np.abs(v), *side) for side in self.sides)))

    def expression(self, dz: ca.SX, direction: ca.SX) -> ca.SX:
        """The table's value, as in `torque`."""
        return by_direction(direction, *(_interpolated(ca.fabs(dz), *side) for side in self.sides))

    def extrapolated(self, dz: ArrayLike) -> int:
        """Number of velocities beyond the fastest ones of the table, for which its last value is used."""
        v = np.asarray(dz, dtype=float)
        (ahead, _), (behind, _) = self.sides
        return int(np.count_nonzero((v > ahead[-1]) | (v < -behind[-1])))


def _interpolated(speed: ca.SX, at: Array, values: Array) -> ca.SX:
    """Linear interpolation as a sum of clipped ramps."""
    total = ca.SX(float(values[0]))
    for k, slope in enumerate(np.diff(values) / np.diff(at)):
        total += float(slope) * (ca.fmin(ca.fmax(speed, float(at[k])), float(at[k + 1])) - float(at[k]))
    return total


@dataclass(frozen=True, eq=False)
class FunctionFriction(FrictionCurve):
    """Friction given by any function of the velocity."""

    function: Callable[[Array], Array]  # returns torques [Nm or N] for an array of velocities [rad/s or m/s]
    # speed up to which the function is tabulated where an expression is needed [rad/s or m/s]
    fastest: float | None = None

    def torque(self, dz: ArrayLike, direction: ArrayLike | None = None) -> Array:
        """Values of the function; with a direction, ``(1 + s) / 2 f(|dz|) + (1 - s) / 2 f(-|dz|)``.

        At rest the function is then evaluated just beside zero.
        """
        v = np.asarray(dz, dtype=float)
        if direction is None:
            return self._values(v)
        speed, s = np.maximum(np.abs(v), _BESIDE_ZERO), np.asarray(direction, dtype=float)
        return np.asarray((1 + s) / 2 * self._values(speed) + (1 - s) / 2 * self._values(-speed))

    def _values(self, v: Array) -> Array:
        values = np.asarray(self.function(v), dtype=float)
        if values.shape != v.shape:
            raise InputError(
                f"friction function: given velocities of shape {v.shape}, it returned shape {values.shape}"
            )
        return values

    def table(self) -> TableFriction:
        """The function at speeds up to the fastest one, closer together about zero."""
        if self.fastest is None or not (np.isfinite(self.fastest) and self.fastest > 0):
            raise InputError(f"friction function: a table of it needs its fastest speed, given {self.fastest}")
        speed = self.fastest * np.linspace(0.0, 1.0, _FUNCTION_POINTS)[1:] ** 2
        speed = np.concatenate([-speed[::-1], speed])
        return TableFriction(speed, self.torque(speed))

    def expression(self, dz: ca.SX, direction: ca.SX) -> ca.SX:
        """Expression of the `table`."""
        return self.table().expression(dz, direction)
