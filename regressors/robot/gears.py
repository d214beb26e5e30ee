"""Gear functions: the motor angle phi = F(z) of a drive coordinate z, through the ratio F'(z).

The ratio alone enters the equations of motion: the rotor turns with ``F'(z) dz``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import casadi as ca
import numpy as np

from regressors.errors import InputError
from regressors.robot.inertia import Array


class GearFunction(ABC):
    """Motor angle per drive coordinate."""

    @abstractmethod
    def ratio(self, z: ca.SX) -> ca.SX:
        """``F'(z)``, motor radians per unit of z, as an expression of the drive coordinate [rad or m]."""

    def coordinate(self, phi: Array) -> Array:
        """Drive coordinate at a motor angle, ``z`` with ``int_0^z F'(s) ds = phi`` [rad or m]."""
        raise InputError(f"{type(self).__name__} does not say which drive coordinate belongs to a motor angle")

    @property
    def reference_ratio(self) -> float:
        """Size n of the ratio at which a rotor inertia is reflected to the drive coordinate, ``n^2 Ia``; 1 leaves it.

        It belongs to the gear alone, never to limits, since parameters must mean the same in every task.
        """
        return 1.0


@dataclass(frozen=True)
class ConstantRatio(GearFunction):
    """A gear whose ratio does not change."""

    value: float = 1.0  # motor radians per unit of the drive coordinate; the sign says which way the motor turns

    def __post_init__(self) -> None:
        if not np.isfinite(self.value) or self.value == 0.0:
            raise InputError(f"gear ratio must be a finite number other than zero, given {self.value}")

    def ratio(self, z: ca.SX) -> ca.SX:
        """The constant itself."""
        return ca.SX(self.value)

    def coordinate(self, phi: Array) -> Array:
        """``phi / F'``."""
        return np.asarray(phi / self.value)

    @property
    def reference_ratio(self) -> float:
        """The constant's size."""
        return abs(self.value)


@dataclass(frozen=True)
class BallScrew(GearFunction):
    """A ball screw between two pivots, which turns the lever that its nut pulls [KD96] (F2', F3' of section 5.1).

    The screw's length follows the law of cosines, ``L(z)^2 = square + cosine cos z + sine sin z``, and the motor
    turns ``F(z) = (2 pi / pitch) L(z)``.
    """

    pitch: float  # advance of the nut per turn [m]
    square: float  # coefficients of the squared length [m^2]
    cosine: float
    sine: float

    def __post_init__(self) -> None:
        swing = float(np.hypot(self.cosine, self.sine))
        if not self.pitch > 0:
            raise InputError(f"ball screw: pitch must be greater than zero, given {self.pitch:g}")
        if not self.square > swing > 0:
            raise InputError(f"ball screw: no triangle has squared length {self.square:g} +- {swing:g} m^2")

    def ratio(self, z: ca.SX) -> ca.SX:
        """``(2 pi / pitch) (sine cos z - cosine sin z) / (2 L(z))``."""
        length = ca.sqrt(self.square + self.cosine * ca.cos(z) + self.sine * ca.sin(z))
        return (2 * np.pi / self.pitch) * (self.sine * ca.cos(z) - self.cosine * ca.sin(z)) / (2 * length)

    def coordinate(self, phi: Array) -> Array:
        """``z`` with ``L(z) = L(0) + pitch phi / (2 pi)``, on the branch of z = 0 [rad]."""
        swing, middle = np.hypot(self.cosine, self.sine), np.arctan2(self.sine, self.cosine)
        length = np.sqrt(self.square + self.cosine) + self.pitch * phi / (2 * np.pi)
        level = (length**2 - self.square) / swing  # cos(z - middle)
        if np.any(np.abs(level) > 1):
            far = float(np.abs(phi).max())
            raise InputError(
                f"ball screw: no drive coordinate has the motor angle {far:.4g} rad; check its zero and unit"
            )
        return np.asarray(middle - np.sign(middle) * np.arccos(level))

    @property
    def reference_ratio(self) -> float:
        """Largest ratio, ``(2 pi / pitch) lever``, which the gear has where screw and lever are at a right angle.

        The lever is the shorter side of the triangle, ``square = a^2 + b^2`` and ``swing = 2 a b``.
        """
        swing = float(np.hypot(self.cosine, self.sine))
        lever = (np.sqrt(self.square + swing) - np.sqrt(self.square - swing)) / 2
        return float(2 * np.pi / self.pitch * lever)
