"""Columns of a regressor: name, unit, kind and owner (body or drive) of the parameter of each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from regressors.robot.inertia import PARAMETER_UNITS

Group = Literal["inertial", "rotor", "friction", "other"]
Drives = bool | tuple[int, ...]  # of every drive, of none, or of the drives of these numbers

MASS, FIRST_MOMENT, INERTIA = "mass", "first moment", "inertia"
ROTOR, COULOMB, VISCOUS, OFFSET = "rotor", "coulomb", "viscous", "offset"
COMBINATION = "combination"

BODY_KINDS = (MASS, FIRST_MOMENT, INERTIA)
FRICTION_KINDS = (COULOMB, VISCOUS, OFFSET)
_BODY_ORDER = (MASS, *(FIRST_MOMENT,) * 3, *(INERTIA,) * 6)
_GROUPS: dict[str, Group] = {
    **dict.fromkeys((*BODY_KINDS, COMBINATION), "inertial"),
    ROTOR: "rotor",
    **dict.fromkeys(FRICTION_KINDS, "friction"),
}


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
        ``offset`` of a drive; ``combination`` for one that the robot's structure names; or a kind that a model defines.
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


def body_columns(names: tuple[str, ...], owner: int | None) -> tuple[Column, ...]:
    """Ten inertial parameters of one body, in the order of ``theta``, see `regressors.robot.inertia`.

    Parameters
    ----------
    names : tuple of str, length 10
    owner : int or None
        Number of the body; None for a load.
    """
    parts = zip(names, PARAMETER_UNITS, _BODY_ORDER, strict=True)
    return tuple(Column(name, unit, kind, owner) for name, unit, kind in parts)


def includes(drives: Drives, number: int) -> bool:
    """True if the drive of a number is among those that have a column.

    Parameters
    ----------
    drives : bool or tuple of int
    number : int
        Number of the drive, the owner of its columns.
    """
    return drives if isinstance(drives, bool) else number in drives


@dataclass(frozen=True)
class Terms:
    """Optional columns of a model beside the links' inertial parameters.

    Parameters
    ----------
    rotor : bool
        Rotor inertia of each drive, ``Ia``.
    coulomb, viscous, offset : bool or tuple of int
        Friction of each drive, or of the drives of these numbers only, ``F.c sign(dz) + F.v dz + F.o``.
    reflected : bool
        Rotor inertias as parameters at the drive coordinate, ``Iar = n^2 Ia``, with the gear's reference ratio n;
        else the motors' own, ``Ia``, whose columns are n^2 times as large as those of links.
    """

    rotor: bool = True
    coulomb: Drives = True
    viscous: Drives = True
    offset: Drives = False
    reflected: bool = True

    @classmethod
    def inertial_only(cls) -> Terms:
        """The links' inertial parameters and nothing else."""
        return cls(rotor=False, coulomb=False, viscous=False, offset=False)
