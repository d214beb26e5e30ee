"""Friction that is linear in temperature, such as that of a harmonic drive in oil [KD96] section 5.2, Fig. 2."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, TypeVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from regressors.errors import InputError
from regressors.robot.friction.curve import (
    CoulombViscous,
    FrictionCurve,
    Side,
    Stribeck,
    Wrapped,
    by_direction,
    directed,
)
from regressors.robot.friction.tables import TableFriction
from regressors.samples import Array

Parametric = TypeVar("Parametric", CoulombViscous, Side)


@dataclass(frozen=True)
class Slope:
    """How friction in one direction changes with temperature."""

    coulomb: float = 0.0  # a, of Coulomb friction and of the break-away torque alike [Nm/K or N/K]
    viscous: float = 0.0  # b, of viscous friction [Nm s/rad/K or N s/m/K]

    def __post_init__(self) -> None:
        for name in ("coulomb", "viscous"):
            if not np.isfinite(getattr(self, name)):
                raise InputError(
                    f"friction: temperature slope {name} must be a finite number, given {getattr(self, name)}"
                )


@dataclass(frozen=True)
class Warm(Wrapped):
    """A curve that is linear in temperature, ``f(v, T) = f(v) + (T - T0) (a s + b v)``, separately in each direction.

    Without a temperature it is the curve at the reference temperature.
    """

    layer: ClassVar[int] = 1

    reference: float  # T0 [deg C]
    forward: Slope  # for positive velocity
    backward: Slope = field(default=None)  # type: ignore[assignment]
    range: tuple[float, float] | None = None  # lowest and highest temperature at which friction was measured [deg C]

    def __post_init__(self) -> None:
        if self.backward is None:
            object.__setattr__(self, "backward", self.forward)
        super().__post_init__()
        _check_temperature(self.reference, "reference temperature")
        if self.range is not None:
            low, high = self.range
            _check_temperature(np.array(self.range), "temperature range")
            if low > high:
                raise InputError(
                    f"friction: temperature range must be its lowest and its highest, given {low:g}, {high:g}"
                )

    def torque_at(self, dz: ArrayLike, temperature: ArrayLike, direction: ArrayLike | None = None) -> Array:
        """``f(v) + (T - T0) (a s + b v)``."""
        _check_temperature(temperature)
        for extreme in (np.min(temperature), np.max(temperature)) if np.size(temperature) else ():
            self.at(float(extreme))  # linear: valid at these, valid in between
        v, s = directed(dz, direction)
        a, b = self.forward, self.backward
        change = by_direction(s, a.coulomb, b.coulomb) + np.where(v > 0, a.viscous, b.viscous) * v
        return np.asarray(self.curve.torque(v, direction) + (np.asarray(temperature) - self.reference) * change)

    def at(self, temperature: float | None) -> FrictionCurve:
        """The curve at one temperature; at the reference temperature if None."""
        if temperature is None:
            return self.curve
        _check_temperature(temperature)
        curve, kelvin = self.curve, temperature - self.reference
        try:
            if isinstance(curve, CoulombViscous) and self.forward == self.backward:
                return _changed(curve, self.forward, kelvin)
            if isinstance(curve, CoulombViscous):
                curve = Stribeck(Side(curve.coulomb, curve.viscous), offset=curve.offset)
            if isinstance(curve, Stribeck):
                ahead = _changed(curve.forward, self.forward, kelvin)
                behind = _changed(curve.backward, self.backward, kelvin)
                return replace(curve, forward=ahead, backward=behind)
            if isinstance(curve, TableFriction):
                _check_table(curve, (self.forward, self.backward), kelvin)
        except InputError as error:
            raise InputError(f"{error} at {temperature:g} deg C; {self.measured}") from error
        return _Held(self, temperature)

    @property
    def measured(self) -> str:
        """Text that states at which temperatures friction was measured."""
        if self.range is None:
            return f"it was measured about {self.reference:.4g} deg C"
        return f"it was measured from {self.range[0]:.4g} to {self.range[1]:.4g} deg C"

    def beyond(self, temperature: ArrayLike) -> bool:
        """Whether any of the temperatures lies outside the measured range; False where the range is unknown."""
        if self.range is None:
            return False
        known = np.asarray(temperature, dtype=float)
        return bool(np.any((known < self.range[0]) | (known > self.range[1])))


@dataclass(frozen=True)
class _Held(FrictionCurve):
    """A curve of any kind at one temperature."""

    warm: Warm
    temperature: float

    def torque(self, dz: ArrayLike, direction: ArrayLike | None = None) -> Array:
        return self.warm.torque_at(dz, self.temperature, direction)

    def expression(self, dz: ca.SX, direction: ca.SX) -> ca.SX:
        a, b = self.warm.forward, self.warm.backward
        coulomb = by_direction(direction, a.coulomb, b.coulomb)
        viscous = a.viscous * ca.fmax(dz, 0) + b.viscous * ca.fmin(dz, 0)
        kelvin = self.temperature - self.warm.reference
        return self.warm.curve.expression(dz, direction) + kelvin * (coulomb + viscous)


def temperature_notes(
    curves: Mapping[str, FrictionCurve], temperature: Mapping[str, Array | float] | None
) -> tuple[str, ...]:
    """Notes on the temperatures at which curves are evaluated."""
    notes = []
    for name, given in curves.items():
        curve = warm_part(given)
        if curve is None:
            continue
        if temperature is None or name not in temperature:
            notes.append(
                f"friction of {name} depends on temperature, which is not known: taken at its reference, "
                f"{curve.reference:.4g} deg C; give another with `temperature`"
            )
        else:
            low, high = float(np.min(temperature[name])), float(np.max(temperature[name]))
            taken = f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
            beyond = f", which is extrapolated: {curve.measured}" if curve.beyond((low, high)) else ""
            notes.append(f"friction of {name} is taken at {taken} deg C{beyond}")
    return tuple(notes)


def warm_part(curve: FrictionCurve | None) -> Warm | None:
    """The `Warm` curve inside a curve that may be scaled or loaded; None where there is none."""
    while curve is not None and not isinstance(curve, Warm):
        curve = getattr(curve, "curve", None)
    return curve


def table_part(curve: FrictionCurve | None) -> TableFriction | None:
    """The table inside a curve that may be scaled, loaded or at some temperature; None where there is none."""
    while curve is not None and not isinstance(curve, TableFriction):
        curve = curve.warm if isinstance(curve, _Held) else getattr(curve, "curve", None)
    return curve


def _changed(curve: Parametric, slope: Slope, kelvin: float) -> Parametric:
    changes = {"coulomb": kelvin * slope.coulomb, "viscous": kelvin * slope.viscous}
    if isinstance(curve, Side):
        changes["stiction"] = changes["coulomb"]
    changed = replace(curve, **{name: getattr(curve, name) + change for name, change in changes.items()})
    if changed.viscous < 0.0 <= curve.viscous:
        raise InputError(f"friction: viscous must be zero or more, given {changed.viscous:g}")
    return changed


def _check_table(table: TableFriction, slopes: tuple[Slope, Slope], kelvin: float) -> None:
    """Raise if a torque at a table's speeds or at rest, and so anywhere, falls below zero."""
    for (speed, friction), slope, sign in zip(table.sides, slopes, (1.0, -1.0), strict=True):
        v, f = np.concatenate([[0.0], speed]), np.concatenate([friction[:1], friction])
        there = f + kelvin * (slope.coulomb + slope.viscous * v)
        (less,) = np.nonzero((there < 0.0) & (f >= 0.0))
        if less.size:
            k = less[0]
            raise InputError(f"friction: torque at speed {sign * v[k]:g} must be zero or more, given {there[k]:g}")


def _check_temperature(temperature: ArrayLike, what: str = "temperature") -> None:
    wrong = np.asarray(temperature, dtype=float)[~np.isfinite(temperature)]
    if wrong.size:
        raise InputError(f"friction: {what} must be finite numbers [deg C], given {wrong[0]:g}")
