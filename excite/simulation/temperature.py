"""Friction of a simulated robot at the temperatures of its joints."""

from __future__ import annotations

import numpy as np

from excite.simulation.settings import SimulationSettings, one_each
from regressors.friction.curves import FrictionCurves, drive_temperatures, drives_with_friction
from regressors.friction.temperature import temperature_notes
from regressors.robot.robot import Robot
from regressors.samples import Array


def joint_temperatures(settings: SimulationSettings, robot: Robot) -> Array | None:
    """Temperature of every moving joint, where one is set, shape (n,) [deg C]."""
    if settings.temperature is None:
        return None
    return np.array(one_each(settings.temperature, robot.n, "temperature"), dtype=float)


def friction_at(
    friction: FrictionCurves | None, settings: SimulationSettings, robot: Robot
) -> tuple[FrictionCurves | None, tuple[str, ...]]:
    """Curves at the set temperatures, or else at their reference temperatures, with notes."""
    joints = joint_temperatures(settings, robot)
    if friction is None:
        return None, ()
    names = [name for name, _ in drives_with_friction(robot) if friction.curve(name) is not None]
    known = {}
    if joints is not None:
        all_drives = zip(drives_with_friction(robot), drive_temperatures(robot, joints[None])[0].tolist(), strict=True)
        known = {name: value for (name, _), value in all_drives if name in names}
    curves = {name: curve for name in names if (curve := friction.curve(name)) is not None}
    return friction.at(known), temperature_notes(curves, known)
