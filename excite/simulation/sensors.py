"""Sensor models, and the logs of a simulated run."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import casadi as ca
import numpy as np
import scipy

from excite.logs.log import Log
from excite.simulation.control import own_drives
from excite.simulation.integration import SimulatedRun
from excite.simulation.settings import SimulationSettings, one_each
from excite.tasks.payload import Payload
from excite.tasks.reference import SampledMotion
from excite.tasks.robot_of_task import moving_robot
from excite.tasks.task import Task
from regressors.errors import InputError, listed_names
from regressors.models.load import EQUATIONS, Sensor
from regressors.models.nominal import standard_values
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.load_and_temperature import drive_temperatures, drives_with_friction, temperature_notes
from regressors.robot.gears import GearFunction
from regressors.robot.robot import Robot
from regressors.robot.symbolic.vectorised import VectorisedFunction
from regressors.samples import Array, Samples

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)
_WARMING = 2.0  # time constants of warming joints that the log lasts
_COLOURED = 2  # stream of random numbers, so that slow noise changes nothing of the others
_NEWTON = 2  # each iteration squares an error that begins as one count


def motor_angle(gear: GearFunction, z: Array) -> tuple[Array, Array]:
    """Angle ``F(z) - F(0) = int_0^z F'(s) ds`` of a motor, by Gauss-Legendre quadrature, and its ratio ``F'(z)``."""
    # z (N,); result (N,)
    symbol = ca.SX.sym("z")
    ratio = VectorisedFunction([symbol], gear.ratio(symbol))
    values = np.concatenate([ratio(z[None] * x) for x in (_NODES + 1) / 2])
    return _WEIGHTS @ values / 2 * z, ratio(z[None])[0]


def quantised(robot: Robot, q: Array, counts: tuple[float, ...]) -> Array:
    """Joint positions as measured by encoders on the motors.

    Each motor's angle F(z) is rounded to whole counts and mapped back through the gear, by Newton's method, and the
    coupling, ``q = C^-1 (z - z0)``. Without a transmission the counts are per revolution of the joint.
    """  # q (N, n)
    per_drive = one_each(counts, robot.n, "encoder", "moving drive")
    transmission = robot.transmission
    if transmission is None:
        sizes = 2 * np.pi / np.array(per_drive)
        return np.asarray(np.round(q / sizes) * sizes)
    own = own_drives(robot)
    C, z0 = transmission.coupling[own], transmission.offset[own]
    if not own:
        raise InputError(
            f"robot {robot.name!r}: its drives do not determine its joints, so encoders do not measure positions"
        )
    z = q @ C.T + z0
    for k, drive in enumerate(own):
        size = 2 * np.pi / per_drive[k]
        gear = transmission.drives[drive].ratio
        counted = np.round(motor_angle(gear, z[:, k])[0] / size) * size
        for _ in range(_NEWTON):
            angle, ratio = motor_angle(gear, z[:, k])
            z[:, k] += (counted - angle) / ratio
    return np.asarray((z - z0) @ np.linalg.inv(C).T)


def noisy(values: Array, deviation: tuple[float, ...], what: str, rng: np.random.Generator) -> Array:
    """Values with white Gaussian noise."""  # values (N, n)
    sigma = np.array(one_each(deviation, values.shape[1], what))
    return np.asarray(values + rng.standard_normal(values.shape) * sigma)


def stepped(q: Array, step: tuple[float, ...]) -> Array:
    """Positions in whole multiples of a step, one for all joints or one each [rad or m]; 0 for none, shape (N, n)."""
    size = np.array(one_each(step, q.shape[1], "position_step"))
    whole = np.where(size > 0, size, 1.0)
    return np.asarray(np.where(size > 0, np.round(q / whole) * whole, q))


def sensed_torques(time: Array, effort: Array, friction: Array, settings: SimulationSettings) -> Array:
    """Torques that sensors show: friction that drifts (the drives make up for it), a wrong gain, slow noise, (N, n)."""
    n = effort.shape[1]
    if settings.friction_drift:
        effort = effort + warming(time, settings.friction_drift)[:, None] * friction
    effort = effort * np.array(one_each(settings.torque_gain, n, "torque_gain"))
    if any(settings.coloured_noise):
        deviation, rng = one_each(settings.coloured_noise, n, "coloured_noise"), [settings.seed, _COLOURED]
        effort = effort + first_order_noise(time, deviation, settings.noise_corner, np.random.default_rng(rng))
    return np.asarray(effort)


def warming(time: Array, change: float) -> Array:
    """Relative change of friction at each instant, from 0 at the first to `change` at the last, shape (N,).

    ``change (1 - exp(-2 s)) / (1 - exp(-2))``, with s from 0 to 1: fast at first, as a body of one time constant warms.
    """
    s = (time - time[0]) / (time[-1] - time[0])
    return np.asarray(change * np.expm1(-_WARMING * s) / np.expm1(-_WARMING))


def first_order_noise(time: Array, deviation: tuple[float, ...], corner: float, rng: np.random.Generator) -> Array:
    """Gaussian noise through a first-order low-pass, ``n_k = a n_{k-1} + sqrt(1 - a^2) e_k``, shape (N, n).

    ``a = exp(-2 pi corner step)``, and n has the given standard deviation from the first row on; corner [Hz].
    """
    step = float(time[-1] - time[0]) / max(time.size - 1, 1)
    a = np.exp(-2 * np.pi * corner * step)
    white = rng.standard_normal((time.size, len(deviation)))
    white[1:] *= np.sqrt(1 - a**2)
    return np.asarray(scipy.signal.lfilter([1.0], [1.0, -a], white, axis=0) * np.array(deviation))


SOURCE = "simulated"


def joint_log(robot: Robot, run: SimulatedRun, settings: SimulationSettings, rng: np.random.Generator) -> Log:
    """Positions by encoders, velocities by tachometers, torques with noise, and temperatures of the moving joints."""
    q = run.samples.q if settings.encoder is None else quantised(robot, run.samples.q, settings.encoder)
    temperature = joint_temperatures(settings, robot)
    effort = sensed_torques(run.samples.time, run.effort, run.friction, settings)
    measured = [name not in robot.passive for name in robot.joint_names]
    return Log(
        source=SOURCE,
        sha256="",
        joints=robot.joint_names,
        time=run.samples.time,
        q=stepped(noisy(q, settings.position_noise, "position_noise", rng), settings.position_step),
        dq=noisy(run.samples.dq, settings.velocity_noise, "velocity_noise", rng),
        effort=noisy(effort, settings.torque_noise, "torque_noise", rng) * measured,
        temperature=None if temperature is None else np.tile(temperature, (run.samples.time.size, 1)),
    )


def wrench_log_of(
    robot: Robot,
    task: Task,
    load: Payload | None,
    samples: Samples,
    settings: SimulationSettings,
    rng: np.random.Generator,
) -> Log:
    """Wrench of a load, or of the whole robot, and positions at the sensor's own instants; locked joints rest."""
    moving = moving_robot(robot, task)
    count = int(np.floor(samples.time[-1] * settings.wrench_rate * (1 + 1e-12)))
    true = SampledMotion(samples).samples(np.arange(count + 1) / settings.wrench_rate)
    whole = _whole(task.limits.applied(robot), moving, true)
    q = true.q if settings.encoder is None else quantised(moving, true.q, settings.encoder)
    measured = _whole(task.limits.applied(robot), moving, replace(true, q=noisy(q, settings.position_noise, "", rng)))
    deviation = settings.wrench_noise if len(settings.wrench_noise) == 6 else np.repeat(settings.wrench_noise, 3)
    if task.model.bears_robot:
        model, known = task.changed(equations=None).model.built(moving), standard_values(moving)
        if unknown := [column.name for column in model.columns if column.name not in known]:
            raise InputError(
                f"robot {robot.name!r}: its description does not state {listed_names(unknown, 5)}; the wrench below "
                "its base cannot be simulated"
            )
        wrench = model.instants(true) @ [known[column.name] for column in model.columns]
    else:
        assert load is not None
        wrench = load.wrench(robot, sensor_of(task), whole)
    return Log(
        source=SOURCE,
        sha256="",
        joints=robot.joint_names,
        time=true.time,
        q=measured.q,
        wrench=noisy(np.asarray(wrench).reshape(-1, 6), tuple(map(float, deviation)), "wrench_noise", rng),
    )


def _whole(robot: Robot, moving: Robot, samples: Samples) -> Samples:
    """Motion of all joints from that of the moving ones; the others rest at zero, or at the nearest limit."""
    table = np.zeros((4, samples.time.size, robot.n))
    table[0] = np.clip(0.0, robot.limits.lower, robot.limits.upper)
    index = [robot.joint_index(name) for name in moving.joint_names]
    table[:, :, index] = samples.q, samples.dq, samples.ddq, samples.dddq
    return Samples(samples.time, *table)


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
    drives = [name for name, _ in drives_with_friction(robot)]
    curves = {name: curve for name in drives if (curve := friction.curve(name)) is not None}
    values = [] if joints is None else drive_temperatures(robot, joints[None])[0].tolist()
    known = {name: value for name, value in zip(drives, values, strict=False) if name in curves}
    return friction.at(known), temperature_notes(curves, known)


def sensor_of(task: Task) -> Sensor:
    """The task's force/torque sensor, with all six equations."""
    return replace(task.model.force_sensor, equations=EQUATIONS)


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
