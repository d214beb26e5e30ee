"""Friction that is linear in temperature, such as that of a harmonic drive in oil [KD96] section 5.2, Fig. 2."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from regressors.errors import InputError
from regressors.friction_curves import CoulombViscous, FrictionCurve, Side, Stribeck
from regressors.samples import Array


@dataclass(frozen=True)
class Slope:
    """How friction in one direction changes with temperature.

    Parameters
    ----------
    coulomb : float
        a, of Coulomb friction and of the break-away torque alike [Nm/K or N/K].
    viscous : float
        b, of viscous friction [Nm s/rad/K or N s/m/K].
    """

    coulomb: float = 0.0
    viscous: float = 0.0

    def __post_init__(self) -> None:
        for name in ("coulomb", "viscous"):
            if not np.isfinite(getattr(self, name)):
                raise InputError(
                    f"friction: temperature slope {name} must be a finite number, given {getattr(self, name)}"
                )


@dataclass(frozen=True)
class Warm(FrictionCurve):
    """A curve that is linear in temperature, ``f(v, T) = f(v) + (T - T0) (a s + b v)``, of its own in each direction.

    Without a temperature it is the curve at the reference temperature.

    Parameters
    ----------
    curve : FrictionCurve
        f, at the reference temperature.
    reference : float
        T0 [deg C].
    forward : Slope
        For positive velocity.
    backward : Slope, optional
        For negative velocity, its torques counted positive; as forward if not given.
    range : tuple of float, optional
        Lowest and highest temperature at which friction was measured [deg C].

    Raises
    ------
    InputError
        A number that is not finite, or a range that is none.
    """

    curve: FrictionCurve
    reference: float
    forward: Slope
    backward: Slope = field(default=None)  # type: ignore[assignment]
    range: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if self.backward is None:
            object.__setattr__(self, "backward", self.forward)
        _check_temperature(self.reference, "reference temperature")
        if self.range is not None:
            low, high = self.range
            _check_temperature(np.array(self.range), "temperature range")
            if low > high:
                raise InputError(
                    f"friction: temperature range must be its lowest and its highest, given {low:g}, {high:g}"
                )

    def torque(self, dz: ArrayLike, direction: ArrayLike | None = None) -> Array:
        """That of the curve at the reference temperature."""
        return self.curve.torque(dz, direction)

    def expression(self, dz: ca.SX, direction: ca.SX) -> ca.SX:
        """That of the curve at the reference temperature."""
        return self.curve.expression(dz, direction)

    def torque_at(self, dz: ArrayLike, temperature: ArrayLike, direction: ArrayLike | None = None) -> Array:
        """``f(v) + (T - T0) (a s + b v)``."""
        _check_temperature(temperature)
        for extreme in (np.min(temperature), np.max(temperature)) if np.size(temperature) else ():
            self.at(float(extreme))  # friction at these is friction in between
        v = np.asarray(dz, dtype=float)
        s = np.sign(v) if direction is None else np.asarray(direction, dtype=float)
        a, b = self.forward, self.backward
        change = (1 + s) / 2 * a.coulomb - (1 - s) / 2 * b.coulomb + np.where(v > 0, a.viscous, b.viscous) * v
        return np.asarray(self.curve.torque(v, direction) + (np.asarray(temperature) - self.reference) * change)

    def at(self, temperature: float | None) -> FrictionCurve:
        """The curve at one temperature; at the reference temperature if None.

        Raises
        ------
        InputError
            A temperature at which Coulomb friction would be less than zero, or that is no finite number.
        """
        if temperature is None:
            return self.curve
        _check_temperature(temperature)
        curve, kelvin = self.curve, temperature - self.reference
        try:
            if isinstance(curve, CoulombViscous) and self.forward == self.backward:
                return replace(curve, **_changed(curve, self.forward, kelvin))
            if isinstance(curve, CoulombViscous):
                curve = Stribeck(Side(curve.coulomb, curve.viscous), offset=curve.offset)
            if isinstance(curve, Stribeck):
                ahead, behind = _side(curve.forward, self.forward, kelvin), _side(curve.backward, self.backward, kelvin)
                return replace(curve, forward=ahead, backward=behind)
        except InputError as error:
            raise InputError(f"{error} at {temperature:g} deg C; {self.measured}") from error
        return _Held(self, temperature)

    @property
    def measured(self) -> str:
        """Between which temperatures friction was measured, in words."""
        if self.range is None:
            return f"it was measured about {self.reference:.4g} deg C"
        return f"it was measured from {self.range[0]:.4g} to {self.range[1]:.4g} deg C"

    def beyond(self, temperature: ArrayLike) -> bool:
        """Whether any of some temperatures lies outside the range, as far as it is known.

        Parameters
        ----------
        temperature : array_like
            [deg C]
        """
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
        coulomb = (1 + direction) / 2 * a.coulomb - (1 - direction) / 2 * b.coulomb
        viscous = a.viscous * ca.fmax(dz, 0) + b.viscous * ca.fmin(dz, 0)
        kelvin = self.temperature - self.warm.reference
        return self.warm.curve.expression(dz, direction) + kelvin * (coulomb + viscous)


def temperature_notes(
    curves: Mapping[str, FrictionCurve], temperature: Mapping[str, Array | float] | None
) -> tuple[str, ...]:
    """What has to be said of the temperatures at which curves were taken.

    Parameters
    ----------
    curves : mapping of str to FrictionCurve
    temperature : mapping of str to ndarray or float, optional
        Of each drive [deg C]; the reference temperatures where there is none.
    """
    notes = []
    for name, given in curves.items():
        curve = _warm_part(given)
        if curve is None:
            continue
        if temperature is None or name not in temperature:
            notes.append(
                f"friction of {name} depends on temperature, which is not known: taken at its reference, "
                f"{curve.reference:.4g} deg C; --temperature says another"
            )
        else:
            low, high = float(np.min(temperature[name])), float(np.max(temperature[name]))
            taken = f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
            beyond = f", which is extrapolated: {curve.measured}" if curve.beyond((low, high)) else ""
            notes.append(f"friction of {name} is taken at {taken} deg C{beyond}")
    return tuple(notes)


def _warm_part(curve: FrictionCurve | None) -> Warm | None:
    """What depends on temperature in a curve that may be scaled, or more."""
    while curve is not None and not isinstance(curve, Warm):
        curve = getattr(curve, "curve", None)
    return curve


def _changed(curve: CoulombViscous | Side, slope: Slope, kelvin: float) -> dict[str, float]:
    return {"coulomb": curve.coulomb + kelvin * slope.coulomb, "viscous": curve.viscous + kelvin * slope.viscous}


def _side(side: Side, slope: Slope, kelvin: float) -> Side:
    assert side.stiction is not None
    return replace(side, **_changed(side, slope, kelvin), stiction=side.stiction + kelvin * slope.coulomb)


def _check_temperature(temperature: ArrayLike, what: str = "temperature") -> None:
    wrong = np.asarray(temperature, dtype=float)[~np.isfinite(temperature)]
    if wrong.size:
        raise InputError(f"friction: {what} must be finite numbers [deg C], given {wrong[0]:g}")
