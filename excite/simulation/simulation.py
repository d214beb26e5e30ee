"""Result of a simulation: motion, logs and true values."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from excite.logs.event import Saturation, saturation_of
from excite.logs.log import Log
from excite.simulation.control import limited_torques
from excite.simulation.integration import SimulatedRun, Steps
from excite.simulation.plant import Plant
from excite.simulation.settings import SimulationSettings
from excite.storage.codec import named
from excite.storage.manifest import sha256_of
from excite.storage.records import Shown
from excite.tasks.reference import MotionSource
from regressors.errors import percent
from regressors.models.differential import DifferentialModel
from regressors.models.nominal import standard_values
from regressors.robot.columns import COULOMB, OFFSET, ROTOR, VISCOUS, drive_column
from regressors.robot.friction.curve import CoulombViscous
from regressors.robot.friction.load_and_temperature import moving_drive_numbers
from regressors.robot.robot import Limits, Robot, linear_drives
from regressors.samples import Array, Samples


@dataclass(frozen=True)
class TorqueUse:
    """Use of one torque limit."""

    label: str  # such as ``drive z2``
    peak: float  # largest commanded magnitude [Nm or N]
    limit: float  # [Nm or N]
    saturated: int  # number of samples at which the command exceeded the limit


@dataclass(frozen=True, eq=False, repr=False)
class Simulation(Shown):
    """A simulated run.

    Parameters
    ----------
    robot : Robot
        The moving robot, with its load.
    settings : SimulationSettings
    steps : Steps
        Steps of the integration.
    reference : Samples
        The desired motion, at the log's instants.
    run : SimulatedRun
        The true motion.
    log : Log
        Log of the joints' sensors.
    wrench_log : Log or None
        Log of the force/torque sensor, with the positions of all joints at its own instants.
    truth : mapping of str to float
        Standard parameters of the moving robot's bodies and drives, and of the load, as simulated; of friction, only
        Coulomb and viscous parameters are included.
    torques : tuple of TorqueUse
    outcome : SimulationOutcome
        Whether torques saturated, joints lost the motion, or limits were passed.
    notes : tuple of str
        Assumptions of the simulation.
    source : MotionSource, optional
        Source of the motion, where it is from a design or a plan.
    tracked : mapping of str to mapping, optional
        Where servos follow the motion, metrics (`excite.information.matrix.CONVENTIONS`) of what was ``commanded`` and
        of what was ``tracked``, for the parameters of the design.
    """

    robot: Robot
    settings: SimulationSettings
    steps: Steps
    reference: Samples
    run: SimulatedRun
    log: Log
    wrench_log: Log | None
    truth: Mapping[str, float]
    torques: tuple[TorqueUse, ...]
    outcome: SimulationOutcome
    notes: tuple[str, ...]
    source: MotionSource | None = None
    tracked: Mapping[str, Mapping[str, float]] | None = None

    @property
    def measured(self) -> Log:
        """Log for the identification: that of the wrench where the motion is for a load, else that of the joints."""
        of_load = self.source is not None and self.source.task.model.channel == "wrench"
        return self.wrench_log if of_load and self.wrench_log is not None else self.log

    def __repr__(self) -> str:
        """One-line summary."""
        error = float(np.abs(self.tracking_error).max())
        return f"<Simulation of {self.robot.name}: {self.log.count} instants, tracking within {error:.2g} rad or m>"

    def save(self, log: str | Path, *, replace: bool = False) -> list[Path]:
        """Write the log, and the true values to a sidecar; with a load, the wrench's log too.

        Parameters
        ----------
        log : path
            Ends in .csv.
        replace : bool
            Replace existing files.

        Returns
        -------
        list of Path
            Files that were written.

        Raises
        ------
        InputError
            Another ending, or files that exist already.
        """
        from excite.simulation.simulation_files import save_simulation

        return save_simulation(self, log, replace=replace)

    @cached_property
    def record(self) -> SimulatedLog:
        """What is written beside its logs."""
        steps, source, run, outcome = self.steps, self.source, self.run, self.outcome
        file = None if source is None else source.file
        robot = self.robot if source is None else source.robot
        return SimulatedLog(
            robot=robot.name,
            sha256=robot.sha256(),
            settings={
                **{name: list(x) if isinstance(x, tuple) else x for name, x in self.settings.to_dict().items()},
                "substeps": steps.substeps,
                "sign_width": steps.width if steps.sticking is None else None,
                "compensation_width": steps.width,
                "breakaway": None if steps.sticking is None else steps.sticking.distance,
                "breakaway_lead": None if steps.sticking is None else list(steps.sticking.lead),
                **({} if self.tracked is None else {"controller": "servos"}),
                **({"controller": None} if self.robot.closures else {}),
            },
            seed=self.settings.seed,
            truth=dict(self.truth),
            duration=float(run.samples.time[-1]),
            samples=int(run.samples.time.size),
            tracking=outcome.tracking,
            torques=self.torques,
            saturated=outcome.saturated,
            failures=outcome.failures,
            notes=(*outcome.notes, *self.notes),
            work=float(run.work[-1]),
            loss=float(run.loss[-1]),
            energy_residual=self.energy_residual,
            trajectory=None if file is None else {"file": file.name, "sha256": sha256_of(file)},
            tracked=self.tracked,
            **({} if source is None else source.origin),
        )

    @property
    def tracking_error(self) -> Array:
        """``q - q_d`` at the log's instants, shape (N, n) [rad or m]."""
        return np.asarray(self.run.samples.q - self.reference.q)

    @property
    def energy_residual(self) -> float:
        """Largest ``|work - change of energy - friction losses|`` over the run [J]."""
        run = self.run
        return float(np.abs(run.work - (run.energy - run.energy[0]) - run.loss).max())


@dataclass(frozen=True)
class SimulatedLog(Shown):
    """What is known of a simulated log beside its columns: ``LOG.json``.

    Parameters
    ----------
    robot, sha256 : str
        Name of the robot, and hash of its description.
    design, friction_plan, trajectory : mapping, optional
        The source of the motion, and the file that was played in its place.
    settings : mapping
        Those of the simulation, and what it chose itself.
    seed : int
    truth : mapping of str to float
        See `Simulation`.
    duration : float
        [s]
    samples : int
    tracking : tuple of Tracking
    torques : tuple of TorqueUse
    saturated : tuple of Saturation
    failures, notes : tuple of str
        What does not hold; assumptions, and what is worth knowing.
    work, loss, energy_residual : float
        Work of the torques, losses by friction, see `Simulation.energy_residual` [J].
    log : mapping, optional
        SHA-256 of the log.
    tracked : mapping, optional
        See `Simulation`.
    """

    beside: ClassVar[Mapping[str, Callable[[Any], Any]]] = {"holds": lambda record: record.holds}

    robot: str = field(metadata=named("robot.name"))
    sha256: str = field(metadata=named("robot.sha256"))
    settings: Mapping[str, Any]
    seed: int
    truth: Mapping[str, float]
    duration: float
    samples: int
    tracking: tuple[Tracking, ...]
    torques: tuple[TorqueUse, ...]
    saturated: tuple[Saturation, ...]
    failures: tuple[str, ...] = field(metadata=named("against"))
    notes: tuple[str, ...]
    work: float
    loss: float
    energy_residual: float
    design: Mapping[str, Any] | None = None
    friction_plan: Mapping[str, Any] | None = None
    trajectory: Mapping[str, Any] | None = None
    log: Mapping[str, str] | None = None
    tracked: Mapping[str, Mapping[str, float]] | None = None

    @property
    def holds(self) -> bool:
        """True if no torque saturated, no joint lost its reference, and no limit was passed, within the tolerances."""
        return not self.failures


def true_parameters(plant: Plant) -> dict[str, float]:
    """Standard parameters of the simulated robot, by the names of the differential model."""
    columns = DifferentialModel(plant.robot).standard_columns
    names, rotors = {c.name for c in columns}, (c.name for c in columns if c.kind == ROTOR)
    known = {name: value for name, value in standard_values(plant.robot).items() if name in names}
    known |= dict(zip(rotors, plant.rotors.tolist(), strict=True))
    for drive, number in moving_drive_numbers(plant.robot).items():
        curve = plant.friction.curve(drive)
        coulomb, viscous, offset = (drive_column(number, kind).name for kind in (COULOMB, VISCOUS, OFFSET))
        known.pop(coulomb, None)
        known.pop(viscous, None)
        if curve is None:
            curve = CoulombViscous()
        if isinstance(curve, CoulombViscous):
            known |= {coulomb: curve.coulomb, viscous: curve.viscous, offset: curve.offset}
    return known


# The largest values over designs of irp6, panda and ur10e that were followed as intended (computed torque with model
# errors up to 30 %, PD of 5 Hz and more, friction that sticks, noise, encoders) stand behind each number.
NOTED_TRACKING = 0.01  # of the range of motion
LOST_TRACKING = 0.05  # of the range of motion: 0.019; runs that saturated and lost it 0.1 to 0.7
SATURATED = 1e-3  # of the samples: none; a torque that only touches its limit saturates in fewer
_LEAST_RANGE = 0.1  # rad or m: a joint that rests or hardly moves is judged as if it moved this far


@dataclass(frozen=True)
class Tracking:
    """How far one joint was from its reference."""

    joint: str
    unit: str
    error: float  # largest ``|q - q_d|`` [unit]
    rms: float  # [unit]
    travel: float  # range of motion in the reference [unit]

    @property
    def relative(self) -> float:
        """The error over the range of motion, or over 0.1 rad or m where that is less."""
        return self.error / max(self.travel, _LEAST_RANGE)


@dataclass(frozen=True)
class SimulationOutcome:
    """Whether the simulated robot did what was asked for."""

    saturated: tuple[Saturation, ...]  # torques that were cut off at a limit, where that happened
    # one per joint; none of a run in which a drive is pushed by ramps of torque and not held in position
    tracking: tuple[Tracking, ...]
    failures: tuple[str, ...]  # what does not hold, in words
    notes: tuple[str, ...]  # what is worth knowing although it holds

    @property
    def holds(self) -> bool:
        """True if no torque saturated, no joint lost its reference, and no limit was passed, within the tolerances."""
        return not self.failures


def simulation_outcome(
    robot: Robot, reference: Samples, samples: Samples, command: Array, *, limited: bool = True, pushed: bool = False
) -> SimulationOutcome:
    """What is to be said of a simulated run."""  # command (N, n)
    saturated = cut_off_torques(robot, samples.time, command) if limited else ()
    tracking = () if pushed else trackings(robot, reference, samples)
    remarks = [
        *(_saturation_remark(one, samples.time.size) for one in saturated),
        *(_tracking_remark(one) for one in tracking if one.relative > NOTED_TRACKING),
        *_passed_limits(robot, samples),
        *(() if limited else _passed_torques(robot, command)),
    ]
    failures, notes = (tuple(text for text, fails in remarks if fails is asked) for asked in (True, False))
    return SimulationOutcome(saturated, tracking, failures, notes)


def _saturation_remark(one: Saturation, count: int) -> tuple[str, bool]:
    text = (
        f"the torque of {one.label} was at its limit of {one.limit:.4g} {one.unit} in {100 * one.rows / count:.2g} % "
        f"of the samples ({one.rows} of {count}); design the motion with `torque_margin`"
    )
    return text, one.rows > SATURATED * count


def _tracking_remark(one: Tracking) -> tuple[str, bool]:
    lost = one.relative > LOST_TRACKING
    text = (
        f"joint {one.joint} deviates from the reference by {one.error:.3g} {one.unit}, {100 * one.relative:.2g} % of "
        f"its range of motion, more than {100 * (LOST_TRACKING if lost else NOTED_TRACKING):g} %"
    )
    return text, lost


def trackings(robot: Robot, reference: Samples, samples: Samples) -> tuple[Tracking, ...]:
    """How far each joint was from its reference at the same instants."""
    errors, travels = samples.q - reference.q, np.ptp(reference.q, axis=0)
    return tuple(
        Tracking(joint.name, joint.unit, float(np.abs(e).max()), float(np.sqrt(np.mean(e**2))), float(travel))
        for joint, e, travel in zip(robot.joints, errors.T, travels, strict=True)
    )


# Motions of irp6, panda and ur10e that were followed as intended passed their limits by less: PD of 5 Hz, and models of
# the controller that are 30 % off.
BEYOND_POSITION = 0.01  # of the range that the limits allow: 0.007
BEYOND_VELOCITY = 0.05  # of the limit: 0.021
_ROUNDING = 1e-6  # of a limit that a motion may touch


def _excess_remark(
    quantity: str, label: str, unit: str, limit: float, excess: float, relative: float
) -> tuple[str, bool]:
    """A limit that is passed, and whether by too much; torques count where they are limited."""
    text = (
        f"the {quantity} of {label} passes its limit of {limit:.4g} {unit} by {excess:.3g} {unit} ({percent(relative)})"
    )
    return text, bool(relative > {"position": BEYOND_POSITION, "velocity": BEYOND_VELOCITY}.get(quantity, np.inf))


def _passed_limits(robot: Robot, samples: Samples) -> Iterator[tuple[str, bool]]:
    """Limits of positions and velocities, of joints and of drives, that a motion passes."""
    labels, units = [f"joint {name}" for name in robot.joint_names], [joint.unit for joint in robot.joints]
    yield from _passed(robot.limits, labels, units, samples.q, samples.dq)
    if (transmission := robot.transmission) is not None:
        labels = [f"drive {drive.name}" for drive in transmission.drives]
        units = ["m" if linear else "rad" for linear in linear_drives(robot)]
        z, dz = samples.q @ transmission.coupling.T + transmission.offset, samples.dq @ transmission.coupling.T
        yield from _passed(transmission.limits, labels, units, z, dz)


def cut_off_torques(robot: Robot, time: Array, command: Array) -> tuple[Saturation, ...]:
    """Torques of joints and drives of which more was asked for than is allowed, and when."""
    # time (N,); command (N, n)
    return tuple(
        saturation_of(label, bound, unit, time, size > bound)
        for label, unit, size, bound in _limited(robot, command)
        if np.any(size > bound)
    )


def _passed_torques(robot: Robot, command: Array) -> list[tuple[str, bool]]:
    """Limits that torques pass, where nothing cuts them off."""  # command (N, n)
    largest = ((label, unit, float(size.max()), bound) for label, unit, size, bound in _limited(robot, command))
    return [
        _excess_remark("torque", label, unit, bound, most - bound, most / bound - 1)
        for label, unit, most, bound in largest
        if most > bound
    ]


def torque_uses(robot: Robot, command: Array) -> tuple[TorqueUse, ...]:
    """Use of every torque limit."""  # command (N, n)
    return tuple(
        TorqueUse(label, float(size.max()), bound, int(np.count_nonzero(size > bound)))
        for label, _, size, bound in _limited(robot, command)
    )


def _limited(robot: Robot, command: Array) -> Iterator[tuple[str, str, Array, float]]:
    """Label, unit, magnitude and limit of every limited torque."""
    straight = {f"joint {joint.name}": joint.kind == "prismatic" for joint in robot.joints}
    if robot.transmission is not None:
        names = (f"drive {drive.name}" for drive in robot.transmission.drives)
        straight |= dict(zip(names, linear_drives(robot), strict=True))
    labels, torques, bounds = limited_torques(robot, command)
    units = ("N" if straight[label] else "Nm" for label in labels)
    yield from zip(labels, units, np.abs(torques).T, bounds.tolist(), strict=True)


def _passed(limits: Limits, labels: list[str], units: list[str], q: Array, dq: Array) -> Iterator[tuple[str, bool]]:
    """Limits of positions and velocities that columns of a motion pass."""
    for k, (label, unit) in enumerate(zip(labels, units, strict=True)):
        lower, upper = float(limits.lower[k]), float(limits.upper[k])
        span = upper - lower if np.isfinite(upper - lower) else float(np.ptp(q[:, k]))
        for limit, excess in ((upper, q[:, k].max() - upper), (lower, lower - q[:, k].min())):
            if excess > _ROUNDING * span:
                yield _excess_remark("position", label, unit, limit, float(excess), float(excess / span))
        fastest, limit = float(np.abs(dq[:, k]).max()), float(limits.velocity[k])
        if fastest > (1 + _ROUNDING) * limit:
            yield _excess_remark("velocity", label, f"{unit}/s", limit, fastest - limit, fastest / limit - 1)
