"""What a robot would do and measure while it follows a motion, with the truth beside it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import replace as with_truth
from pathlib import Path

import numpy as np

from excite.information.target import friction_of_moving, moving_robot
from excite.logs.log import Log
from excite.registry import built_in
from excite.simulation.control import TorqueLimits, controller_of
from excite.simulation.controlled import ControlledRobot
from excite.simulation.integration import Progress, SimulatedRun, simulated_run
from excite.simulation.measured import joint_log, wrench_log_of
from excite.simulation.payload import Payload, sensor_of
from excite.simulation.plant import Plant, plant_of
from excite.simulation.ramps import GivenTorque, RampedDrive, broken_loose
from excite.simulation.reference import Awaited, Reference, Repeated, check_joints
from excite.simulation.settings import SimulationSettings, one_each
from excite.simulation.source import MotionSource
from excite.simulation.steps import Steps, steps_for
from excite.simulation.temperature import friction_at
from excite.simulation.true_values import true_parameters
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.friction.curves import FrictionCurves, drives_with_friction
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

_SETTLING = 2.0  # periods of the controlled joints' natural frequency before the motion begins


@dataclass(frozen=True)
class TorqueUse:
    """How far one limited torque was used.

    Parameters
    ----------
    label : str
        Such as ``drive z2``.
    peak, limit : float
        Largest magnitude asked for, and allowed [Nm or N].
    saturated : int
        Number of samples at which more was asked for than is allowed.
    """

    label: str
    peak: float
    limit: float
    saturated: int


@dataclass(frozen=True, eq=False, repr=False)
class Simulation:
    """A simulated run.

    Parameters
    ----------
    robot : Robot
        The moving robot, with the load that it held.
    settings : SimulationSettings
    steps : Steps
        How finely it was integrated.
    reference : Samples
        The motion that was wanted, at the log's instants.
    course : SimulatedRun
        What really happened.
    log : Log
        What the joints' sensors say.
    wrench_log : Log or None
        What the force/torque sensor says, with the positions of all joints at its own instants.
    truth : mapping of str to float
        Standard parameters of the moving robot's bodies and drives, and the load's own, where the simulation had
        them; friction that is no Coulomb and viscous friction is not among them.
    torques : tuple of TorqueUse
    notes : tuple of str
        What was assumed.
    source : MotionSource, optional
        What was played, where it is from a design or a plan.
    """

    robot: Robot
    settings: SimulationSettings
    steps: Steps
    reference: Samples
    course: SimulatedRun
    log: Log
    wrench_log: Log | None
    truth: Mapping[str, float]
    torques: tuple[TorqueUse, ...]
    notes: tuple[str, ...]
    source: MotionSource | None = None

    @property
    def measured(self) -> Log:
        """What goes into an identification: the log of the wrench where the motion is for a load, else the joints'."""
        of_load = self.source is not None and self.source.task.model.channel == "wrench"
        return self.wrench_log if of_load and self.wrench_log is not None else self.log

    def __repr__(self) -> str:
        """One line."""
        error = float(np.abs(self.tracking_error).max())
        return f"<Simulation of {self.robot.name}: {self.log.count} instants, tracking within {error:.2g} rad or m>"

    def save(self, log: str | Path, *, replace: bool = False) -> list[Path]:
        """Write the log, and what is true beside it; with a load, the wrench's log too.

        Parameters
        ----------
        log : path
            Ends in .csv.
        replace : bool
            Replace what is there.

        Returns
        -------
        list of Path
            What was written.

        Raises
        ------
        InputError
            Another ending, or files that are there already.
        """
        files: list[Path] = built_in("writer", "simulation")(self, log, replace=replace)
        return files

    @property
    def tracking_error(self) -> Array:
        """``q - q_d`` at the log's instants, shape (N, n) [rad or m]."""
        return np.asarray(self.course.samples.q - self.reference.q)

    @property
    def energy_residual(self) -> float:
        """Largest ``|work - change of energy - friction losses|`` over the run [J]."""
        run = self.course
        return float(np.abs(run.work - (run.energy - run.energy[0]) - run.loss).max())


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
    """Let a robot follow a motion, and measure it.

    The robot has settled at the motion's start, where the motion starts at rest, before the run begins.

    Parameters
    ----------
    robot : Robot
        The whole robot, its inertias known.
    task : Task
        Which joints move, and where the force/torque sensor is; the others are held rigidly.
    motion : Reference
        Of the moving joints, such as the trajectory of a design.
    settings : SimulationSettings, optional
    friction : FrictionCurves, optional
        Replace the friction of the robot's description for the drives that they name.
    load : Payload, optional
        Held behind the sensor. The controller knows nothing of it.
    ramps : GivenTorque, optional
        Torques of one drive that is not held meanwhile, until it has moved by ``settings.catch``.
    progress : callable, optional
        Called with the number of samples done and of all.

    Returns
    -------
    Simulation

    Raises
    ------
    InputError
        Unknown inertias (named), a motion of another number of joints, steps that would be unstable, or several periods
        of torque ramps.
    UnknownName
        Ramps of a drive that the robot does not have.
    LostMotionError
        The motion runs away.
    """
    settings = settings if settings is not None else SimulationSettings()
    sensor = sensor_of(task)
    loaded = robot if load is None else load.on(robot, sensor)
    moving, bare = moving_robot(loaded, task), moving_robot(robot, task)
    _check_counts(settings, moving.n)
    friction = None if friction is None else friction_of_moving(friction, robot, moving)
    friction, warmth = friction_at(friction, settings, moving)
    reference = Repeated(motion, settings.periods)
    plant, notes = plant_of(moving, friction)
    notes = (*warmth, *notes)
    if ramps is not None and settings.periods > 1:
        raise InputError(f"torque ramps are played once, given {settings.periods} periods")
    controlled = _controlled(plant, plant_of(bare, friction)[0], motion, settings, ramps)
    steps = steps_for(controlled, motion, settings.rate, settings.sign_width, settings.breakaway)
    lead = _lead(motion, settings)
    wait = lead / settings.rate
    awaited, delayed = Awaited(reference, wait) if lead else reference, None if ramps is None else ramps.delayed(wait)
    found = simulated_run(controlled, awaited, settings.rate, steps, progress, delayed).after(lead)
    rng = np.random.default_rng(settings.seed)
    log = joint_log(moving, found, settings, rng)
    wrench_log = None if load is None else wrench_log_of(loaded, moving, task, load, found.samples, settings, rng)
    truth = {**true_parameters(plant), **({} if load is None else load.values())}
    return Simulation(
        robot=moving,
        settings=settings,
        steps=steps,
        reference=reference.samples(np.minimum(found.samples.time, reference.duration)),
        course=found,
        log=with_truth(log, truth=truth),
        wrench_log=None if wrench_log is None else with_truth(wrench_log, truth=truth),
        truth=truth,
        torques=_torques(TorqueLimits(moving), found),
        notes=(*notes, *_notes(plant, steps, found.samples, load), *_ramp_notes(plant, found.samples, settings, ramps)),
    )


def _check_counts(settings: SimulationSettings, n: int) -> None:
    """Raise `InputError` before any work where noise is given for another number of joints."""
    for name in ("position_noise", "velocity_noise", "torque_noise"):
        one_each(getattr(settings, name), n, name)


def _lead(motion: Reference, settings: SimulationSettings) -> int:
    """Number of samples before the motion in which the robot settles under a controller with a wrong model.

    Two periods of the controlled joints' natural frequency; none where the motion does not start at rest.
    """
    start = motion.samples(np.zeros(1))
    at_rest = np.allclose(start.dq, 0.0, atol=1e-9) and np.allclose(start.ddq, 0.0, atol=1e-6)
    return math.ceil(_SETTLING / settings.bandwidth * settings.rate) if at_rest else 0


def _controlled(
    plant: Plant, nominal: Plant, motion: Reference, settings: SimulationSettings, ramps: GivenTorque | None
) -> ControlledRobot:
    start = motion.samples(np.linspace(0.0, motion.duration, 101))
    check_joints(start, plant.robot.joint_names)
    middle = (start.q.min(axis=0) + start.q.max(axis=0)) / 2
    # a stream of its own: the same model error with and without noise
    model = nominal.with_errors(settings.model_error, np.random.default_rng([settings.seed, 1]))
    controller = controller_of(settings.controller, model, settings.bandwidth, middle)
    ramped = None if ramps is None else RampedDrive(model, ramps.drive, settings.catch)
    return ControlledRobot(plant, controller, TorqueLimits(plant.robot) if settings.torque_limits else None, ramped)


def _torques(limits: TorqueLimits, found: SimulatedRun) -> tuple[TorqueUse, ...]:
    labels, torques, bounds = limits.of(found.command)
    magnitudes = np.abs(torques)
    return tuple(
        TorqueUse(label, float(size.max()), float(bound), int(np.count_nonzero(size > bound)))
        for label, size, bound in zip(labels, magnitudes.T, bounds, strict=True)
    )


def _notes(plant: Plant, steps: Steps, samples: Samples, load: Payload | None) -> list[str]:
    notes = []
    if plant.friction.curves:
        notes.append(_turning(steps))
    notes += plant.friction.speed_notes(plant.robot, samples.dq)
    if load is not None:
        notes.append("the load is a part of its link in the standard parameters of the robot; its own are there too")
    return notes


def _turning(steps: Steps) -> str:
    """How friction turned."""
    if steps.sticking is None:
        why = ", as wide as the substep allows" if steps.widened else ""
        return f"the sign of friction turns within {steps.width:.3g} rad/s (m/s) of drive velocity{why}"
    why = ", as far as the substep needs" if steps.widened else ""
    return f"friction sticks: its direction turns over {steps.sticking.distance:.3g} rad (m) of a drive's way{why}"


def _ramp_notes(plant: Plant, samples: Samples, settings: SimulationSettings, ramps: GivenTorque | None) -> list[str]:
    if ramps is None:
        return []
    row = dict(drives_with_friction(plant.robot))[ramps.drive]
    loose = broken_loose(ramps.delayed(0.0), samples.time, samples.q @ row, settings.catch)
    return [
        f"{ramps.drive} was given {ramps.count} ramps of torque, each until it had moved by {settings.catch:g} rad "
        f"(m), as it did in {sum(loose)} of them"
    ]
