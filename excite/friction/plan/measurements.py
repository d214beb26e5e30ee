"""Planned measurements of friction: runs of each coordinate, their windows, limits and distances."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from constraints.bounds.certificate import LimitUse
from constraints.collision.geometry import World
from excite.friction.plan.pose import Place
from excite.friction.plan.run_sequence import RunSequence, run_sequence_of
from excite.friction.plan.runs import Pace, Part, Runs, samples_of
from excite.friction.plan.schedule import Schedule
from excite.friction.plan.torque_ramps import TorqueRamps
from excite.registry import built_in
from excite.simulation.reference import SampledMotion
from excite.simulation.source import MotionSource
from excite.tasks.task import Task
from regressors.errors import UnknownName
from regressors.models.partial import PartialMotion
from regressors.robot.robot import Robot
from regressors.samples import Samples


@dataclass(frozen=True, eq=False)
class Window:
    """A stretch of constant speed."""

    segment: str  # such as ``z1 +30 %``
    percent: float  # part of the largest speed, and the signed speed itself [%, rad/s or m/s]
    speed: float
    start: float  # [s]
    end: float
    first: float  # position of the coordinate at both ends [rad or m]
    last: float
    gravity: float  # mean gravity torque over the window; NaN where it is not known [Nm or N]


@dataclass(frozen=True)
class Distance:
    """Least distance of two bodies in the runs of a coordinate."""

    use: LimitUse  # proven for every instant; its time is when the pose is first passed
    at: float  # position of the coordinate there [rad or m]


@dataclass(frozen=True)
class Passage:
    """Straight line in joint space from one pose to the next."""

    start: str  # coordinates that are measured in the two poses; ``home`` for the home pose of the robot's file
    end: str
    obstacle: str  # pair that comes too near on the path; empty where there is none


@dataclass(frozen=True, eq=False)
class CoordinatePlan:
    """Measurement of one coordinate."""

    label: str  # name of the joint or drive, and ``rad`` or ``m``
    unit: str
    turns: tuple[str, ...]  # drives that turn in this motion; the friction of several cannot be separated
    motion: PartialMotion
    place: Place
    centre: float  # position of the coordinate in the pose [rad or m]
    largest_gravity: float  # largest gravity torque within the strokes; NaN where it is not known [Nm or N]
    pace: Pace
    sequence: RunSequence
    windows: tuple[Window, ...]  # in the order of playing
    limits: tuple[LimitUse, ...]  # every limit of joints and drives over continuous time
    torques_unchecked: str  # why torque limits are not among them; empty where they are
    distances: tuple[Distance, ...] | None  # of every pair of bodies that must not touch; none without a world
    ramps: TorqueRamps | None  # of the drive's torque, in the same pose
    no_ramps: str  # why there are no torque ramps

    @property
    def runs(self) -> Runs:
        """Motion of the coordinate."""
        return self.sequence.runs

    @property
    def breakaways(self) -> tuple[Part, ...]:
        """Creeping runs out of the pose and back, for the break-away tests."""
        return self.sequence.breakaways

    @property
    def left_out(self) -> dict[float, str]:
        """Speeds that are left out [%], and why."""
        return self.sequence.left_out

    @property
    def stroke(self) -> float:
        """Largest displacement to both sides of the pose [rad or m]."""
        return max(max(abs(part.start), abs(part.end)) for part in self.runs.parts)

    @property
    def broken(self) -> list[LimitUse]:
        """Limits that are violated."""
        return [use for use in self.limits if not use.holds]

    @property
    def too_near(self) -> list[Distance]:
        """Distances that are not kept, the least first."""
        broken = [distance for distance in self.distances or () if not distance.use.holds]
        return sorted(broken, key=lambda distance: distance.use.margin)

    @property
    def order(self) -> list[float]:
        """Speeds in the order of playing, each once per repeat [%]."""
        return [window.percent for window in self.windows if window.speed > 0.0]

    def samples(self) -> tuple[Samples, list[str]]:
        """Motion of every joint at the samples, and the segment of each."""
        return samples_of(self.runs, self.place.pose, self.motion.matrix[:, 0])


@dataclass(frozen=True, eq=False, repr=False)
class FrictionPlan:
    """Measurements of the friction of a robot.

    Parameters
    ----------
    robot : Robot
    schedule : Schedule
    coordinates : tuple of CoordinatePlan
    world : World, optional
        Shape of the robot and its environment.
    passages : tuple of Passage
        From pose to pose, in the order of the coordinates; none without a world.
    notes : tuple of str
        Parts of the world that are not checked.
    """

    robot: Robot
    schedule: Schedule
    coordinates: tuple[CoordinatePlan, ...]
    world: World | None = None
    passages: tuple[Passage, ...] = ()
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """One line."""
        names = ", ".join(c.label for c in self.coordinates)
        return f"<FrictionPlan of {self.robot.name}: {names}, {self.duration / 60:.3g} min>"

    def save(self, folder: str | Path, *, replace: bool = False) -> list[Path]:
        """Write the plan into a folder, made if it does not exist.

        Parameters
        ----------
        folder : path
        replace : bool
            Replace a plan that is already there.

        Returns
        -------
        list of Path
            Files that were written.

        Raises
        ------
        InputError
            The folder holds a plan, or cannot be written to.
        """
        files: list[Path] = built_in("writer", "friction plan")(self, folder, replace=replace)
        return files

    def motion(self, coordinate: str) -> MotionSource:
        """Runs of one coordinate, to be simulated without a folder; torque ramps are played from their files.

        Parameters
        ----------
        coordinate : str
            Its label, such as ``z1``.

        Raises
        ------
        UnknownName
            No such coordinate in the plan.
        """
        for planned in self.coordinates:
            if planned.label == coordinate:
                samples, _ = planned.samples()
                task = Task(self.robot.name, joints=self.robot.joint_names)
                origin = {"design": None, "friction_plan": {"folder": None, "sha256": None}}
                return MotionSource(self.robot, task, SampledMotion(samples), None, None, origin)
        raise UnknownName("coordinate of the plan", coordinate, (planned.label for planned in self.coordinates))

    @property
    def holds(self) -> bool:
        """True if all limits and distances of the runs are kept."""
        return not any(c.broken or c.too_near for c in self.coordinates)

    @property
    def duration(self) -> float:
        """Of all runs together, without torque ramps [s]."""
        return sum(c.runs.duration for c in self.coordinates)

    def lasting(self, longest: float) -> float:
        """Duration of all runs in the same poses with windows that are no longer than this [s]."""
        schedule = replace(self.schedule, longest=max(longest, self.schedule.shortest))
        sequences = (run_sequence_of(schedule, c.pace, c.place.half, c.label, c.unit) for c in self.coordinates)
        return sum(sequence.runs.duration for sequence in sequences)
