"""The model that an identification result stands for, as bodies, drives and parameters that files can hold.

Of each drive the rotor inertia and the friction, and what of the friction is more than Coulomb and viscous. The
friction of a drive is ``F.c sign(dz) + F.v dz + ...`` (`regressors.robot.columns.Terms`), from the columns of the
model or from the known curve that was subtracted from the torques. A feature is what a model consists of beyond rigid
bodies of a chain, as a format may or may not be able to express it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from excite.information.target import IdentificationTarget
from regressors.robot.closures import Closure
from regressors.robot.columns import (
    ASYMMETRY,
    COULOMB,
    FRICTION_KINDS,
    LOAD_SHARE,
    OFFSET,
    ROOT,
    ROTOR,
    STRIBECK,
    VISCOUS,
    drive_column,
)
from regressors.robot.friction.curve import CoulombViscous, FrictionCurve, Scaled, Stribeck
from regressors.robot.friction.load_and_temperature import Loaded, Warm
from regressors.robot.gears import ConstantRatio, GearFunction
from regressors.robot.inertia import parameter_names
from regressors.robot.robot import Robot
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
    coulomb, viscous, beyond = _plain(curve, fastest)
    return replace(drive, coulomb=coulomb, viscous=viscous, beyond={k: v for k, v in beyond.items() if v is not None})


_Plain = tuple[float, float, dict[str, float | None]]


def _plain(curve: FrictionCurve | Callable[[Array], Array], fastest: float) -> _Plain:
    """Coulomb and viscous part of a curve at its reference temperature, and the rest by kind."""
    if isinstance(curve, CoulombViscous):
        return curve.coulomb, curve.viscous, {OFFSET: curve.offset or None}
    if isinstance(curve, Loaded | Warm | Scaled):
        coulomb, viscous, beyond = _plain(curve.curve, fastest)
        if isinstance(curve, Loaded):
            return coulomb, viscous, {**beyond, LOAD_SHARE: curve.forward}
        if isinstance(curve, Warm):
            return coulomb, viscous, {**beyond, TEMPERATURE: curve.forward.viscous}
        scaled = {kind: None if value is None else curve.factor * value for kind, value in beyond.items()}
        return curve.factor * coulomb, curve.factor * viscous, scaled
    if isinstance(curve, Stribeck):
        ahead, behind = curve.forward, curve.backward
        beyond = {
            STRIBECK: (ahead.drop + behind.drop) / 2 or None,
            OFFSET: curve.offset + (ahead.coulomb - behind.coulomb) / 2 or None,
            ASYMMETRY: (ahead.viscous - behind.viscous) / 2 or None,
        }
        return (ahead.coulomb + behind.coulomb) / 2, (ahead.viscous + behind.viscous) / 2, beyond
    # a table: Coulomb and viscous friction nearest it, in both directions up to the velocity limit
    speed = np.linspace(0.05, 1.0, _SPEEDS) * (fastest if np.isfinite(fastest) else _FASTEST)
    torque = curve.torque if isinstance(curve, FrictionCurve) else curve
    mean = (np.asarray(torque(speed)) - np.asarray(torque(-speed))) / 2
    coulomb, viscous = np.linalg.lstsq(np.column_stack([np.ones_like(speed), speed]), mean, rcond=None)[0]
    return max(float(coulomb), 0.0), float(viscous), {TABLE: 0.0}


COUPLED, VARYING, BRANCHES, FURTHER = "coupled drives", "varying gear", "branches", "further parameters"
LOOPS = "closed loops"
_TEXTS = {
    LOOPS: "what closes its loops ({}): they are open in it",
    BRANCHES: "the bodies beside the chain ({})",
    ROTOR: "rotor inertias ({})",
    VARYING: "rotor inertias behind gears of varying ratio ({})",
    COUPLED: "drives that move several joints, with their rotor inertia and friction ({})",
    COULOMB: "Coulomb friction ({})",
    VISCOUS: "viscous friction ({})",
    OFFSET: "friction offsets, which differ between the two directions ({})",
    LOAD_SHARE: "friction that grows with the load ({})",
    ROOT: "friction that grows with the root of the speed ({})",
    ASYMMETRY: "viscous friction that differs between the two directions ({})",
    STRIBECK: "Stribeck friction ({})",
    TEMPERATURE: "friction that depends on temperature ({}; at its reference temperature it is written)",
    TABLE: "friction curves that are tables ({}; the Coulomb and viscous friction nearest them is written)",
    FURTHER: "the parameters {} of the model",
}
_NOTHING = 1e-9  # of the torques: rounding, or a parameter at its bound of zero
_OF_CURVES = (TEMPERATURE, TABLE)
LISTED = frozenset(_TEXTS) - {TEMPERATURE, TABLE}
"""Kinds whose parameters a table can list."""


@dataclass(frozen=True)
class Feature:
    """Something that a model has."""

    kind: str  # of parameters of drives, see `regressors.robot.columns`, or one of this module
    owners: tuple[str, ...]  # drives, bodies or parameters that have it
    share: float | None = None  # its torque over that of the whole model, on random states; None if not known

    @property
    def text(self) -> str:
        """What it is, with its owners and its share."""
        share = "" if self.share is None else f"; {100 * self.share:.2g} % of the torques on random states"
        return _TEXTS[self.kind].format(", ".join(self.owners)) + share


def features_of(
    robot: Robot, drives: Iterable[ModelDrive], shares: Mapping[str, float], further: tuple[str, ...]
) -> tuple[Feature, ...]:
    """Features of a model that have a torque, each kind once."""
    owners, parameters = (dict[str, list[str]]((kind, []) for kind in _TEXTS) for _ in range(2))
    owners[LOOPS] = [" to ".join(closure.bodies) for closure in robot.closures if isinstance(closure, Closure)]
    for number, branch in zip(robot.body_numbers[robot.n :], robot.branches, strict=True):
        owners[BRANCHES].append(branch.name)
        parameters[BRANCHES] += parameter_names(number)
    for drive in drives:
        for kind, names in _of_drive(drive).items():
            owners[kind].append(drive.name)
            parameters[kind] += names
    owners[FURTHER], parameters[FURTHER] = list(further), list(further)
    found = [Feature(k, tuple(owners[k]), _sum(k, parameters[k], shares)) for k in _TEXTS if owners[k]]
    return tuple(feature for feature in found if feature.share is None or feature.share > _NOTHING)


def _of_drive(drive: ModelDrive) -> dict[str, list[str]]:
    """Parameters of each kind that a drive has; of one that moves several joints all under one kind."""
    values = {ROTOR: drive.rotor_inertia, COULOMB: drive.coulomb, VISCOUS: drive.viscous}
    names = {kind: [drive_column(drive.number, kind).name] for kind, value in values.items() if value}
    known = [kind for kind in BEYOND if kind in drive.beyond]
    beyond = {kind: [] if kind in _OF_CURVES else [drive_column(drive.number, kind).name] for kind in known}
    if drive.joint is None:
        return {COUPLED: [name for own in names.values() for name in own], **beyond} if names else beyond
    if drive.ratio is None and ROTOR in names:
        names[VARYING] = names.pop(ROTOR)
    return {**names, **beyond}


def _sum(kind: str, parameters: list[str], shares: Mapping[str, float]) -> float | None:
    """Root of the sum of squares: parameters of different joints and bodies have torques of their own."""
    known = [shares[name] for name in parameters if name in shares]
    return sum(share**2 for share in known) ** 0.5 if known and kind not in _OF_CURVES else None


@dataclass(frozen=True)
class IdentifiedParameter:
    """One base parameter of a result."""

    name: str
    expression: str
    unit: str
    value: float  # as used for predictions
    deviation: float | None  # standard deviation; None where it is not known
    interval: tuple[float, float] | None  # 99 % confidence interval


@dataclass(frozen=True, eq=False)
class DrivenRobot:
    """A robot as files of simulators hold it: bodies, drives and limits."""

    robot: Robot  # the whole one, with the identified bodies, drives and limits in the place of the described ones
    described: Robot  # as its description says
    composites: Mapping[str, Array]  # (10,) of each moving body with all that moves with it, by the name of the link
    # of every body of the robot: the one that it moved with, and its pose in that one's frame, see `carriers`
    carriers: tuple[tuple[int | None, Array], ...]
    drives: tuple[ModelDrive, ...]
    program: str  # name and version of this program

    def joint_drives(self, joint: int) -> tuple[ModelDrive, ...]:
        """Drives that move one joint of the robot, stated by its index, and no other."""
        return tuple(drive for drive in self.drives if drive.joint == joint)

    def armature(self, joint: int) -> float | None:
        """Rotor inertia at a joint, ``(ratio factor)^2 Ia`` [kg m^2 or kg]; None where none is known."""
        return _sum_of_known((d.factor**2, d.reflected) for d in self.joint_drives(joint))

    def damping(self, joint: int) -> float | None:
        """Viscous friction at a joint [Nm s/rad or N s/m]; None where none is known."""
        return _sum_of_known((d.factor**2, d.viscous) for d in self.joint_drives(joint))

    def friction(self, joint: int) -> float | None:
        """Coulomb friction at a joint [Nm or N]; None where none is known."""
        return _sum_of_known((abs(d.factor), d.coulomb) for d in self.joint_drives(joint))


@dataclass(frozen=True, eq=False)
class IdentifiedModel(DrivenRobot):
    """An identified robot."""

    target: IdentificationTarget  # the moving robot, with the model at single instants
    coefficients: Array  # (b,) base parameters
    standard: Mapping[str, float]  # standard parameters of the moving robot for them, see `nearest_bodies`
    parameters: tuple[IdentifiedParameter, ...]
    features: tuple[Feature, ...]
    change: float  # relative, of the predicted torques by the bodies' physical consistency, over random states
    sha256: str | None  # of ``result.json``; None for a result that was not saved
    training_error: float | None
    notes: tuple[str, ...]

    @property
    def moving(self) -> tuple[str, ...]:
        """Names of the joints that moved, from base to tip."""
        return self.target.robot.joint_names


def _sum_of_known(parts: Iterable[tuple[float, float | None]]) -> float | None:
    known = [factor * value for factor, value in parts if value is not None]
    return sum(known) if known else None
