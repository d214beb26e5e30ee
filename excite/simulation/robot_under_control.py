"""The robot of a simulation under its controller, whose model may be wrong."""

from __future__ import annotations

import numpy as np

from excite.simulation.control import TorqueLimits, controller_of
from excite.simulation.controlled import ControlledRobot
from excite.simulation.plant import Plant
from excite.simulation.ramps import GivenTorque, RampedDrive
from excite.simulation.reference import Reference, check_joints
from excite.simulation.settings import SimulationSettings


def controlled_robot(
    plant: Plant, nominal: Plant, motion: Reference, settings: SimulationSettings, ramps: GivenTorque | None
) -> ControlledRobot:
    """Plant, controller with the settings' model error, torque limits, and ramps or impacts where there are any."""
    start = motion.samples(np.linspace(0.0, motion.duration, 101))
    check_joints(start, plant.robot.joint_names)
    middle = (start.q.min(axis=0) + start.q.max(axis=0)) / 2
    # separate stream: the same model error with and without noise
    model = nominal.with_errors(settings.model_error, np.random.default_rng([settings.seed, 1]))
    controller = controller_of(settings.controller, model, settings.bandwidth, middle)
    ramped = None if ramps is None else RampedDrive(model, ramps.drive, settings.catch)
    limits = TorqueLimits(plant.robot) if settings.torque_limits else None
    return ControlledRobot(plant, controller, limits, ramped, struck=bool(settings.impact))
