"""Logs of a simulated run, from the sensors of the joints and of the wrist."""

from __future__ import annotations

import numpy as np

from excite.logs.log import Log
from excite.simulation.integration import SimulatedRun
from excite.simulation.payload import Payload, sensor_of
from excite.simulation.reference import SampledMotion
from excite.simulation.sensors import noisy, quantised, sensed_torques, stepped
from excite.simulation.settings import SimulationSettings
from excite.simulation.temperature import joint_temperatures
from excite.tasks.task import Task
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

SOURCE = "simulated"


def joint_log(robot: Robot, run: SimulatedRun, settings: SimulationSettings, rng: np.random.Generator) -> Log:
    """Positions by encoders, velocities by tachometers, and torques of the moving joints with noise; temperatures.

    Drift, gain and slow noise of the torques come before their white noise, steps of positions after theirs.
    """
    q = run.samples.q if settings.encoder is None else quantised(robot, run.samples.q, settings.encoder)
    temperature = joint_temperatures(settings, robot)
    effort = sensed_torques(run.samples.time, run.effort, run.friction, settings)
    return Log(
        source=SOURCE,
        sha256="",
        joints=robot.joint_names,
        time=run.samples.time,
        q=stepped(noisy(q, settings.position_noise, "position_noise", rng), settings.position_step),
        dq=noisy(run.samples.dq, settings.velocity_noise, "velocity_noise", rng),
        effort=noisy(effort, settings.torque_noise, "torque_noise", rng),
        temperature=None if temperature is None else np.tile(temperature, (run.samples.time.size, 1)),
    )


def wrench_log_of(
    robot: Robot,
    moving: Robot,
    task: Task,
    load: Payload,
    samples: Samples,
    settings: SimulationSettings,
    rng: np.random.Generator,
) -> Log:
    """Wrench and positions at the sensor's own instants; locked joints are measured at their position."""
    count = int(np.floor(samples.time[-1] * settings.wrench_rate * (1 + 1e-12)))
    true = SampledMotion(samples).samples(np.arange(count + 1) / settings.wrench_rate)
    whole = _whole(task.limits.applied(robot), moving, true)
    q = true.q if settings.encoder is None else quantised(moving, true.q, settings.encoder)
    measured = _whole(task.limits.applied(robot), moving, _replaced(true, noisy(q, settings.position_noise, "", rng)))
    deviation = settings.wrench_noise if len(settings.wrench_noise) == 6 else np.repeat(settings.wrench_noise, 3)
    wrench = load.wrench(robot, sensor_of(task), whole)
    return Log(
        source=SOURCE,
        sha256="",
        joints=robot.joint_names,
        time=true.time,
        q=measured.q,
        wrench=noisy(wrench, tuple(map(float, deviation)), "wrench_noise", rng),
    )


def _replaced(samples: Samples, q: Array) -> Samples:
    return Samples(samples.time, q, samples.dq, samples.ddq, samples.dddq)


def _whole(robot: Robot, moving: Robot, samples: Samples) -> Samples:
    """Motion of all joints from that of the moving ones; the others rest at zero, or at the nearest limit."""
    index = [robot.joint_index(name) for name in moving.joint_names]
    rest = np.clip(np.zeros(robot.n), robot.limits.lower, robot.limits.upper)

    def spread(values: Array, elsewhere: Array) -> Array:
        table = np.tile(elsewhere, (values.shape[0], 1))
        table[:, index] = values
        return table

    still = np.zeros(robot.n)
    rates = (spread(x, still) for x in (samples.dq, samples.ddq, samples.dddq))
    return Samples(samples.time, spread(samples.q, rest), *rates)
