"""Friction of one drive as a curve of its velocity: Coulomb and viscous friction, and Tustin's model.

Each curve can be evaluated numerically, or as a CasADi expression for simulation. The direction of friction is the sign
of the velocity, or a number between -1 and 1 where the sign changes smoothly or follows the last motion (presliding).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, replace
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
        check_numbers(self, ("coulomb", "viscous", "offset"))
        check_numbers(self, ("coulomb",), _NOT_NEGATIVE)

    def torque(self, dz: ArrayLike, direction: ArrayLike | None = None) -> Array:
        """``Fc s + Fv dz + Fo``."""
        v, s = directed(dz, direction)
        return np.asarray(self.coulomb * s + self.viscous * v + self.offset)

    def expression(self, dz: ca.SX, direction: ca.SX) -> ca.SX:
        """``Fc s + Fv dz + Fo``."""
        return self.coulomb * direction + self.viscous * dz + self.offset


@dataclass(frozen=True)
class Side:
    """Friction in one direction, ``Fc + (Fs - Fc) exp(-(v / vs)^delta) + Fv v`` at speed v >= 0 [Tustin 1947]."""

    coulomb: float  # [Nm, Nm s/rad, or with N and m]
    viscous: float = 0.0
    stiction: float | None = None  # break-away torque Fs [Nm]; equal to the Coulomb friction if not given
    stribeck: float = 0.05  # speed vs over which friction falls from Fs to Fc, > 0 [rad/s or m/s]
    exponent: float = 2.0  # delta, > 0; 1 in Tustin's model, 2 the usual choice since

    def __post_init__(self) -> None:
        if self.stiction is None:
            object.__setattr__(self, "stiction", self.coulomb)
        check_numbers(self, ("coulomb", "viscous", "stiction", "stribeck", "exponent"))
        check_numbers(self, ("coulomb", "stiction"), _NOT_NEGATIVE)
        check_numbers(self, ("stribeck", "exponent"), _POSITIVE)

    @property
    def drop(self) -> float:
        """``Fs - Fc`` [Nm]."""
        assert self.stiction is not None
        return self.stiction - self.coulomb

    def falling(self, speed: Directed, exp: Callable[[Directed], Directed]) -> Directed:
        """Friction at a speed without its viscous part."""
        return self.coulomb + self.drop * exp(-((speed / self.stribeck) ** self.exponent))


@dataclass(frozen=True)
class Stribeck(FrictionCurve):
    """``f = [Fc + (Fs - Fc) exp(-|dz / vs|^delta)] sign(dz) + Fv dz + Fo``, each direction its own [Tustin 1947]."""

    forward: Side  # for positive velocity
    backward: Side = field(default=None)  # type: ignore[assignment]
    offset: float = 0.0  # fo [Nm or N]

    def __post_init__(self) -> None:
        if self.backward is None:
            object.__setattr__(self, "backward", self.forward)
        check_numbers(self, ("offset",))

    def torque(self, dz: ArrayLike, direction: ArrayLike | None = None) -> Array:
        """The equation of the class; viscous friction is that of the side given by the velocity's sign."""
        v, s = directed(dz, direction)
        speed = np.abs(v)
        ahead, behind = self.forward.falling(speed, np.exp), self.backward.falling(speed, np.exp)
        viscous = np.where(v > 0, self.forward.viscous, self.backward.viscous) * v
        return np.asarray(by_direction(s, ahead, behind) + viscous + self.offset)

    def expression(self, dz: ca.SX, direction: ca.SX) -> ca.SX:
        """The equation of the class; viscous friction is that of the side given by the velocity's sign."""
        speed = ca.fabs(dz)
        ahead, behind = self.forward.falling(speed, ca.exp), self.backward.falling(speed, ca.exp)
        viscous = self.forward.viscous * ca.fmax(dz, 0) + self.backward.viscous * ca.fmin(dz, 0)
        return by_direction(direction, ahead, behind) + viscous + self.offset


@dataclass(frozen=True)
class Wrapped(FrictionCurve):
    """A curve that adds to another one; without what it adds it is that curve."""

    repeatable: ClassVar[bool] = False

    curve: FrictionCurve

    def __post_init__(self) -> None:
        if self.curve.layer > self.layer or (self.curve.layer == self.layer and not self.repeatable):
            inside, around = type(self.curve).__name__, type(self).__name__
            wrong = f"friction: a {inside} curve must not be inside"
            if inside == around:
                raise InputError(f"{wrong} another one, which would ignore it")
            raise InputError(
                f"{wrong} a {around} one, which would ignore it; put it outermost, {inside}({around}(...), ...)"
            )

    def torque(self, dz: ArrayLike, direction: ArrayLike | None = None) -> Array:
        """Torque of the curve inside."""
        return self.curve.torque(dz, direction)

    def expression(self, dz: ca.SX, direction: ca.SX) -> ca.SX:
        """Expression of the curve inside."""
        return self.curve.expression(dz, direction)

    def at(self, temperature: float | None) -> FrictionCurve:
        """The same around the curve at one temperature."""
        return replace(self, curve=self.curve.at(temperature))


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


def directed(dz: ArrayLike, direction: ArrayLike | None) -> tuple[Array, Array]:
    """Velocities and directions of friction as arrays."""
    v = np.asarray(dz, dtype=float)
    return v, np.sign(v) if direction is None else np.asarray(direction, dtype=float)


Rule = tuple[str, Callable[[float], object]]
_FINITE: Rule = ("a finite number", np.isfinite)
_NOT_NEGATIVE: Rule = ("zero or more", lambda x: x >= 0)
_POSITIVE: Rule = ("greater than zero", lambda x: x > 0)


def check_numbers(part: object, names: tuple[str, ...], rule: Rule = _FINITE, of: str = "") -> None:
    """Raise `InputError` for the first field of a curve, or of a part of one, for which a rule does not hold."""
    must_be, holds = rule
    for name in names:
        if not holds(getattr(part, name)):
            raise InputError(f"friction: {of}{name} must be {must_be}, given {getattr(part, name):g}")


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
