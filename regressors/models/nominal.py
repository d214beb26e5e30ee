"""Values of parameters from the robot's description, deviations from a relative uncertainty, values at the motor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regressors.models.base import Base
from regressors.models.model import RegressorModel
from regressors.robot.columns import COULOMB, OFFSET, ROTOR, VISCOUS, drive_column
from regressors.robot.inertia import inertia_tensor, parameter_names
from regressors.robot.robot import Robot, drive_numbers, transmission_of
from regressors.samples import Array


def standard_values(robot: Robot) -> dict[str, float]:
    """Every standard parameter that the description states, by name."""
    values: dict[str, float] = {}
    for number, body in zip(robot.body_numbers, robot.bodies, strict=True):
        if body.theta is not None:
            values.update(zip(parameter_names(number), body.theta.tolist(), strict=True))
    for number, drive in zip(drive_numbers(robot), transmission_of(robot).drives, strict=True):
        for kind, value in ((ROTOR, drive.rotor_inertia), (COULOMB, drive.coulomb), (VISCOUS, drive.viscous)):
            if value is not None and np.isfinite(value):
                values[drive_column(number, kind).name] = value
    return values


def parameter_values(model: RegressorModel, base: Base, known: dict[str, float]) -> Array:
    """Base parameters ``beta = D p``, offsets zero where not stated; NaN where a contributing parameter is unknown."""
    definition, names = model.definition()
    given = {**{column.name: 0.0 for column in model.standard_columns if column.kind == OFFSET}, **known}
    theta = np.array([given.get(name, np.nan) for name in names])
    combined = base.D @ definition
    unknown = np.isnan(theta)
    values = combined @ np.where(unknown, 0.0, theta)
    return np.asarray(np.where(np.any(combined[:, unknown] != 0.0, axis=1), np.nan, values))


def stated_deviations(robot: Robot, relative: float) -> dict[str, float]:
    """Deviations of the standard parameters that a description states, relative to the quantities they belong to.

    The deviation of a link's mass is ``relative`` of it, that of each component of its first moment ``relative`` of the
    moment's length, that of each entry of its inertia tensor ``relative`` of the largest principal moment: a component
    that happens to be zero is not thereby exact. Rotor inertias and friction coefficients are scaled individually. A
    quantity that is stated as zero counts as unknown.
    """
    sizes = {name: abs(value) for name, value in standard_values(robot).items()}
    for number, body in zip(robot.body_numbers, robot.bodies, strict=True):
        if body.theta is not None:
            largest = float(np.abs(np.linalg.eigvalsh(inertia_tensor(body.theta))).max())
            magnitudes = [float(body.theta[0])] + 3 * [float(np.linalg.norm(body.theta[1:4]))] + 6 * [largest]
            sizes.update(zip(parameter_names(number), magnitudes, strict=True))
    return {name: relative * size for name, size in sizes.items() if size > 0.0}


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
