"""Columns of a regressor: name, unit, kind and owner (body or drive) of the parameter of each."""

from __future__ import annotations

import math
from collections.abc import Container
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Literal

from regressors.arguments import checked
from regressors.errors import InputError
from regressors.robot.inertia import PARAMETER_UNITS

Group = Literal["inertial", "rotor", "friction", "other"]
Drives = bool | tuple[int, ...]
"""Drives that have a column: all of them, none, or those of some numbers, the owners of their columns."""

MASS, FIRST_MOMENT, INERTIA = "mass", "first moment", "inertia"
ROTOR, COULOMB, VISCOUS, OFFSET = "rotor", "coulomb", "viscous", "offset"
LOAD_SHARE, ROOT, ASYMMETRY, STRIBECK = "load share", "root", "asymmetry", "stribeck"
COMBINATION = "combination"

BODY_KINDS = (MASS, FIRST_MOMENT, INERTIA)
FRICTION_KINDS = (COULOMB, VISCOUS, OFFSET, LOAD_SHARE, ROOT, ASYMMETRY, STRIBECK)
DIRECTED_KINDS = (COULOMB, LOAD_SHARE, ROOT, STRIBECK)  # friction against the direction of motion, at any speed
_BODY_ORDER = (MASS, *(FIRST_MOMENT,) * 3, *(INERTIA,) * 6)
_GROUPS: dict[str, Group] = {
    **dict.fromkeys((*BODY_KINDS, COMBINATION), "inertial"),
    ROTOR: "rotor",
    **dict.fromkeys(FRICTION_KINDS, "friction"),
}


@checked
@dataclass(frozen=True)
class Column:
    """One parameter of a model.

    Parameters
    ----------
    name : str
        Name, such as ``I3yy``, ``m3c3x``, ``Ia2``, ``F1c``. For display only: `kind` and `owner` state what the
        parameter is.
    unit : str
        SI unit of the parameter.
    kind : str
        Kind of quantity: ``mass``, ``first moment``, ``inertia`` of a body; ``rotor``, ``coulomb``, ``viscous``,
        ``offset``, ``load share``, ``root``, ``asymmetry``, ``stribeck`` of a drive; ``combination`` for one that the
        robot's structure names; or a kind that a model defines.
    owner : int, optional
        Number of the body or the drive; None for a load, a combination, and what belongs to neither.
    """

    name: str
    unit: str
    kind: str
    owner: int | None = None

    @property
    def group(self) -> Group:
        """Group in which the parameter is listed: ``inertial``, ``rotor``, ``friction``, or ``other``."""
        return _GROUPS.get(self.kind, "other")


@cache
def body_columns(names: tuple[str, ...], owner: int | None) -> tuple[Column, ...]:
    """Ten inertial parameters of one body, in the order of ``theta``, see `regressors.robot.inertia`."""
    parts = zip(names, PARAMETER_UNITS, _BODY_ORDER, strict=True)
    return tuple(Column(name, unit, kind, owner) for name, unit, kind in parts)


_DRIVE_COLUMNS = {
    ROTOR: ("Ia{}", "kg m^2", "kg m^2"),  # the motor rotates also where the joint is prismatic
    COULOMB: ("F{}c", "Nm", "N"),
    VISCOUS: ("F{}v", "Nm s/rad", "N s/m"),
    OFFSET: ("F{}o", "Nm", "N"),
    LOAD_SHARE: ("F{}l", "Nm/Nm", "N/N"),
    ROOT: ("F{}r", "Nm (s/rad)^0.5", "N (s/m)^0.5"),
    ASYMMETRY: ("F{}a", "Nm s/rad", "N s/m"),
    STRIBECK: ("F{}s", "Nm", "N"),
}


@cache
def drive_column(number: int, kind: str, *, linear: bool = False) -> Column:
    """Column of a drive."""
    name, *units = _DRIVE_COLUMNS[kind]
    return Column(name.format(number), units[linear], kind, number)


@checked
@dataclass(frozen=True)
class Terms:
    """Optional columns of a model beside the links' inertial parameters.

    The friction of each drive is ``F.c s + F.v dz + F.o + F.l |tau| s + F.r sqrt|dz| s + F.a |dz| +
    F.s exp(-(dz/v)^2) s`` with the direction of motion ``s = sign(dz)`` and the torque tau that the drive carries: of
    every drive, of none, or of the drives of some numbers.
    """

    rotor: bool = True  # rotor inertia of each drive, ``Ia``
    coulomb: Drives = True  # ``F.c`` [Nm]
    viscous: Drives = True  # ``F.v`` [Nm s/rad]
    offset: Drives = False  # ``F.o`` [Nm]
    # rotor inertias as parameters at the drive coordinate, ``Iar = n^2 Ia``, with the gear's reference ratio n; else
    # the motors' own, ``Ia``, whose columns are n^2 times as large as those of links
    reflected: bool = True
    # ``F.l`` [Nm/Nm], see `regressors.robot.friction.load_and_temperature.Loaded`. The carried torque is that of bodies
    # and rotors with known parameters, see `DifferentialModel`
    load_share: Drives = False
    root: Drives = False  # ``F.r``, friction that grows with the root of the speed, as of lubricants [Nm (s/rad)^0.5]
    asymmetry: Drives = False  # ``F.a``, half the difference of the viscous friction in the two directions [Nm s/rad]
    stribeck: Drives = False  # ``F.s``, friction beyond Coulomb's near standstill [Nm]
    stribeck_speed: float = 0.1  # v, > 0, at which that friction has fallen to 1/e [rad/s or m/s]

    def __post_init__(self) -> None:
        for name in _SELECTIONS:
            object.__setattr__(self, name, _selection(name, getattr(self, name)))
        if not (math.isfinite(self.stribeck_speed) and self.stribeck_speed > 0):
            raise InputError(f"stribeck_speed must be a velocity greater than zero, given {self.stribeck_speed}")

    @classmethod
    def inertial_only(cls) -> Terms:
        """The links' inertial parameters and nothing else."""
        return cls(rotor=False, coulomb=False, viscous=False, offset=False)

    def include(self, kind: str, number: int) -> bool:
        """Whether a drive has a column of some kind, one of `FRICTION_KINDS` or ``rotor``."""
        chosen: Drives = getattr(self, kind.replace(" ", "_"))
        return chosen if isinstance(chosen, bool) else number in chosen

    @property
    def numbers(self) -> tuple[int, ...]:
        """Drives that are chosen by number, in ascending order."""
        chosen = (getattr(self, name) for name in _SELECTIONS)
        return tuple(sorted({number for one in chosen if not isinstance(one, bool) for number in one}))

    def among(self, numbers: Container[int]) -> Terms:
        """The same terms without the drives of other numbers, such as those behind locked joints."""
        chosen = ((name, getattr(self, name)) for name in _SELECTIONS)
        by_number = ((name, one) for name, one in chosen if not isinstance(one, bool))
        left: dict[str, Any] = {name: tuple(k for k in one if k in numbers) for name, one in by_number}
        return replace(self, **left)


_SELECTIONS = ("coulomb", "viscous", "offset", "load_share", "root", "asymmetry", "stribeck")


def _selection(name: str, chosen: Drives) -> Drives:
    if isinstance(chosen, bool):
        return chosen
    if any(k < 1 for k in chosen):
        raise InputError(f"{name}: expected true, false, or numbers of drives from 1 on, given {chosen!r}")
    return tuple(sorted({int(k) for k in chosen})) or False
