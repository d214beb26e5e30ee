"""Torque ramps of a drive beside a motion: a column ``DRIVE.effort``, and segments named ``stiction``."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from excite.files.sampled_motion import read_table
from excite.logs.csv_motion import SEGMENT
from excite.simulation.ramps import GivenTorque
from regressors.errors import InputError, UnknownName
from regressors.friction.curves import drives_with_friction
from regressors.robot.robot import Robot

STICTION = "stiction"
_EFFORT = ".effort"


def read_torque(path: Path, robot: Robot) -> GivenTorque | None:
    """Read the torque ramps of a file; None where it has none.

    A ramp is a stretch of rows of one segment whose name contains ``stiction``; torques elsewhere are ignored.
    """
    header, table, text = read_table(path, ("effort",), SEGMENT)
    efforts = [name for name in header if name.endswith(_EFFORT)]
    ramping = np.array([STICTION in name for name in text], dtype=bool)
    if not efforts or not ramping.any():
        return None
    if len(efforts) > 1:
        raise InputError(f"{path}: one drive at a time can be given torques, there are columns {', '.join(efforts)}")
    drive, known = efforts[0].removesuffix(_EFFORT), [name for name, _ in drives_with_friction(robot)]
    if drive not in known:
        raise UnknownName(
            f"{'drive' if robot.transmission else 'joint'} for column {efforts[0]} of {path}", drive, known
        )
    before = ["", *text[:-1]]
    begins = ramping & np.array([a != b for a, b in zip(before, text, strict=True)])
    number = np.where(ramping, np.cumsum(begins), 0)
    return GivenTorque(drive, table[:, header.index("time")], table[:, header.index(efforts[0])], number)
