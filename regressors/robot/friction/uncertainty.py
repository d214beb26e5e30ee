"""Uncertainty of the parameters of friction curves, as a measurement of friction leaves it.

A parameter is named by its place in a friction file, such as ``forward.coulomb`` or ``temperature.viscous``; a name
without a side is a parameter shared by both directions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import numpy as np

from regressors.errors import InputError, check_names
from regressors.robot.friction.curve import (
    CoulombViscous,
    FrictionCurve,
    FunctionFriction,
    Scaled,
    Side,
    Stribeck,
    TableFriction,
)
from regressors.robot.friction.load_and_temperature import Loaded, Slope, Warm, scaled_shares
from regressors.samples import Array

Part = TypeVar("Part", CoulombViscous, Side, Slope)

_SIDES = ("forward", "backward")
_ROUNDING = 1e-8  # of correlations
_OF = {kind: tuple(f.name for f in fields(kind)) for kind in (CoulombViscous, Side, Slope)}


@dataclass(frozen=True, eq=False)
class CurveUncertainty:
    """Covariance of some parameters of one curve."""

    parameters: tuple[str, ...]  # names, see `curve_parameters`; the others are exact
    covariance: Array  # (k, k) [products of the parameters' units]

    def __post_init__(self) -> None:
        k, C = len(self.parameters), np.array(self.covariance, dtype=float)
        if not self.parameters:
            raise InputError("uncertainty: expected one parameter or more, given none")
        if twice := [name for n, name in enumerate(self.parameters) if name in self.parameters[:n]]:
            raise InputError(f"uncertainty: parameter {twice[0]} is named twice")
        if C.shape != (k, k):
            raise InputError(f"uncertainty: covariance of {k} parameters needs {k} rows of {k}, given {_shape(C)}")
        if not np.all(np.isfinite(C)):
            raise InputError("uncertainty: covariance must be finite numbers")
        scale = np.sqrt(np.maximum(np.diag(C), 0.0))
        if np.any(np.diag(C) < 0):
            j = int(np.argmin(np.diag(C)))
            raise InputError(f"uncertainty: variance of {self.parameters[j]} must be zero or more, given {C[j, j]:g}")
        sizes = np.outer(scale, scale)
        if np.any(np.abs(C - C.T) > _ROUNDING * sizes):
            i, j = divmod(int(np.argmax(np.abs(C - C.T))), k)
            raise InputError(
                f"uncertainty: covariance must be symmetric, given {C[i, j]:g} for {self.parameters[i]} and "
                f"{self.parameters[j]}, but {C[j, i]:g} for the other way round"
            )
        least = float(np.linalg.eigvalsh(_over(C, sizes)).min(initial=0.0))
        if least < -_ROUNDING or np.any((sizes == 0) & (C != 0)):
            raise InputError(
                "uncertainty: covariance must be positive semidefinite, "
                f"given correlations with the eigenvalue {least:.3g}; rounded numbers may need more digits"
            )
        object.__setattr__(self, "covariance", (C + C.T) / 2)

    @property
    def deviation(self) -> Array:
        """Standard deviation of each parameter, shape (k,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def correlation(self) -> Array:
        """Correlation matrix of the parameters, shape (k, k); zero in rows of parameters without deviation."""
        return _over(self.covariance, np.outer(self.deviation, self.deviation))

    def check(self, curve: FrictionCurve) -> None:
        """Raise `UnknownName` for a parameter that a curve does not have."""
        check_names("parameter of the friction curve", self.parameters, curve_parameters(curve))


def together(own: CurveUncertainty | None, further: CurveUncertainty, factors: Mapping[str, float]) -> CurveUncertainty:
    """Uncertainty of a curve to which another, independent of it, is added with a factor for each parameter."""
    scaled = np.array([factors[name] for name in further.parameters])
    parts = [(further.parameters, further.covariance * np.outer(scaled, scaled))]
    parts += [] if own is None else [(own.parameters, own.covariance)]
    names = tuple(dict.fromkeys(name for part, _ in parts for name in part))
    covariance = np.zeros((len(names), len(names)))
    for part, block in parts:
        place = [names.index(name) for name in part]
        covariance[np.ix_(place, place)] += block
    return CurveUncertainty(names, covariance)


def curve_parameters(curve: FrictionCurve) -> tuple[str, ...]:
    """Names of a curve's parameters that can be uncertain; none for tables."""
    if isinstance(curve, Loaded):
        return (*curve_parameters(curve.curve), "load", *(f"load.{side}" for side in _SIDES))
    if isinstance(curve, Warm):
        return (*curve_parameters(curve.curve), *_sided("temperature.", _OF[Slope]))
    if isinstance(curve, Stribeck):
        return (*_sided("", _OF[Side]), "offset")
    return _OF[CoulombViscous] if isinstance(curve, CoulombViscous) else ()


def changed(curve: FrictionCurve, changes: Mapping[str, float]) -> FrictionCurve:
    """A copy of a curve with increments added to some of its parameters."""
    check_names("parameter of the friction curve", changes, curve_parameters(curve))
    return _changed(curve, changes)


def _changed(curve: FrictionCurve, changes: Mapping[str, float]) -> FrictionCurve:
    def by(*names: str) -> float:
        return sum(changes.get(name, 0.0) for name in names)

    def sides(of: str = "") -> dict[str, Any]:
        parts = {side: getattr(curve, side) for side in _SIDES}
        return {
            side: replace(part, **{f: getattr(part, f) + by(f"{of}{f}", f"{of}{side}.{f}") for f in _OF[type(part)]})
            for side, part in parts.items()
        }

    if isinstance(curve, Loaded):
        both = zip(_SIDES, curve.shares, strict=True)
        return Loaded(_changed(curve.curve, changes), *(x + by("load", f"load.{side}") for side, x in both))
    if isinstance(curve, Warm):
        return replace(curve, curve=_changed(curve.curve, changes), **sides("temperature."))
    if isinstance(curve, Stribeck):
        return replace(curve, offset=curve.offset + by("offset"), **sides())
    if isinstance(curve, CoulombViscous):
        return replace(curve, **{name: getattr(curve, name) + by(name) for name in _OF[CoulombViscous]})
    return curve


def uncertainty_at(
    uncertainty: CurveUncertainty, curve: FrictionCurve, temperature: float | None
) -> CurveUncertainty | None:
    """Uncertainty of a curve at one temperature, ``A C A'`` with A the Jacobian of its parameters."""
    warm = curve.curve if isinstance(curve, Loaded) else curve
    if not isinstance(warm, Warm):
        return uncertainty
    kelvin = 0.0 if temperature is None else temperature - warm.reference
    tied = isinstance(warm.curve, CoulombViscous)  # its stiction equals its Coulomb friction; a `Side` has its own
    curves = warm.at(temperature)
    columns = [_at(name, kelvin, isinstance(curves, Stribeck), tied) for name in uncertainty.parameters]
    names = tuple(dict.fromkeys(name for column in columns for name in column))
    if not names or not set(names) <= set(curve_parameters(curve.at(temperature))):
        return None
    A = np.array([[column.get(name, 0.0) for column in columns] for name in names])
    return CurveUncertainty(names, A @ uncertainty.covariance @ A.T)


def _at(name: str, kelvin: float, sides: bool, tied: bool) -> dict[str, float]:
    """Derivatives of the parameters at a temperature with respect to one of the curve."""
    of_slope = name.startswith("temperature.")
    if of_slope and kelvin == 0.0:
        return {}
    change, name = kelvin if of_slope else 1.0, name.removeprefix("temperature.")
    also = sides and name.endswith("coulomb") and (of_slope or tied)
    return {name: change, **({f"{name.removesuffix('coulomb')}stiction": change} if also else {})}


def _sided(of: str, names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(f"{of}{side}{name}" for side in ("", *(f"{side}." for side in _SIDES)) for name in names)


def _over(C: Array, sizes: Array) -> Array:
    return np.asarray(np.divide(C, sizes, out=np.zeros_like(C), where=sizes > 0))


def _shape(C: Array) -> str:
    return f"{len(C)} of {C.shape[1]}" if C.ndim == 2 else f"shape {C.shape}"


def multiplied(curve: FrictionCurve, factor: float) -> FrictionCurve:
    """``factor * f`` as a curve of the same kind, which friction files can hold; functions become tables."""
    if isinstance(curve, CoulombViscous):
        return _times(curve, factor)
    if isinstance(curve, Stribeck):
        return Stribeck(_times(curve.forward, factor), _times(curve.backward, factor), factor * curve.offset)
    if isinstance(curve, TableFriction):
        return TableFriction(curve.speed, factor * curve.friction)
    if isinstance(curve, FunctionFriction):
        return multiplied(curve.table(), factor)
    if isinstance(curve, Scaled):
        return multiplied(curve.curve, factor * curve.factor)
    if isinstance(curve, Warm):
        up, down = _times(curve.forward, factor), _times(curve.backward, factor)
        return Warm(multiplied(curve.curve, factor), curve.reference, up, down, curve.range)
    if isinstance(curve, Loaded):
        return Loaded(multiplied(curve.curve, factor), *scaled_shares(curve, factor))
    raise InputError(f"a friction curve of type {type(curve).__name__} cannot be scaled; use a table")


def _times(part: Part, factor: float) -> Part:
    """Its torques, and torques per velocity or temperature, multiplied; its Stribeck speed and exponent kept."""
    names = [name for name in ("coulomb", "viscous", "stiction", "offset") if hasattr(part, name)]
    return replace(part, **{name: factor * getattr(part, name) for name in names})
