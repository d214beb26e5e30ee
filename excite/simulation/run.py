"""Simulation of a robot that follows a motion: from the plant to the logs."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace as with_truth
from typing import TYPE_CHECKING

import numpy as np

from excite.estimates.work_prediction import announce
from excite.information.target import friction_of_moving, moving_robot
from excite.simulation.control import ControlledRobot, TorqueLimits, controller_of
from excite.simulation.impact_pulse import Impacts
from excite.simulation.integration import Progress, SimulatedRun, simulated_run
from excite.simulation.outcome import simulation_outcome
from excite.simulation.payload import Payload, sensor_of
from excite.simulation.plant import Plant, plant_of
from excite.simulation.ramps import GivenTorque, RampedDrive, broken_loose
from excite.simulation.reference import Awaited, Reference, Repeated, check_joints
from excite.simulation.sensors import joint_log, wrench_log_of
from excite.simulation.settings import SimulationSettings, one_each
from excite.simulation.simulation import Simulation, TorqueUse, true_parameters
from excite.simulation.simulation_memory import simulation_prediction
from excite.simulation.steps import Steps, steps_for
from excite.simulation.temperature import friction_at
from regressors.errors import InputError
from regressors.friction.curves import drives_with_friction
from regressors.samples import Samples

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


def run_notes(plant: Plant, steps: Steps, samples: Samples, load: Payload | None) -> list[str]:
    """Notes on the sign change of friction, extrapolation, and the load."""
    notes = []
    if plant.friction.curves:
        notes.append(_steps_note(steps))
    notes += plant.friction.speed_notes(plant.robot, samples.dq)
    if load is not None:
        notes.append("the standard parameters of its link include the load; those of the load alone are listed too")
    return notes


def _steps_note(steps: Steps) -> str:
    """Note on the sign change of friction."""
    if steps.sticking is None:
        why = ", widened to suit the substep" if steps.widened else ""
        return f"friction changes sign within {steps.width:.3g} rad/s (m/s) of drive velocity{why}"
    why = ", widened to suit the substep" if steps.widened else ""
    return f"friction is presliding: it changes direction over {steps.sticking.distance:.3g} rad (m) of a drive{why}"


def ramp_notes(plant: Plant, samples: Samples, settings: SimulationSettings, ramps: GivenTorque | None) -> list[str]:
    """Note on the torque ramps that broke the drive loose."""
    if ramps is None:
        return []
    row = dict(drives_with_friction(plant.robot))[ramps.drive]
    loose = broken_loose(ramps.delayed(0.0), samples.time, samples.q @ row, settings.catch)
    return [
        f"{ramps.drive} was given {ramps.count} ramps of torque, each until it moves by {settings.catch:g} rad (m); "
        f"it moved in {sum(loose)} of them"
    ]


def impact_notes(settings: SimulationSettings) -> list[str]:
    """Note on each impact."""
    return [
        f"an impact of up to {one.torque:g} Nm (N) acts on {one.joint} from {one.time:g} s on for {one.duration:g} s"
        for one in settings.impact
    ]


def sensor_notes(settings: SimulationSettings) -> list[str]:
    """Note on each error of the torques and steps of the positions."""
    notes = []
    if settings.friction_drift:
        notes.append(f"friction changes by {100 * settings.friction_drift:+g} % from the first instant to the last")
    if any(gain != 1 for gain in settings.torque_gain):
        notes.append(f"measured torques are {_listed(settings.torque_gain)} times the true ones")
    if any(settings.coloured_noise):
        notes.append(
            f"torques have noise of {_listed(settings.coloured_noise)} Nm (N) below {settings.noise_corner:g} Hz"
        )
    if any(settings.position_step):
        notes.append(f"positions are in steps of {_listed(settings.position_step)} rad (m)")
    return notes


def _listed(values: Iterable[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)


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
