"""Values of a model's parameters from the robot's description."""

from __future__ import annotations

import numpy as np

from regressors.models.base import Base
from regressors.models.columns import COULOMB, OFFSET, ROTOR, VISCOUS
from regressors.models.drives import drive_column
from regressors.models.model import RegressorModel
from regressors.robot.inertia import parameter_names
from regressors.robot.robot import Drive, Robot
from regressors.samples import Array


def standard_values(robot: Robot) -> dict[str, float]:
    """Every standard parameter that the description states, by name."""
    values: dict[str, float] = {}
    for number, body in zip(robot.body_numbers, robot.bodies, strict=True):
        if body.theta is not None:
            values.update(zip(parameter_names(number), body.theta.tolist(), strict=True))
    drives = () if robot.transmission is None else robot.transmission.drives
    for number, drive in enumerate(drives, 1):
        values.update(_drive_values(number, drive))
    return values


def _drive_values(number: int, drive: Drive) -> dict[str, float]:
    known = {ROTOR: drive.rotor_inertia, COULOMB: drive.coulomb, VISCOUS: drive.viscous}
    stated = {kind: value for kind, value in known.items() if value is not None and np.isfinite(value)}
    return {drive_column(number, kind).name: value for kind, value in stated.items()}


def parameter_values(model: RegressorModel, base: Base, known: dict[str, float]) -> Array:
    """Base parameters ``beta = D p`` from standard ones; NaN where a contributing standard parameter is unknown.

    Friction offsets that are not stated count as zero.
    """
    definition, names = model.definition()
    given = {**{column.name: 0.0 for column in model.standard_columns if column.kind == OFFSET}, **known}
    theta = np.array([given.get(name, np.nan) for name in names])
    combined = base.D @ definition
    unknown = np.isnan(theta)
    values = combined @ np.where(unknown, 0.0, theta)
    return np.asarray(np.where(np.any(combined[:, unknown] != 0.0, axis=1), np.nan, values))
