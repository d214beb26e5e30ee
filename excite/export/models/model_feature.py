"""What a model consists of beyond rigid bodies of a chain, as a format may or may not be able to express it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from excite.export.models.model_drives import BEYOND, TABLE, TEMPERATURE, ModelDrive
from regressors.models.columns import ASYMMETRY, COULOMB, LOAD_SHARE, OFFSET, ROOT, ROTOR, STRIBECK, VISCOUS
from regressors.models.drives import drive_column
from regressors.robot.inertia import parameter_names
from regressors.robot.robot import Robot

COUPLED, VARYING, BRANCHES, FURTHER = "coupled drives", "varying gear", "branches", "further parameters"
_TEXTS = {
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
    """Something that a model has.

    Parameters
    ----------
    kind : str
        A kind of parameters of drives, see `regressors.models.columns`, or one of this module.
    owners : tuple of str
        Drives, bodies or parameters that have it.
    share : float or None
        Its torque over that of the whole model, on random states; None where it is not known.
    """

    kind: str
    owners: tuple[str, ...]
    share: float | None = None

    @property
    def text(self) -> str:
        """What it is, with its owners."""
        return _TEXTS[self.kind].format(", ".join(self.owners))


def features_of(
    robot: Robot, drives: Iterable[ModelDrive], shares: Mapping[str, float], further: tuple[str, ...]
) -> tuple[Feature, ...]:
    """Features of a model that have a torque, each kind once."""
    owners: dict[str, list[str]] = {kind: [] for kind in _TEXTS}
    parameters: dict[str, list[str]] = {kind: [] for kind in _TEXTS}
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
    beyond = {
        kind: [] if kind in _OF_CURVES else [drive_column(drive.number, kind).name]
        for kind in BEYOND
        if kind in drive.beyond
    }
    if drive.joint is None:
        return {COUPLED: [name for own in names.values() for name in own], **beyond} if names else beyond
    if drive.ratio is None and ROTOR in names:
        names[VARYING] = names.pop(ROTOR)
    return {**names, **beyond}


def _sum(kind: str, parameters: list[str], shares: Mapping[str, float]) -> float | None:
    """Root of the sum of squares: parameters of different joints and bodies have torques of their own."""
    known = [shares[name] for name in parameters if name in shares]
    return sum(share**2 for share in known) ** 0.5 if known and kind not in _OF_CURVES else None
