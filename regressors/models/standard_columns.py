"""Standard parameters of a robot: ten of every body, and those of its drives."""

from __future__ import annotations

from regressors.models.columns import FRICTION_KINDS, ROTOR, Column, body_columns
from regressors.models.drives import drive_column, drive_rows
from regressors.robot.inertia import parameter_names
from regressors.robot.robot import Robot


def inertial_columns(robot: Robot) -> tuple[Column, ...]:
    """Standard inertial parameters of every body: links, then branches."""
    return tuple(column for number in robot.body_numbers for column in body_columns(parameter_names(number), number))


def standard_columns(robot: Robot) -> tuple[Column, ...]:
    """Every standard parameter that a robot can have, with all terms and all drives, moving or locked."""
    kinds = (ROTOR, *FRICTION_KINDS)
    drives = (drive_column(number, kind) for number in drive_rows(robot) for kind in kinds)
    return (*inertial_columns(robot), *drives)
