"""Friction curves of a robot's drives, where two columns of a linear model do not suffice [KD96] section 5.2.

Each drive's curve gives the friction torque at its coordinate, ``f(dz)``; at the joints this is ``C' f(C dq)``.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import casadi as ca
import numpy as np

from regressors.errors import UnknownName, about, check_names
from regressors.robot.friction.curve import (
    CoulombViscous as CoulombViscous,
    FrictionCurve as FrictionCurve,
    FunctionFriction as FunctionFriction,
    Scaled as Scaled,
    Side as Side,
    Stribeck as Stribeck,
    TableFriction as TableFriction,
)
from regressors.robot.friction.load_and_temperature import (
    Loaded as Loaded,
    Slope as Slope,
    Warm as Warm,
    carried,
    carried_along as carried_along,
    carried_expression,
    drive_temperatures as drive_temperatures,
    drives_along,
    drives_with_friction as drives_with_friction,
    friction_rows,
    loading,
    scaled,
    smooth_direction as smooth_direction,
    table_part,
    torques_at_drives as torques_at_drives,
)
from regressors.robot.friction.uncertainty import (
    CurveUncertainty as CurveUncertainty,
    changed as changed,
    curve_parameters as curve_parameters,
    together,
    uncertainty_at,
)
from regressors.robot.robot import Rebuilt, Robot, plain, transmission_of
from regressors.robot.symbolic.kinematics import sparse
from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class FrictionCurves(Rebuilt):
    """Friction of a robot's drives, so that identification can subtract it from the torques [KD96] section 5.2."""

    # by name of the drive, or of the joint where the robot has no transmission; a drive without an entry has no
    # friction. A function of velocities is accepted as a curve, see `FunctionFriction`
    curves: Mapping[str, FrictionCurve | Callable[[Array], Array]]
    uncertainty: Mapping[str, CurveUncertainty] = field(default_factory=dict)  # curves without one count as exact

    def __post_init__(self) -> None:
        curves = {
            name: curve if isinstance(curve, FrictionCurve) else FunctionFriction(curve)
            for name, curve in self.curves.items()
        }
        object.__setattr__(self, "curves", MappingProxyType(curves))
        object.__setattr__(self, "uncertainty", MappingProxyType(dict(self.uncertainty)))
        for name, uncertainty in self.uncertainty.items():
            if name not in curves:
                raise UnknownName("friction curve", name, tuple(curves))
            uncertainty.check(curves[name])

    def __eq__(self, other: object) -> bool:
        """True for the same curves with the same uncertainty."""
        if not isinstance(other, FrictionCurves):
            return NotImplemented
        return plain((self.curves, self.uncertainty)) == plain((other.curves, other.uncertainty))

    __hash__ = None  # type: ignore[assignment]

    @classmethod
    def of_robot(cls, robot: Robot) -> FrictionCurves:
        """Coulomb and viscous friction of the drives whose description states it."""
        drives = transmission_of(robot).drives
        known = {d.name: [x for x in (d.coulomb, d.viscous) if x is not None and np.isfinite(x)] for d in drives}
        stated = {d.name: CoulombViscous(_stated(d.coulomb), _stated(d.viscous)) for d in drives if not d.rests}
        return cls({name: curve for name, curve in stated.items() if known[name]})

    def scaled(self, factors: Mapping[str, float]) -> FrictionCurves:
        """The curves times one factor each, 1 where none is given, as exact ones; load shares are limited to 0.99."""
        known = ((name, curve) for name in self.curves if (curve := self.curve(name)) is not None)
        return FrictionCurves({name: scaled(curve, factors.get(name, 1.0)) for name, curve in known})

    def at(self, temperature: float | Mapping[str, float] | None) -> FrictionCurves:
        """Curves at one temperature for all, or by name; at its reference where a curve's is not given [deg C]."""
        each = temperature if isinstance(temperature, Mapping) else dict.fromkeys(self.curves, temperature)
        check_names("friction curve", each, tuple(self.curves))
        curves, uncertainty = {}, {}
        for name in self.curves:
            curve = self.curve(name)
            assert curve is not None
            with about(name):
                curves[name] = curve.at(each.get(name))
            if name in self.uncertainty and (kept := uncertainty_at(self.uncertainty[name], curve, each.get(name))):
                uncertainty[name] = kept
        return FrictionCurves(curves, uncertainty)

    def of(self, names: Container[str]) -> FrictionCurves:
        """Curves of some drives."""
        return FrictionCurves(
            {name: curve for name, curve in self.curves.items() if name in names},
            {name: uncertainty for name, uncertainty in self.uncertainty.items() if name in names},
        )

    def along(self, robot: Robot) -> FrictionCurves:
        """Curves of a robot with locked joints: those of drives that turn along with another count with that one's.

        With ``dz_k = a dz``, Coulomb and viscous friction of both add up: ``F_c + |a| F_c,k``, ``F_v + a^2 F_v,k`` and
        ``F_o + a F_o,k``. Of other kinds the curve of the drive in front is that of all that turns along.
        """
        curves, uncertainty = dict(self.curves), dict(self.uncertainty)
        for name, leader, a in drives_along(robot):
            own, further = curves.get(leader), self.curve(name)
            if not (isinstance(own, CoulombViscous) and isinstance(further, CoulombViscous)):
                continue
            factors = {"coulomb": abs(a), "viscous": a**2, "offset": a}
            total = {part: getattr(own, part) + factor * getattr(further, part) for part, factor in factors.items()}
            curves[leader] = CoulombViscous(**total)
            del curves[name]
            if (more := uncertainty.pop(name, None)) is not None:
                uncertainty[leader] = together(uncertainty.get(leader), more, factors)
        return FrictionCurves(curves, uncertainty)

    @property
    def loaded(self) -> bool:
        """Whether any friction grows with the torque that its drive carries."""
        return any(isinstance(curve, Loaded) for curve in self.curves.values())

    def curve(self, name: str) -> FrictionCurve | None:
        """Curve of one drive, None where it has none."""
        curve = self.curves.get(name)
        assert curve is None or isinstance(curve, FrictionCurve)
        return curve

    def speed_notes(self, robot: Robot, dq: Array) -> tuple[str, ...]:
        """Notes on a motion that is faster than the friction tables reach."""  # dq (N, n)
        tables = ((name, table_part(curve), row) for _, name, curve, row in self._of_drives(robot))
        beyond = [(name, table.extrapolated(dq @ row)) for name, table, row in tables if table is not None]
        return tuple(
            f"friction of {name}: {count} samples are faster than its table; its last value was used"
            for name, count in beyond
            if count
        )

    def check(self, robot: Robot) -> None:
        """Raise `UnknownName` for a curve whose name no drive of the robot has."""
        known = [drive.name for drive in transmission_of(robot).drives]
        check_names("drive" if robot.transmission else "joint", self.curves, known)

    def joint_torque(
        self,
        robot: Robot,
        q: Array,
        dq: Array,
        direction: Array | None = None,
        temperature: Array | None = None,
        load: Array | None = None,
    ) -> Array:
        """Friction torques at the joints, ``C' f(C dq)``, shape (N, n) [Nm or N].

        No kind of curve depends on q at present. The direction of friction and the temperature are those of each of
        `drives_with_friction`, by default the signs of their velocities, and the reference temperatures of the curves.
        The load is the joint torques of the motion without friction, by default zero.
        """  # q, dq, load (N, n); direction, temperature (N, k)
        self.check(robot)
        total = np.zeros_like(dq)
        z = None if load is None or not self.loaded else load @ torques_at_drives(robot).T
        for k, name, curve, row in self._of_drives(robot):
            v, s = dq @ row, None if direction is None else direction[:, k]
            with about(name):
                f = curve.torque(v, s) if temperature is None else curve.torque_at(v, temperature[:, k], s)
            if z is not None:
                f = f + loading(curve, np.sign(v) if s is None else s) * np.abs(z[:, k])
            total += np.outer(f, row)
        return total

    def carried_torque(
        self,
        robot: Robot,
        q: Array,
        dq: Array,
        tau: Array,
        direction: Array | None = None,
        temperature: Array | None = None,
    ) -> Array:
        """Joint torques without friction, from those with it; with these as load, `joint_torque` is the difference."""
        rest = tau - self.joint_torque(robot, q, dq, direction, temperature)
        if not self.loaded:
            return np.asarray(rest)
        z = rest @ torques_at_drives(robot).T
        for k, _, curve, row in self._of_drives(robot):
            z[:, k] = carried(z[:, k], loading(curve, np.sign(dq @ row) if direction is None else direction[:, k]))
        return np.asarray(z @ friction_rows(robot))

    def joint_expression(self, robot: Robot, dq: ca.SX, direction: ca.SX, load: ca.SX | None = None) -> ca.SX:
        """``C' f(C dq)`` as an expression, see `joint_torque`."""  # dq, load (n, 1); direction (k, 1)
        self.check(robot)
        total = ca.SX.zeros(robot.n, 1)
        z = None if load is None or not self.loaded else ca.mtimes(sparse(torques_at_drives(robot)), load)
        for k, _, curve, row in self._of_drives(robot):
            f = curve.expression(ca.mtimes(sparse(row[None]), dq), direction[k])
            if z is not None:
                f += loading(curve, direction[k]) * ca.fabs(z[k])
            total += sparse(row[:, None]) * f
        return total

    def carried_expression(self, robot: Robot, dq: ca.SX, tau: ca.SX, direction: ca.SX) -> ca.SX:
        """Joint torques without friction as an expression, see `carried_torque`."""  # dq, tau (n, 1)
        rest = tau - self.joint_expression(robot, dq, direction)
        if not self.loaded:
            return rest
        z = ca.mtimes(sparse(torques_at_drives(robot)), rest)
        for k, _, curve, _ in self._of_drives(robot):
            z[k] = carried_expression(z[k], loading(curve, direction[k]))
        return ca.mtimes(sparse(friction_rows(robot).T), z)

    def _of_drives(self, robot: Robot) -> Iterator[tuple[int, str, FrictionCurve, Array]]:
        """Those of `drives_with_friction` that have a curve: which one, its name, its curve, and its row of C."""
        for k, (name, row) in enumerate(drives_with_friction(robot)):
            if (curve := self.curve(name)) is not None:
                yield k, name, curve, row


def _stated(value: float | None) -> float:
    return value if value is not None and np.isfinite(value) else 0.0
