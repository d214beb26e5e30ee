"""``trajectory.csv``: the motion of every joint of the robot at a uniform rate, SI, floats that read back exactly."""

from __future__ import annotations

from pathlib import Path

from excite.design.design import Design
from excite.logs.csv_motion import motion_columns, write_motion_table
from regressors.samples import Array


def trajectory_columns(design: Design, speed: float = 1.0) -> tuple[list[str], Array]:
    """Header and table: ``time``, then position, velocity, acceleration of each joint.

    Locked joints are included, at their resting position; velocity and acceleration at both ends are exact zeros.
    """
    return motion_columns(design.robot.joint_names, design.sequence.sampled(speed)[0])


def write_trajectory(design: Design, path: Path, speed: float = 1.0) -> None:
    """Write the motion of a design; with approach and return, a last column ``segment`` is added."""
    samples, segments = design.sequence.sampled(speed)
    header, table = motion_columns(design.robot.joint_names, samples)
    write_motion_table(path, header, table, None if design.approach_and_return is None else segments)
