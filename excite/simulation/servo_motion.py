"""Motion that identified servos make of commands, the torques that it takes, and what it shows of parameters.

The motion is that of `regressors.models.servo_response`. The torques along it are those of the robot's own model, with
the masses that gave the servos their scale and the rotors and friction of its description: stiffness and inertia of a
servo are known only together with these masses, and controllers that know the arm hide its load. They are without the
ripple of a command that is held between two rows, and at rest without what friction holds.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from excite.design.comparison import RATE
from excite.errors import LostMotionError
from excite.information.matrix import MotionMeasures, noise_per_row
from excite.information.target import friction_of_moving, target_of
from excite.simulation.integration import SimulatedRun, Steps
from excite.simulation.plant import Plant, plant_of
from excite.simulation.sensors import friction_at, joint_log, sensor_notes
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulation import Simulation, simulation_outcome, torque_uses, trackings, true_parameters
from excite.tasks.reference import MotionSource, Reference, Repeated, SampledMotion
from excite.tasks.robot_of_task import moving_robot
from regressors.errors import InputError, listed_names
from regressors.models.servo_response import FAR, SYMBOLS, Servos, arm_response
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.symbolic.vectorised import program
from regressors.samples import Array, Samples


def followed(servos: Servos, command: Array, step: float, q: Array, dq: Array) -> Array:
    """Positions of all joints from a state (q, dq) on, under commands at even steps [s], shape (N, n)."""
    before = np.repeat(command[:1], int(np.ceil(servos.values[:, SYMBOLS.index("d")].max() / step)) + 1, axis=0)
    told, first = np.concatenate([before, command]), np.repeat(q[None], len(command), axis=0)
    motion = arm_response(servos.robot, servos.values, told[None], np.array([step]), first[None], dq[None])
    return motion.q[0, :: motion.substeps]


_HELD = 1.0  # before a motion from rest begins, in which gravity bends the servos [s]
_OF_CONTROLLERS = (
    "controller",
    "bandwidth",
    "model_error",
    "torque_limits",
    "sign_width",
    "breakaway",
    "catch",
    "impact",
)


def simulate_servos(
    servos: Servos, source: MotionSource, settings: SimulationSettings, friction: FrictionCurves | None = None
) -> Simulation:
    """Simulate a robot whose servos get a motion as commands, and its sensors."""
    _check(servos, source, settings)
    # servos whose controller compensates gravity are identified without it, and their torques have it
    moving = moving_robot(servos.robot.replace(gravity=source.robot.gravity), source.task)
    start = source.motion.samples(np.zeros(1)).dq[0]
    lead = round(_HELD * settings.rate) if np.allclose(start, 0.0, atol=1e-9) else 0
    reference = Repeated(source.motion, settings.periods, lead / settings.rate)
    told = reference.samples(np.arange(round(reference.duration * settings.rate) + 1) / settings.rate)
    friction = None if friction is None else friction_of_moving(friction, servos.robot, moving)
    friction, notes = friction_at(friction, settings, moving)
    plant, assumed = plant_of(moving, friction)
    run = _run(servos, plant, told, start).after(lead)
    wanted = replace(told.rows(slice(lead, None)), time=run.samples.time)
    # a servo that lags is no fault of the simulation
    outcome = replace(
        simulation_outcome(moving, run.samples, run.samples, run.command),
        tracking=trackings(moving, wanted, run.samples),
    )
    truth = true_parameters(plant)
    log = joint_log(moving, run, settings, np.random.default_rng(settings.seed))
    return Simulation(
        robot=moving,
        settings=settings,
        steps=Steps(1, 0.0),
        reference=wanted,
        run=run,
        log=replace(log, command=wanted.q, truth=truth, saturated=outcome.saturated),
        wrench_log=None,
        truth=truth,
        torques=torque_uses(moving, run.command),
        outcome=outcome,
        notes=(*notes, *assumed, *sensor_notes(settings)),
        source=source,
        tracked={
            "commanded": criteria_of(source, Repeated(source.motion, settings.periods)),
            "tracked": criteria_of(source, SampledMotion(run.samples)),
        },
    )


def _check(servos: Servos, source: MotionSource, settings: SimulationSettings) -> None:
    """Raise `InputError` for what is not for servos, and servos of another robot or of which nothing is known."""
    usual = SimulationSettings()
    for name in _OF_CONTROLLERS:
        if getattr(settings, name) != getattr(usual, name):
            raise InputError(f"`{name}` is for a simulated controller, whose place servos take: leave it out")
    if servos.robot.joint_names != source.robot.joint_names:
        own, given = ", ".join(servos.robot.joint_names), ", ".join(source.robot.joint_names)
        raise InputError(f"the servos are those of {own}, the robot of the motion has {given}")
    if source.ramps is not None:
        raise InputError("torque ramps are for a simulated controller; servos take positions alone")
    unknown = np.array(servos.robot.joint_names)[np.isinf(servos.half_width).all(axis=1)]
    moved = [name for name in moving_robot(servos.robot, source.task).joint_names if name in unknown]
    if moved:
        raise InputError(
            f"nothing is known of the servo of {listed_names(moved)}, which the motion moves; identify the servos from "
            "logs in which it moves"
        )


def _run(servos: Servos, plant: Plant, told: Samples, start: Array) -> SimulatedRun:
    """Motion of the moving joints under commands, and its torques; the others rest."""
    limits, index = servos.robot.limits, [servos.robot.joint_index(name) for name in plant.robot.joint_names]
    command = np.tile(np.clip(0.0, limits.lower, limits.upper), (told.time.size, 1))
    command[:, index], speed, step = told.q, np.zeros(servos.robot.n), float(told.time[1])
    speed[index] = start
    q = followed(servos, command, step, command[0], speed)
    if not np.abs(q - command).max() < FAR:
        raise LostMotionError(
            "the simulated arm falls: its servos are too weak for the motion, or a log of another arm was given"
        )
    dq = np.gradient(q, step, axis=0)
    ddq = np.gradient(dq, step, axis=0)
    q, dq, ddq = (each[:, index] for each in (q, dq, ddq))
    stored = program(plant.energy)((q.T, dq.T))[0]
    carried = program(plant.torque)((q.T, dq.T, ddq.T)).T
    friction = plant.friction.joint_torque(plant.robot, q, dq, load=carried)
    effort = carried + friction
    work, loss = (
        scipy.integrate.cumulative_trapezoid((each * dq).sum(axis=1), dx=step, initial=0.0)
        for each in (effort, friction)
    )
    samples = Samples(told.time, q, dq, ddq, np.full_like(q, np.nan))
    return SimulatedRun(samples, effort, effort, friction, work, loss, stored)


def criteria_of(source: MotionSource, motion: Reference) -> dict[str, float]:
    """Metrics of a motion for the parameters of a task, see `excite.information.matrix.CONVENTIONS`."""
    target = target_of(source.robot, source.task)
    samples = motion.samples(target.model.times(motion.duration, RATE))
    return MotionMeasures.of(target, samples, noise_per_row(source.task.objective.noise, target.model)).criteria
