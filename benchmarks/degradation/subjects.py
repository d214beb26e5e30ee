"""The robots of the study, their motions, and what each simulated run measured before any degradation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from cases import Case
from spoil import Degradation, degrade

from excite.design.optimisation import design_trajectory
from excite.logs.log import Log
from excite.simulation.sensors import sensor_of
from excite.simulation.settings import AUTO, ImpactPulse, SimulationSettings
from excite.simulation.simulate import simulate_motion
from excite.simulation.simulation import Simulation
from excite.tasks.payload import Payload
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from regressors.readers.library import load_robot
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.locked_joints import with_joint_rotors
from regressors.robot.robot import Robot
from regressors.samples import Array

ROBOTS = ("irp6", "panda", "ur10e")
RATE = 1000.0  # Hz
COULOMB, VISCOUS, ROTOR = 0.02, 0.02, 0.002  # of the torque limit: Nm, Nm s/rad, kg m^2
STEP = (1e-6,)  # rad
CORNER = 2.0  # Hz
PAYLOAD = 0.02  # kg per Nm of the largest torque limit
TRAIN, UNSEEN = 0, 1


@dataclass(frozen=True, eq=False)
class Measurement:
    """One degraded log, and the torques that truly acted.

    Parameters
    ----------
    log : Log
    time : ndarray, shape (N,)
        [s]
    effort : ndarray, shape (N, n)
        True torques at those instants [Nm].
    """

    log: Log
    time: Array
    effort: Array


def true_robot(name: str) -> Robot:
    """The built-in robot, with rotors and friction where its description has none."""
    robot = load_robot(name)
    if robot.transmission is not None:
        return robot
    geared = with_joint_rotors(robot)
    assert geared.transmission is not None
    drives = tuple(
        replace(drive, rotor_inertia=ROTOR * limit, coulomb=COULOMB * limit, viscous=VISCOUS * limit)
        for drive, limit in zip(geared.transmission.drives, robot.limits.torque.tolist(), strict=True)
    )
    return geared.replace(transmission=replace(geared.transmission, drives=drives))


@cache
def motion(name: str, seed: int) -> Trajectory:
    """An exciting motion of 10 s, from one start."""
    task = Task(name, starts=1, harmonics=5, seed=seed, executor="serial")
    return design_trajectory(task).trajectory


@cache
def simulated(name: str, run: str, seed: int) -> Simulation:
    """One simulated run without noise."""
    robot, task = true_robot(name), Task(name)
    settings = SimulationSettings(rate=RATE, seed=seed)
    if run == "payload":
        robot = Payload(_payload(robot)).on(robot, sensor_of(task))
    if run == "sticking":
        settings = replace(settings, breakaway=AUTO)
    if run.startswith("impact"):
        settings = replace(settings, impact=_blows(simulated(name, "plain", seed), float(run.split()[1]), seed))
    return simulate_motion(robot, task, motion(name, seed), settings, friction=FrictionCurves.of_robot(robot))


def _payload(robot: Robot) -> Array:
    """A cube of 10 cm, 10 cm in front of the last link's frame."""
    limits = robot.limits.torque
    m = PAYLOAD * float(limits[np.isfinite(limits)].max(initial=100.0))
    inertia = m * 0.1**2 / 6
    return np.array([m, 0, 0, 0.1 * m, inertia + 0.01 * m, 0, 0, inertia + 0.01 * m, 0, inertia])


def _blows(plain: Simulation, size: float, seed: int) -> tuple[ImpactPulse, ...]:
    """Three blows on the first three joints."""
    rng, names = np.random.default_rng([seed, 7]), plain.robot.joint_names
    peaks = np.abs(plain.run.effort).max(axis=0)
    return tuple(
        ImpactPulse(names[k], float(rng.uniform(2.0, 8.0)), float(rng.choice([-1, 1]) * size * peaks[k]), 0.02)
        for k in range(3)
    )


def measurement(name: str, case: Case, seed: int) -> Measurement:
    """The log of one motion after a case's degradations."""
    found = simulated(name, case.run, seed)
    n, rng = found.robot.n, np.random.default_rng([seed, 11])
    size = np.sqrt(np.mean(simulated(name, "plain", seed).run.effort ** 2, axis=0))
    gains = 1 + case.gains * (-1.0) ** np.arange(n)
    options = {"position_step": STEP, **case.options}
    slow = tuple((case.coloured * size).tolist())
    degradation = Degradation(torque_gain=tuple(gains.tolist()), coloured_noise=slow, noise_corner=CORNER, **options)
    noise = case.white * size * rng.standard_normal(found.log.q.shape)
    # white noise belongs to the rows of the sensor: a delay by whole rows leaves it white
    clean = replace(found.log, dq=None, effort=found.log.effort + noise, truth=None, saturated=())
    log = degrade(clean, degradation, seed, found.run.friction)
    log = replace(log, source=f"{name} {case.name} {seed}", sha256=f"{name} {case.name} {seed}")
    drift = degrade(found.log, Degradation(friction_drift=degradation.friction_drift), seed, found.run.friction)
    return Measurement(log, drift.time, np.asarray(drift.effort))
