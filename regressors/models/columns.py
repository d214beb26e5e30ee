"""Columns of a regressor: the parameters that they belong to, with units and groups."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Group = Literal["inertial", "rotor", "friction"]


@dataclass(frozen=True)
class Column:
    """One parameter of a model.

    Parameters
    ----------
    name : str
        Such as ``I3yy``, ``m3c3x``, ``Ia2``, ``F1c``.
    unit : str
        SI unit of the parameter.
    group : {"inertial", "rotor", "friction"}
        What the parameter describes.
    """

    name: str
    unit: str
    group: Group


@dataclass(frozen=True)
class Terms:
    """Which optional columns a model has beside the links' inertial parameters.

    Parameters
    ----------
    rotor : bool
        Rotor inertia of each drive, ``Ia``.
    coulomb, viscous, offset : bool
        Friction of each drive, ``F.c sign(dz) + F.v dz + F.o``.
    """

    rotor: bool = True
    coulomb: bool = True
    viscous: bool = True
    offset: bool = False

    @classmethod
    def inertial_only(cls) -> Terms:
        """The links' inertial parameters and nothing else."""
        return cls(rotor=False, coulomb=False, viscous=False, offset=False)
