"""Friction that depends on the torque that a drive carries, or on its temperature."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, TypeVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from regressors.errors import InputError
from regressors.robot.friction.curve import (
    CoulombViscous,
    Directed,
    FrictionCurve,
    Scaled,
    Side,
    Stribeck,
    TableFriction,
    Wrapped,
    by_direction,
    check_numbers,
    directed,
)
from regressors.robot.robot import Robot, drive_numbers, transmission_of
from regressors.robot.symbolic.kinematics import sparse
from regressors.samples import Array

MOST = 0.99  # largest load share that scaling may lead to


@dataclass(frozen=True)
class Loaded(Wrapped):
    """A curve, and a share of the carried torque in the direction of friction, ``f(v) + k s |tau|``.

    The carried torque tau is what moves the robot without friction: the measured one is ``tau + f(v) + k s |tau|``.
    Without a carried torque it is the curve alone.
    """

    layer: ClassVar[int] = 3

    forward: float  # k for positive velocity, at least 0 and below 1
    backward: float | None = None  # k for negative velocity; as forward if not given

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.backward is None:
            object.__setattr__(self, "backward", self.forward)
        check_numbers(self, ("forward", "backward"), ("at least 0 and below 1", lambda k: 0.0 <= k < 1.0), of="load ")

    @property
    def shares(self) -> tuple[float, float]:
        """Load shares k for positive and for negative velocity."""
        assert self.backward is not None
        return self.forward, self.backward

    def torque_at(self, dz: ArrayLike, temperature: ArrayLike, direction: ArrayLike | None = None) -> Array:
        """Torque of the curve without load; the shares do not depend on temperature."""
        return self.curve.torque_at(dz, temperature, direction)


def loading(curve: FrictionCurve, direction: Directed) -> Directed | float:
    """``k s``, the change of friction per unit of carried torque; zero for curves without a load share."""
    return by_direction(direction, *curve.shares) if isinstance(curve, Loaded) else 0.0


def carried(rest: Array, loading: Array | float) -> Array:
    """Carried torque tau of ``tau + k s |tau| = rest``."""  # rest (N,); loading (N,)
    return np.asarray(rest / (1.0 + loading * np.sign(rest)))


def carried_expression(rest: ca.SX, loading: ca.SX | float) -> ca.SX:
    """Carried torque as an expression, see `carried`."""
    return ca.fmax(rest, 0) / (1 + loading) + ca.fmin(rest, 0) / (1 - loading)


def scaled(curve: FrictionCurve, factor: float) -> FrictionCurve:
    """A curve times a factor, with its load shares scaled likewise up to 0.99."""
    if not isinstance(curve, Loaded):
        return Scaled(curve, factor)
    return Loaded(Scaled(curve.curve, factor), *scaled_shares(curve, factor))


def scaled_shares(curve: Loaded, factor: float) -> list[float]:
    """Load shares times a factor, up to 0.99 or what they are."""
    return [min(factor * share, max(share, MOST)) for share in curve.shares]


_NOTHING = 1e-12  # of a drive's velocity along a direction


def drives_with_friction(robot: Robot) -> tuple[tuple[str, Array], ...]:
    """Name and row of C of every drive whose joint moves; joints themselves where the robot has no transmission."""
    transmission = transmission_of(robot)
    rows = zip(transmission.drives, transmission.coupling, strict=True)
    return tuple((drive.name, row) for drive, row in rows if not drive.rests)


def friction_rows(robot: Robot) -> Array:
    """Rows of C of `drives_with_friction`, shape (k, n)."""
    return np.array([row for _, row in drives_with_friction(robot)]).reshape(-1, robot.n)


def drives_along(robot: Robot) -> Iterator[tuple[str, str, float]]:
    """Name of each drive that turns along with another while joints are locked, that one's, and ``dz`` over its own."""
    transmission = transmission_of(robot)
    pairs = list(zip(transmission.drives, transmission.coupling, strict=True))
    for drive, row in pairs:
        if drive.rests and np.any(row):
            for other, leading in pairs:
                a = float(row @ leading) / max(float(leading @ leading), _NOTHING)
                if not other.rests and np.allclose(row, a * leading):
                    yield drive.name, other.name, a
                    break


def moving_drive_numbers(robot: Robot) -> dict[str, int]:
    """Number in parameter names of every drive whose joint moves, by name."""
    numbers = zip(transmission_of(robot).drives, drive_numbers(robot), strict=True)
    return {drive.name: number for drive, number in numbers if not drive.rests}


def drive_temperatures(robot: Robot, temperature: Array) -> Array:
    """Temperatures of the drives with friction: each takes the temperature of its own joint.

    Where there are as many drives as joints, a drive's own joint is the one of the same number, if the drive moves it,
    such as in a differential wrist ``z4 = q4 + q5, z5 = q4 - q5``; otherwise it is the last joint that the drive moves.
    """  # temperature (N, n)
    rows = friction_rows(robot)
    paired = len(rows) == robot.n
    own = [k if paired and row[k] != 0.0 else int(np.flatnonzero(row)[-1]) for k, row in enumerate(rows)]
    return np.asarray(temperature)[:, own]


def smooth_direction(robot: Robot, dq: ca.SX, width: ca.SX | float) -> ca.SX:
    """``tanh(dz / width)`` of every drive with friction."""  # dq (n, 1)
    return ca.densify(ca.tanh(ca.mtimes(sparse(friction_rows(robot)), dq) / width))


def torques_at_drives(robot: Robot) -> Array:
    """Matrix from joint torques to those of the drives with friction, ``tau = C' tau_z`` solved for ``tau_z``."""
    C, names = friction_rows(robot), ", ".join(name for name, _ in drives_with_friction(robot))
    if C.shape[0] != robot.n or np.linalg.matrix_rank(C) < robot.n:
        raise InputError(
            f"friction that grows with load needs one drive for each joint; here {robot.n} joints "
            f"({', '.join(robot.joint_names)}) have the drives {names}"
        )
    return np.asarray(np.linalg.inv(C.T))


def carried_along(robot: Robot, moved: Array) -> Array:
    """Matrix from torques along directions, ``N' tau``, to joint torques with the same load on moved drives."""
    # moved (n, r)
    C = friction_rows(robot)
    along = C @ moved
    turning = np.any(np.abs(along) > _NOTHING, axis=1)
    if np.count_nonzero(turning) != along.shape[1] or np.linalg.matrix_rank(along[turning]) < along.shape[1]:
        names = [name for (name, _), turns in zip(drives_with_friction(robot), turning, strict=True) if turns]
        raise InputError(
            f"friction grows with load, and torques along {along.shape[1]} direction(s) "
            "do not determine the load of each "
            f"of the drives {', '.join(names)}; take all joints, or drives that move alone"
        )
    return np.asarray(C[turning].T @ np.linalg.inv(along[turning]).T)


Parametric = TypeVar("Parametric", CoulombViscous, Side)


@dataclass(frozen=True)
class Slope:
    """How friction in one direction changes with temperature."""

    coulomb: float = 0.0  # a, of Coulomb friction and of the break-away torque alike [Nm/K or N/K]
    viscous: float = 0.0  # b, of viscous friction [Nm s/rad/K or N s/m/K]

    def __post_init__(self) -> None:
        check_numbers(self, ("coulomb", "viscous"), of="temperature slope ")


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
