"""Base parameters that are reflected rotor inertias: what they amount to at the motor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regressors.models.base import Base
from regressors.models.columns import ROTOR
from regressors.models.model import RegressorModel


@dataclass(frozen=True)
class MotorSide:
    """The rotor inertia behind a base parameter, ``parameter = factor * rotor inertia``."""

    name: str  # of the rotor inertia, such as ``Ia4`` [kg m^2]
    unit: str
    factor: float  # square of the gear's reference ratio


def motor_sides(model: RegressorModel, base: Base) -> dict[str, MotorSide]:
    """Rotor inertias of the base parameters that consist of one alone, seen through a gear, by the parameter's name."""
    definition, standard = model.definition()[0], model.standard_columns
    found = {}
    for name, row in zip(base.names, base.D @ definition, strict=True):
        terms = np.flatnonzero(row)
        if terms.size == 1 and (column := standard[terms[0]]).kind == ROTOR and row[terms[0]] != 1.0:
            found[name] = MotorSide(column.name, column.unit, float(row[terms[0]]))
    return found
