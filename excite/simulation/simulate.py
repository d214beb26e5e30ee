"""Simulation of the measurements of a robot that plays a design: entry point of command line and scripts."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import scipy

from excite.design.design import Design
from excite.information.target import friction_of_moving
from excite.simulation.control import ControlledRobot, RampedDrive, broken_loose, controller_of
from excite.simulation.integration import Progress, SimulatedRun, Steps, simulated_run, steps_for
from excite.simulation.plant import Plant, plant_of
from excite.simulation.sensors import friction_at, joint_log, sensor_notes, sensor_of, wrench_log_of
from excite.simulation.servo_motion import simulate_servos
from excite.simulation.settings import AUTO, SimulationSettings, impacts_on, one_each
from excite.simulation.simulation import Simulation, simulation_outcome, torque_uses, true_parameters
from excite.simulation.simulation_files import read_source
from excite.tasks.friction_file import read_friction
from excite.tasks.payload import Payload, read_load
from excite.tasks.reference import GivenTorque, MotionSource, Reference, Repeated, check_played
from excite.tasks.robot_of_task import moving_robot
from excite.tasks.task import Task
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.servo_response import Servos
from regressors.numerical import numerical_work
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.load_and_temperature import drives_with_friction, smooth_direction
from regressors.robot.robot import Robot
from regressors.robot.symbolic.loops import loops_of
from regressors.robot.symbolic.vectorised import program
from regressors.samples import Samples
from regressors.work_prediction import FLOAT, announce, check_memory


@checked
@numerical_work(
    "the simulation",
    "masses, torques or gains of very different sizes are the likely cause: "
    "check `bandwidth`, `rate`, friction and load",
)
def simulate(
    source: Design | MotionSource | str | Path,
    settings: SimulationSettings | None = None,
    *,
    noise: float | tuple[float, ...] | None = None,
    friction: FrictionCurves | str | Path | None = None,
    load: Payload | str | Path | None = None,
    servos: Servos | None = None,
    trajectory: str | Path | None = None,
    approach_and_return: bool = True,
    beyond_limits: bool = False,
    progress: Progress | None = None,
    **options: Any,
) -> Simulation:
    """Simulate the robot of a design while it plays the motion, and its sensors.

    Parameters
    ----------
    source : Design, MotionSource or path
        A design; its folder; or a file of a friction plan.
    settings : SimulationSettings, optional
        Settings of control, integration and measurement.
    noise : float or tuple of float, optional
        Standard deviation of the torque noise, short for ``torque_noise`` of the settings [Nm].
    friction : FrictionCurves or path, optional
        Replaces the friction of the robot's description for the drives that it names.
    load : Payload or path, optional
        Load behind the force/torque sensor.
    servos : ServoResult, optional
        Identified servos that follow the motion as commands in the place of a controller. The robot
        is theirs, with the masses of their identification.
    trajectory : path, optional
        File to play, in the format of trajectory.csv, instead of the design's motion.
    approach_and_return : bool
        Play the approach from home and the return too, where there are any and the design is in a folder.
    beyond_limits : bool
        Play a motion that breaks limits of its robot, see `excite.tasks.reference.broken_limits`.
    progress : callable, optional
        Called with the number of samples done and the total.
    **options
        Fields of `SimulationSettings`, by name.

    Returns
    -------
    Simulation
        Accepted wherever a log is; ``log`` is the log of the joints' sensors.

    Raises
    ------
    InputError
        Unknown inertias, a motion of other joints, or invalid settings.
    excite.errors.BrokenLimitError
        The motion breaks a limit.
    excite.errors.LostMotionError
        The motion diverges.
    """
    if noise is not None:
        options["torque_noise"] = noise
    settings = replace(settings if settings is not None else SimulationSettings(), **options)
    resolved = motion_source(source, trajectory, approach_and_return=approach_and_return)
    if not beyond_limits:
        check_played(resolved)
    curves = read_friction(Path(friction)) if isinstance(friction, str | Path) else friction
    if servos is not None:
        if load is not None:
            raise InputError("`load` is not for servos, which carry that of their identification: leave it out")
        return simulate_servos(servos, resolved, settings, curves)
    if resolved.planned and settings.sign_width is None and settings.breakaway is None:
        settings = replace(settings, breakaway=AUTO)
    payload = read_load(Path(load)) if isinstance(load, str | Path) else load
    given = (resolved.robot, resolved.task, resolved.motion, settings)
    simulation = simulate_motion(*given, friction=curves, load=payload, ramps=resolved.ramps, progress=progress)
    return replace(simulation, source=resolved)


def motion_source(
    source: Design | MotionSource | str | Path,
    trajectory: str | Path | None = None,
    *,
    approach_and_return: bool = True,
) -> MotionSource:
    """Motion that a simulation plays."""
    if isinstance(source, MotionSource):
        return source
    file = None if trajectory is None else Path(trajectory)
    return read_source(source, file, approach_and_return=approach_and_return)


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
    """Simulate a robot that follows a motion, and its sensors; from rest it settles before the run begins."""
    settings = settings if settings is not None else SimulationSettings()
    sensor = sensor_of(task)
    loaded = robot if load is None else load.on(robot, sensor)
    moving, bare = moving_robot(loaded, task), moving_robot(robot, task)
    _check_counts(settings, moving.n)
    friction = None if friction is None else friction_of_moving(friction, robot, moving)
    friction, temperature_notes = friction_at(friction, settings, moving)
    lead = _lead(motion, settings)
    wait = lead / settings.rate
    reference = Repeated(motion, settings.periods, wait)
    check_size(settings, reference.duration, moving.n, wrench=load is not None or task.model.bears_robot)
    announce("the simulation", _SECONDS * reference.duration * settings.rate * moving.n)
    plant, notes = plant_of(moving, friction)
    notes = (*temperature_notes, *notes)
    if ramps is not None and settings.periods > 1:
        raise InputError(f"torque ramps are played once, given {settings.periods} periods")
    if moving.closures:
        simulated, steps = _closed_run(plant, reference, settings)
        notes = (*notes, _CLOSED)
    else:
        controlled = controlled_robot(plant, plant_of(bare, friction)[0], motion, settings, ramps)
        steps = steps_for(controlled, motion, settings.rate, settings.sign_width, settings.breakaway)
        delayed = None if ramps is None else ramps.delayed(wait)
        impacts = impacts_on(moving, settings.impact, wait) if settings.impact else None
        simulated = simulated_run(controlled, reference, settings.rate, steps, progress, delayed, impacts)
    simulated = simulated.after(lead)
    rng = np.random.default_rng(settings.seed)
    log = joint_log(moving, simulated, settings, rng)
    wrench_log = None
    if load is not None or task.model.bears_robot:
        wrench_log = wrench_log_of(loaded, task, load, simulated.samples, settings, rng)
    truth = {**true_parameters(plant), **({} if load is None else load.values())}
    played = Repeated(motion, settings.periods)
    wanted = played.samples(np.minimum(simulated.samples.time, played.duration))
    outcome = simulation_outcome(
        moving, wanted, simulated.samples, simulated.command, limited=settings.torque_limits, pushed=ramps is not None
    )
    return Simulation(
        robot=moving,
        settings=settings,
        steps=steps,
        reference=wanted,
        run=simulated,
        log=replace(log, truth=truth, saturated=outcome.saturated),
        wrench_log=None if wrench_log is None else replace(wrench_log, truth=truth),
        truth=truth,
        torques=torque_uses(moving, simulated.command),
        outcome=outcome,
        notes=(*notes, *run_notes(plant, steps, simulated.samples, settings, ramps, load), *sensor_notes(settings)),
    )


def _check_counts(settings: SimulationSettings, n: int) -> None:
    """Raise `InputError` before any computation where noise, gains or steps are given for another number of joints."""
    for name in ("position_noise", "velocity_noise", "torque_noise", "torque_gain", "coloured_noise", "position_step"):
        one_each(getattr(settings, name), n, name)
    if settings.encoder is not None:
        one_each(settings.encoder, n, "encoder", "moving drive")


def _lead(motion: Reference, settings: SimulationSettings) -> int:
    """Settling samples before a motion from rest: two periods of the controlled joints' natural frequency."""
    start = motion.samples(np.zeros(1))
    at_rest = np.allclose(start.dq, 0.0, atol=1e-9) and np.allclose(start.ddq, 0.0, atol=1e-6)
    return math.ceil(_SETTLING / settings.bandwidth * settings.rate) if at_rest else 0


def run_notes(
    plant: Plant, steps: Steps, samples: Samples, options: SimulationSettings, ramps: GivenTorque | None, load: object
) -> list[str]:
    """Notes on the sign change of friction, extrapolation, the load, ramps that broke a drive loose, and impacts."""
    notes = []
    if plant.friction.curves:
        how = f"changes sign within {steps.width:.3g} rad/s (m/s) of drive velocity"
        if steps.sticking is not None:
            distance = steps.sticking.distance
            how = f"is presliding: it changes direction over {distance:.3g} rad (m) of a drive"
        notes.append(f"friction {how}{', widened to suit the substep' if steps.widened else ''}")
    notes += plant.friction.speed_notes(plant.robot, samples.dq)
    if load is not None:
        notes.append("the standard parameters of its link include the load; those of the load alone are listed too")
    if ramps is not None:
        row = dict(drives_with_friction(plant.robot))[ramps.drive]
        loose = broken_loose(ramps.delayed(0.0), samples.time, samples.q @ row, options.catch)
        notes.append(
            f"{ramps.drive} was given {ramps.count} ramps of torque, each until it moves by {options.catch:g} rad "
            f"(m); it moved in {sum(loose)} of them"
        )
    return notes + [
        f"an impact of up to {one.torque:g} Nm (N) acts on {one.joint} from {one.time:g} s on for {one.duration:g} s"
        for one in options.impact
    ]


def controlled_robot(
    plant: Plant, nominal: Plant, motion: Reference, settings: SimulationSettings, ramps: GivenTorque | None
) -> ControlledRobot:
    """Plant, controller with the settings' model error, torque limits, and ramps or impacts where there are any."""
    start = motion.samples(np.linspace(0.0, motion.duration, 101))
    given, joints = start.q.shape[1], plant.robot.joint_names
    if given != len(joints):
        raise InputError(f"the motion has {given} joints, the robot that moves has {len(joints)}: {', '.join(joints)}")
    middle = (start.q.min(axis=0) + start.q.max(axis=0)) / 2
    # separate stream: the same model error with and without noise
    model = nominal.with_errors(settings.model_error, np.random.default_rng([settings.seed, 1]))
    controller = controller_of(settings.controller, model, settings.bandwidth, middle)
    ramped = None if ramps is None else RampedDrive(model, ramps.drive, settings.catch)
    return ControlledRobot(plant, controller, settings.torque_limits, ramped, struck=bool(settings.impact))


_OF_ANY, _OF_JOINT = 8.0, 24.0  # numbers of each sample, and of each of its joints
_OF_WRENCH = 60.0  # of each sample of the force/torque sensor
_SECONDS = 2e-5  # of each sample and joint


def check_size(settings: SimulationSettings, duration: float, n: int, *, wrench: bool) -> None:
    """Refuse a simulation that takes more memory than it may; the factors are measured."""
    samples, of_wrench = duration * settings.rate, wrench * duration * settings.wrench_rate
    held = samples * (_OF_ANY + _OF_JOINT * n) + _OF_WRENCH * of_wrench
    remedy = "lower `rate` or `periods`" + ", or `wrench_rate`" * wrench
    check_memory("the simulation", FLOAT * held, f"{max(samples, of_wrench):.3g} samples", remedy)


_SOFTEST = 1e-6  # of the largest velocity: the sign of friction changes within it; nothing is integrated
_CLOSED = (
    "closed loops: the robot follows its motion exactly, and its drives have the torques which that takes; no "
    "controller is simulated"
)


def _closed_run(plant: Plant, motion: Reference, settings: SimulationSettings) -> tuple[SimulatedRun, Steps]:
    """Torques of the drives along a motion that keeps the loops closed, and that the robot follows exactly.

    ``N' tau`` is determined by the motion. Where drives act on more joints than move on their own, their torques are
    those of the least norm: what they bear against each other is not determined by a motion.
    """
    if settings.impact or settings.breakaway is not None or plant.friction.loaded:
        raise InputError(
            f"robot {plant.robot.name!r}: impacts, presliding and friction that grows with the load are not simulated "
            "for closed loops; leave `impact`, `breakaway` and such friction out"
        )
    loops, count = loops_of(plant.robot), round(motion.duration * settings.rate) + 1
    given = motion.samples(np.arange(count) / settings.rate)
    solved, left = loops.solved(given.q[:, loops.independent])
    loops.check(given.time, solved, left, plant.robot.name)
    samples = loops.rates(replace(given, q=solved, dddq=np.zeros_like(solved)))
    q, dq, ddq = (x.T for x in (samples.q, samples.dq, samples.ddq))
    width = settings.sign_width or _SOFTEST * (float(np.abs(dq).max()) or 1.0)
    symbol = ca.SX.sym("dq", plant.robot.n)
    lost = plant.friction.joint_expression(plant.robot, symbol, smooth_direction(plant.robot, symbol, width))
    friction = program(ca.Function("friction", [symbol], [ca.densify(lost)]))((dq,)).T
    rigid = program(plant.torque)((q, dq, ddq)).T
    effort = loops.drive_torques(samples.q, rigid + friction)
    powers = (np.sum(tau * samples.dq, axis=1) for tau in (effort, friction))
    work, loss = (scipy.integrate.cumulative_simpson(power, x=samples.time, initial=0.0) for power in powers)
    energy = program(plant.energy)((q, dq))[0]
    run = SimulatedRun(samples, effort, effort.copy(), friction, work, loss, energy)
    return run, Steps(1, width)
