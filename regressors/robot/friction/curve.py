"""Friction of one drive as a curve of its velocity: Coulomb and viscous friction, and Tustin's model.

Each curve can be evaluated numerically, or as a CasADi expression for simulation. The direction of friction is the sign
of the velocity, or a number between -1 and 1 where the sign changes smoothly or follows the last motion (presliding).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar, TypeVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from regressors.errors import InputError
from regressors.samples import Array

Directed = TypeVar("Directed", Array, ca.SX)


class FrictionCurve(ABC):
    """Friction of one drive as a function of its velocity."""

    # nesting order of curves that wrap others: 0 for a plain curve, then, outwards, `Warm`, `Scaled`, `Loaded`
    layer: ClassVar[int] = 0

    @abstractmethod
    def torque(self, dz: ArrayLike, direction: ArrayLike | None = None) -> Array:
        """Friction torque."""

    @abstractmethod
    def expression(self, dz: ca.SX, direction: ca.SX) -> ca.SX:
        """Friction torque."""

    def torque_at(self, dz: ArrayLike, temperature: ArrayLike, direction: ArrayLike | None = None) -> Array:
        """Friction torque at a temperature, which curves that do not depend on it ignore."""
        return self.torque(dz, direction)

    def at(self, temperature: float | None) -> FrictionCurve:
        """The curve at one temperature; the curve itself where friction does not depend on temperature."""
        return self


def by_direction(s: Directed, ahead: Directed | float, behind: Directed | float) -> Directed:
    """Friction of direction s between that forwards and that backwards, both positive against the motion."""
    return (1 + s) / 2 * ahead - (1 - s) / 2 * behind


@dataclass(frozen=True)
class CoulombViscous(FrictionCurve):
    """``f = Fc sign(dz) + Fv dz + Fo`` [KD96] eq. (1)."""

    coulomb: float = 0.0  # [Nm, Nm s/rad, Nm, or with N and m]
    viscous: float = 0.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        _check_finite(self, ("coulomb", "viscous", "offset"))
        _check_not_negative(self, ("coulomb",))

    def torque(self, dz: ArrayLike, direction: ArrayLike | None = None) -> Array:
        """``Fc s + Fv dz + Fo``."""
        v, s = directed(dz, direction)
        return np.asarray(self.coulomb * s + self.viscous * v + self.offset)

    def expression(self, dz: ca.SX, direction: ca.SX) -> ca.SX:
        """``Fc s + Fv dz + Fo``."""
        return self.coulomb * direction + self.viscous * dz + self.offset


@dataclass(frozen=True)
class Side:
    """Friction in one direction, ``Fc + (Fs - Fc) exp(-(v / vs)^delta) + Fv v`` at speed v >= 0 [Tustin 1947].

    Parameters
    ----------
    coulomb, viscous : float
        [Nm, Nm s/rad, or with N and m]
    stiction : float, optional
        Break-away torque Fs [Nm]; equal to the Coulomb friction if not given.
    stribeck : float
        Speed vs over which friction falls from Fs to Fc, > 0 [rad/s or m/s].
    exponent : float
        delta, > 0; 1 in Tustin's model, 2 the usual choice since.
    """

    coulomb: float
    viscous: float = 0.0
    stiction: float | None = None
    stribeck: float = 0.05
    exponent: float = 2.0

    def __post_init__(self) -> None:
        if self.stiction is None:
            object.__setattr__(self, "stiction", self.coulomb)
        _check_finite(self, ("coulomb", "viscous", "stiction", "stribeck", "exponent"))
        _check_not_negative(self, ("coulomb", "stiction"))
        for name in ("stribeck", "exponent"):
            if not getattr(self, name) > 0:
                raise InputError(f"friction: {name} must be greater than zero, given {getattr(self, name):g}")

    @property
    def drop(self) -> float:
        """``Fs - Fc`` [Nm]."""
        assert self.stiction is not None
        return self.stiction - self.coulomb


@dataclass(frozen=True)
class Stribeck(FrictionCurve):
    """``f = [Fc + (Fs - Fc) exp(-|dz / vs|^delta)] sign(dz) + Fv dz + Fo``, each direction its own [Tustin 1947]."""

    forward: Side  # for positive velocity
    backward: Side = field(default=None)  # type: ignore[assignment]
    offset: float = 0.0  # fo [Nm or N]

    def __post_init__(self) -> None:
        if self.backward is None:
            object.__setattr__(self, "backward", self.forward)
        _check_finite(self, ("offset",))

    def torque(self, dz: ArrayLike, direction: ArrayLike | None = None) -> Array:
        """The equation of the class; viscous friction is that of the side given by the velocity's sign."""
        v, s = directed(dz, direction)
        speed = np.abs(v)
        ahead, behind = (
            side.coulomb + side.drop * np.exp(-((speed / side.stribeck) ** side.exponent))
            for side in (self.forward, self.backward)
        )
        viscous = np.where(v > 0, self.forward.viscous, self.backward.viscous) * v
        return np.asarray(by_direction(s, ahead, behind) + viscous + self.offset)

    def expression(self, dz: ca.SX, direction: ca.SX) -> ca.SX:
        """The equation of the class; viscous friction is that of the side given by the velocity's sign."""
        speed = ca.fabs(dz)
        ahead, behind = (
            side.coulomb + side.drop * ca.exp(-((speed / side.stribeck) ** side.exponent))
            for side in (self.forward, self.backward)
        )
        viscous = self.forward.viscous * ca.fmax(dz, 0) + self.backward.viscous * ca.fmin(dz, 0)
        return by_direction(direction, ahead, behind) + viscous + self.offset


@dataclass(frozen=True)
class Wrapped(FrictionCurve):
    """A curve that adds to another one; without what it adds it is that curve."""

    repeatable: ClassVar[bool] = False

    curve: FrictionCurve

    def __post_init__(self) -> None:
        if self.curve.layer > self.layer or (self.curve.layer == self.layer and not self.repeatable):
            raise _wrong_order(self.curve, self)

    def torque(self, dz: ArrayLike, direction: ArrayLike | None = None) -> Array:
        """Torque of the curve inside."""
        return self.curve.torque(dz, direction)

    def expression(self, dz: ca.SX, direction: ca.SX) -> ca.SX:
        """Expression of the curve inside."""
        return self.curve.expression(dz, direction)


@dataclass(frozen=True)
class Scaled(Wrapped):
    """Another curve times a factor."""

    layer: ClassVar[int] = 2
    repeatable: ClassVar[bool] = True

    factor: float

    def torque(self, dz: ArrayLike, direction: ArrayLike | None = None) -> Array:
        """``factor * curve``."""
        return np.asarray(self.factor * self.curve.torque(dz, direction))

    def expression(self, dz: ca.SX, direction: ca.SX) -> ca.SX:
        """``factor * curve``."""
        return self.factor * self.curve.expression(dz, direction)

    def torque_at(self, dz: ArrayLike, temperature: ArrayLike, direction: ArrayLike | None = None) -> Array:
        """``factor * curve``."""
        return np.asarray(self.factor * self.curve.torque_at(dz, temperature, direction))

    def at(self, temperature: float | None) -> FrictionCurve:
        """``factor * curve``."""
        return Scaled(self.curve.at(temperature), self.factor)


def _wrong_order(inner: FrictionCurve, outer: FrictionCurve) -> InputError:
    """Error for curves that wrap each other in the wrong order."""
    inside, around = type(inner).__name__, type(outer).__name__
    if inside == around:
        return InputError(f"friction: a {inside} curve must not be inside another one, which would ignore it")
    return InputError(
        f"friction: a {inside} curve must not be inside a {around} one, which would ignore it; put it outermost, "
        f"{inside}({around}(...), ...)"
    )


def directed(dz: ArrayLike, direction: ArrayLike | None) -> tuple[Array, Array]:
    """Velocities and directions of friction as arrays."""
    v = np.asarray(dz, dtype=float)
    return v, np.sign(v) if direction is None else np.asarray(direction, dtype=float)


def _check_finite(curve: object, names: tuple[str, ...]) -> None:
    for name in names:
        if not np.isfinite(getattr(curve, name)):
            raise InputError(f"friction: {name} must be a finite number, given {getattr(curve, name)}")


def _check_not_negative(curve: object, names: tuple[str, ...]) -> None:
    for name in names:
        if getattr(curve, name) < 0:
            raise InputError(f"friction: {name} must be zero or more, given {getattr(curve, name):g}")
