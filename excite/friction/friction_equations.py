"""Equations of friction over speed, over temperature, and over load [KD96] section 4."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regressors.robot.friction.curve import CoulombViscous, FrictionCurve, Stribeck
from regressors.robot.friction.curves import Side
from regressors.robot.friction.load_and_temperature import Loaded, Slope, Warm
from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class Conditions:
    """Conditions that friction depends on, at N points."""

    v: Array  # (N,) [rad/s or m/s]
    direction: Array  # (N,) 1 or -1, also at speed zero
    temperature_rise: Array  # (N,) temperature above the reference [K]
    load: Array  # (N,) size of the torque that the drive carries [Nm or N]

    @classmethod
    def of(cls, v: Array, temperature_rise: float = 0.0, load: float = 0.0) -> Conditions:
        """Motion at given velocities, at one temperature and one load; zero has a direction, that of its sign."""
        return cls(v, np.copysign(1.0, v), np.full_like(v, temperature_rise), np.full_like(v, load))


@dataclass(frozen=True)
class Form:
    """An equation of friction over speed, over temperature, and over load."""

    name: str
    stribeck: bool = False  # ``Fc + (Fs - Fc) exp(-(|v| / vs)^delta)`` rather than ``Fc``
    asymmetric: bool = False  # separate parameters for each direction and no offset, rather than one set and an offset
    exponent: float = 1.0  # delta
    offset: bool = True  # whether one set of parameters has an offset
    temperature: float | None = None  # reference temperature [deg C]; then Fc and Fv are linear in the difference to it
    load: bool = False  # whether a share of the torque that the drive carries is added to Fc

    @property
    def _of_side(self) -> tuple[str, ...]:
        steep = ("stiction", "stribeck") if self.stribeck else ()
        warm = () if self.temperature is None else ("coulomb_temperature", "viscous_temperature")
        return ("coulomb", "viscous", *steep, *warm, *(("load",) if self.load else ()))

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters."""
        if self.asymmetric:
            return tuple(f"{side}.{name}" for side in ("forward", "backward") for name in self._of_side)
        return (*self._of_side, *(("offset",) if self.offset else ()))

    def values(self, p: Array, at: Conditions) -> tuple[Array, Array]:
        """Torque and its derivatives with respect to the parameters."""  # p (k,); result (N,); result (N, k)
        n = len(self._of_side)
        if not self.asymmetric:
            f, J = self._side(p[:n], at)
            f, J = at.direction * f, at.direction[:, None] * J
            return (f + p[n], np.column_stack([J, np.ones_like(at.v)])) if self.offset else (f, J)
        f, J = np.zeros(at.v.size), np.zeros((at.v.size, 2 * n))
        for way, columns in ((1.0, slice(0, n)), (-1.0, slice(n, 2 * n))):
            rows = np.flatnonzero(way * at.direction > 0)
            own = Conditions(at.v[rows], at.direction[rows], at.temperature_rise[rows], at.load[rows])
            forward, backward = self._side(p[columns], own)
            f[rows] = way * forward
            J[rows, columns] = way * backward
        return f, J

    def _side(self, p: Array, at: Conditions) -> tuple[Array, Array]:
        given = dict(zip(self._of_side, p.tolist(), strict=True))
        v, coulomb, viscous = np.abs(at.v), given["coulomb"], given["viscous"]
        if not self.stribeck:
            f, columns = coulomb + viscous * v, [np.ones_like(v), v]
        else:
            drop, vs = given["stiction"] - coulomb, given["stribeck"]
            x = v / vs
            e = np.exp(-(x**self.exponent))
            f = coulomb + drop * e + viscous * v
            columns = [1.0 - e, v, e, drop * e * self.exponent * x**self.exponent / vs]
        if self.temperature is not None:
            rise = at.temperature_rise
            f = f + given["coulomb_temperature"] * rise + given["viscous_temperature"] * rise * v
            columns += [rise, rise * v]
        if self.load:
            f = f + given["load"] * at.load
            columns += [at.load]
        return f, np.column_stack(columns)

    def curve(self, p: Array, measured: tuple[float, float] | None = None) -> FrictionCurve:
        """The curve, linear in temperature where the form is."""  # p (k,)
        given = dict(zip(self.parameters, p.tolist(), strict=True))
        of = [f"{side}." if self.asymmetric else "" for side in ("forward", "backward")]
        curve: FrictionCurve
        if not self.stribeck and not self.asymmetric:
            curve = CoulombViscous(given["coulomb"], given["viscous"], given.get("offset", 0.0))
        else:
            ahead, behind = (self._curve_side(given, side) for side in of)
            curve = Stribeck(ahead, behind, given.get("offset", 0.0))
        if self.temperature is not None:
            up, down = (Slope(given[f"{side}coulomb_temperature"], given[f"{side}viscous_temperature"]) for side in of)
            curve = Warm(curve, self.temperature, up, down, measured)
        return Loaded(curve, *(given[f"{side}load"] for side in of)) if self.load else curve

    def _curve_side(self, given: dict[str, float], of: str) -> Side:
        coulomb, viscous = given[f"{of}coulomb"], given[f"{of}viscous"]
        if not self.stribeck:
            return Side(coulomb, viscous)
        return Side(coulomb, viscous, given[f"{of}stiction"], given[f"{of}stribeck"], self.exponent)


def forms(
    model: str, exponent: float | None, *, offset: bool, temperature: float | None = None, load: bool = False
) -> tuple[Form, ...]:
    """Candidate forms of a model, by its name."""
    candidates = []
    on = [*([] if temperature is None else ["temperature"]), *(["load"] if load else [])]
    also = f", linear in {' and '.join(on)}" if on else ""
    for asymmetric in (False, True) if offset else (False,):
        side = "asymmetric " if asymmetric else ""
        if model in ("auto", "coulomb-viscous"):
            candidates.append(Form(f"{side}coulomb-viscous{also}", False, asymmetric, 1.0, offset, temperature, load))
        if model in ("auto", "stribeck"):
            for delta in (1.0, 2.0) if exponent is None else (exponent,):
                name = f"{side}stribeck (exponent {delta:g}){also}"
                candidates.append(Form(name, True, asymmetric, delta, offset, temperature, load))
    return tuple(candidates)
