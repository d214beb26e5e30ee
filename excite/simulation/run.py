"""Simulation of a robot that follows a motion: from the plant to the logs."""

from __future__ import annotations

import math
from dataclasses import replace as with_truth
from typing import TYPE_CHECKING

import numpy as np

from excite.estimates.long_work import announce
from excite.information.target import friction_of_moving, moving_robot
from excite.simulation.control import TorqueLimits
from excite.simulation.impact_pulse import Impacts
from excite.simulation.integration import Progress, SimulatedRun, simulated_run
from excite.simulation.measured import joint_log, wrench_log_of
from excite.simulation.outcome import simulation_outcome
from excite.simulation.payload import Payload, sensor_of
from excite.simulation.plant import plant_of
from excite.simulation.reference import Awaited, Reference, Repeated
from excite.simulation.robot_under_control import controlled_robot
from excite.simulation.run_notes import impact_notes, ramp_notes, run_notes, sensor_notes
from excite.simulation.settings import SimulationSettings, one_each
from excite.simulation.simulation import Simulation, TorqueUse
from excite.simulation.simulation_memory import simulation_prediction
from excite.simulation.steps import steps_for
from excite.simulation.temperature import friction_at
from excite.simulation.true_values import true_parameters
from regressors.errors import InputError

if TYPE_CHECKING:
    from excite.simulation.ramps import GivenTorque
    from excite.tasks.task import Task
    from regressors.friction.curves import FrictionCurves
    from regressors.robot.robot import Robot

_SETTLING = 2.0  # periods of the controlled joints' natural frequency before the motion begins


def simulate_motion(
    robot: Robot,
    task: Task,
    motion: Reference,
    settings: SimulationSettings | None = None,
    *,
    friction: FrictionCurves | None = None,
    load: Payload | None = None,
    ramps: GivenTorque | None = None,
    progress: Progress | None = None,
) -> Simulation:
    """Simulate a robot that follows a motion, and its sensors.

    Where the motion starts at rest, the robot settles at its start before the run begins.
    """
    settings = settings if settings is not None else SimulationSettings()
    sensor = sensor_of(task)
    loaded = robot if load is None else load.on(robot, sensor)
    moving, bare = moving_robot(loaded, task), moving_robot(robot, task)
    _check_counts(settings, moving.n)
    friction = None if friction is None else friction_of_moving(friction, robot, moving)
    friction, temperature_notes = friction_at(friction, settings, moving)
    reference, lead = Repeated(motion, settings.periods), _lead(motion, settings)
    seconds = reference.duration + lead / settings.rate
    predicted = simulation_prediction(settings, seconds, moving.n, wrench=load is not None)
    predicted.check()
    announce("the simulation", predicted.seconds or 0.0)
    plant, notes = plant_of(moving, friction)
    notes = (*temperature_notes, *notes)
    if ramps is not None and settings.periods > 1:
        raise InputError(f"torque ramps are played once, given {settings.periods} periods")
    controlled = controlled_robot(plant, plant_of(bare, friction)[0], motion, settings, ramps)
    steps = steps_for(controlled, motion, settings.rate, settings.sign_width, settings.breakaway)
    wait = lead / settings.rate
    awaited, delayed = Awaited(reference, wait) if lead else reference, None if ramps is None else ramps.delayed(wait)
    impacts = Impacts(moving, settings.impact, wait) if settings.impact else None
    simulated = simulated_run(controlled, awaited, settings.rate, steps, progress, delayed, impacts).after(lead)
    rng = np.random.default_rng(settings.seed)
    log = joint_log(moving, simulated, settings, rng)
    wrench_log = None if load is None else wrench_log_of(loaded, moving, task, load, simulated.samples, settings, rng)
    truth = {**true_parameters(plant), **({} if load is None else load.values())}
    wanted = reference.samples(np.minimum(simulated.samples.time, reference.duration))
    outcome = simulation_outcome(
        moving,
        wanted,
        simulated.samples,
        simulated.command,
        limited=settings.torque_limits,
        pushed=ramps is not None,
    )
    return Simulation(
        robot=moving,
        settings=settings,
        steps=steps,
        reference=wanted,
        run=simulated,
        log=with_truth(log, truth=truth, saturated=outcome.saturated),
        wrench_log=None if wrench_log is None else with_truth(wrench_log, truth=truth),
        truth=truth,
        torques=_torques(TorqueLimits(moving), simulated),
        outcome=outcome,
        notes=(
            *notes,
            *run_notes(plant, steps, simulated.samples, load),
            *ramp_notes(plant, simulated.samples, settings, ramps),
            *impact_notes(settings),
            *sensor_notes(settings),
        ),
    )


def _check_counts(settings: SimulationSettings, n: int) -> None:
    """Raise `InputError` before any computation where noise, gains or steps are given for another number of joints."""
    for name in ("position_noise", "velocity_noise", "torque_noise", "torque_gain", "coloured_noise", "position_step"):
        one_each(getattr(settings, name), n, name)
    if settings.encoder is not None:
        one_each(settings.encoder, n, "encoder", "moving drive")


def _lead(motion: Reference, settings: SimulationSettings) -> int:
    """Number of settling samples before the motion, for a controller with a wrong model.

    Two periods of the controlled joints' natural frequency; none where the motion does not start at rest.
    """
    start = motion.samples(np.zeros(1))
    at_rest = np.allclose(start.dq, 0.0, atol=1e-9) and np.allclose(start.ddq, 0.0, atol=1e-6)
    return math.ceil(_SETTLING / settings.bandwidth * settings.rate) if at_rest else 0


def _torques(limits: TorqueLimits, simulated: SimulatedRun) -> tuple[TorqueUse, ...]:
    labels, torques, bounds = limits.of(simulated.command)
    magnitudes = np.abs(torques)
    return tuple(
        TorqueUse(label, float(size.max()), float(bound), int(np.count_nonzero(size > bound)))
        for label, size, bound in zip(labels, magnitudes.T, bounds, strict=True)
    )
