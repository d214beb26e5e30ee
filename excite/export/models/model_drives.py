"""Drives of an identified model: rotor inertia and friction of each, and what of it is more than Coulomb and viscous.

The friction of a drive is ``F.c sign(dz) + F.v dz + ...`` (`regressors.models.columns.Terms`), from the columns of the
model or from the known curve that was subtracted from the torques.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from regressors.friction.curves import (
    CoulombViscous,
    FrictionCurve,
    Loaded,
    Scaled,
    Stribeck,
    Warm,
)
from regressors.models.columns import (
    ASYMMETRY,
    COULOMB,
    FRICTION_KINDS,
    LOAD_SHARE,
    OFFSET,
    ROOT,
    ROTOR,
    STRIBECK,
    VISCOUS,
)
from regressors.models.drives import drive_column
from regressors.robot.gears import ConstantRatio, GearFunction
from regressors.samples import Array

TEMPERATURE, TABLE = "temperature", "table"
BEYOND = (OFFSET, LOAD_SHARE, ROOT, ASYMMETRY, STRIBECK, TEMPERATURE, TABLE)
_FASTEST = 2.0  # speed up to which a table is fitted where nothing limits it [rad/s or m/s]
_SPEEDS = 50


@dataclass(frozen=True, eq=False)
class ModelDrive:
    """One drive of an identified model."""

    number: int  # of its parameters
    name: str
    row: Array  # (n,) row of the coupling, ``dz = row @ dq``
    gear: GearFunction
    moved: bool  # True if it moved while it was identified
    rotor_inertia: float | None  # at the motor [kg m^2]; None where there is none
    coulomb: float | None  # at the drive coordinate [Nm, Nm s/rad, or with N and m]; None where the model has none
    viscous: float | None
    # what else the friction consists of, by kind, one of `BEYOND`, with its parameter
    beyond: Mapping[str, float] = field(default_factory=dict)

    @property
    def joint(self) -> int | None:
        """Index of the only joint that it moves; None where it moves several."""
        moved = np.flatnonzero(self.row)
        return int(moved[0]) if moved.size == 1 else None

    @property
    def factor(self) -> float:
        """Velocity of the drive coordinate over that of its joint, for a drive of one joint."""
        return float(self.row[self.joint]) if self.joint is not None else 1.0

    @property
    def ratio(self) -> float | None:
        """Motor radians per unit of the drive coordinate; None where the gear's ratio varies."""
        return float(self.gear.value) if isinstance(self.gear, ConstantRatio) else None

    @property
    def reflected(self) -> float | None:
        """Rotor inertia at the drive coordinate [kg m^2 or kg]; None where there is none, or the ratio varies."""
        if self.rotor_inertia is None or self.ratio is None:
            return None
        return self.ratio**2 * self.rotor_inertia


def with_parameters(drive: ModelDrive, values: Mapping[str, float]) -> ModelDrive:
    """The drive with what the standard parameters of a model say of it; what they do not contain is None."""
    own = {kind: values.get(drive_column(drive.number, kind).name) for kind in (ROTOR, *FRICTION_KINDS)}
    beyond = {kind: value for kind in BEYOND if (value := own.get(kind))}
    return replace(drive, rotor_inertia=own[ROTOR], coulomb=own[COULOMB], viscous=own[VISCOUS], beyond=beyond)


def with_curve(drive: ModelDrive, curve: FrictionCurve | Callable[[Array], Array], fastest: float) -> ModelDrive:
    """The drive with a known friction curve: its Coulomb and viscous part, and what else there is."""
    plain, beyond = _plain(curve, fastest)
    return replace(drive, coulomb=plain.coulomb, viscous=plain.viscous, beyond=beyond)


def _plain(curve: FrictionCurve | Callable[[Array], Array], fastest: float) -> tuple[CoulombViscous, dict[str, float]]:
    """Coulomb and viscous part of a curve at its reference temperature, and the rest by kind."""
    if isinstance(curve, CoulombViscous):
        return curve, {OFFSET: curve.offset} if curve.offset else {}
    if isinstance(curve, Loaded):
        inner, beyond = _plain(curve.curve, fastest)
        return inner, {**beyond, LOAD_SHARE: curve.forward}
    if isinstance(curve, Warm):
        inner, beyond = _plain(curve.curve, fastest)
        return inner, {**beyond, TEMPERATURE: curve.forward.viscous}
    if isinstance(curve, Scaled):
        inner, beyond = _plain(curve.curve, fastest)
        scaled = {kind: curve.factor * value for kind, value in beyond.items()}
        return CoulombViscous(curve.factor * inner.coulomb, curve.factor * inner.viscous), scaled
    if isinstance(curve, Stribeck):
        return _of_sides(curve)
    return _fitted(curve, fastest), {TABLE: 0.0}


def _of_sides(curve: Stribeck) -> tuple[CoulombViscous, dict[str, float]]:
    ahead, behind = curve.forward, curve.backward
    mean = CoulombViscous((ahead.coulomb + behind.coulomb) / 2, (ahead.viscous + behind.viscous) / 2)
    beyond = {
        STRIBECK: (ahead.drop + behind.drop) / 2,
        OFFSET: curve.offset + (ahead.coulomb - behind.coulomb) / 2,
        ASYMMETRY: (ahead.viscous - behind.viscous) / 2,
    }
    return mean, {kind: value for kind, value in beyond.items() if value}


def _fitted(curve: FrictionCurve | Callable[[Array], Array], fastest: float) -> CoulombViscous:
    """Coulomb and viscous friction nearest a table, in both directions up to the velocity limit."""
    speed = np.linspace(0.05, 1.0, _SPEEDS) * (fastest if np.isfinite(fastest) else _FASTEST)
    torque = curve.torque if isinstance(curve, FrictionCurve) else curve
    mean = (np.asarray(torque(speed)) - np.asarray(torque(-speed))) / 2
    coulomb, viscous = np.linalg.lstsq(np.column_stack([np.ones_like(speed), speed]), mean, rcond=None)[0]
    return CoulombViscous(max(float(coulomb), 0.0), float(viscous))
