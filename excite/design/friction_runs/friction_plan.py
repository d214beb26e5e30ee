"""Planned measurements of friction: runs of each coordinate, their windows, limits and distances, and their files.

A plan's folder has ``plan.json``, and one or two trajectory files per coordinate: ``NAME.csv`` holds the motion with
its segments; ``NAME.stiction.csv`` holds the pose, and slow ramps of the torque of one drive, ``DRIVE.effort``, in
segments such as ``z1 stiction +``. There the drive is controlled by torque until it has moved, then by position again,
which brings it back; the controller adds the torque of gravity in the pose.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from constraints.certificate import LimitUse
from constraints.geometry import World
from excite.design.friction_runs.pose import Place
from excite.design.friction_runs.runs import Pace, Part, Runs
from excite.design.friction_runs.schedule import Schedule, TorqueRamps, file_name, scheduled_runs
from excite.design.stated_limits import Unchecked
from excite.storage.atomic import read_json
from excite.storage.codec import INLINE, Beside, named
from excite.storage.migrations import is_of_kind, schema_of
from excite.storage.records import Saved, complete, read_record, write_record
from excite.storage.result_folder import check_not_taken
from excite.storage.sampled_motion import motion_columns, write_motion_table
from excite.tasks.reference import MotionSource, SampledMotion
from excite.tasks.task import Task
from regressors.errors import InputError, UnknownName
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

KIND, PLAN, FIGURE = "friction-plan", "plan.json", "runs"
ORDER = "warm-up; break away in both directions; then fastest, slowest, next fastest, next slowest ... there and back"
UNITS = "SI, angles in radians; speeds in percent of the largest one"


@dataclass(frozen=True, eq=False)
class Window:
    """A stretch of constant speed."""

    beside: ClassVar[Beside] = {"direction": lambda window: 1 if window.speed > 0.0 else -1}

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

    use: LimitUse = field(metadata=INLINE)  # proven for every instant; its time is when the pose is first passed
    at: float  # position of the coordinate there [rad or m]


@dataclass(frozen=True)
class Passage:
    """Straight line in joint space from one pose to the next."""

    start: str  # coordinates that are measured in the two poses; ``home`` for the home pose of the robot's file
    end: str
    obstacle: str  # pair that comes too near on the path; empty where there is none


@dataclass(frozen=True)
class SkippedSpeed:
    """A speed that is left out [%], and why."""

    percent: float
    reason: str


@dataclass(frozen=True, eq=False)
class CoordinatePlan:
    """Measurement of one coordinate."""

    beside: ClassVar[Beside] = {
        "file": lambda c: c.file,
        "stroke": lambda c: c.stroke,
        "duration": lambda c: c.runs.duration,
        "order": lambda c: c.order,
        "stiction": lambda c: c.tests,
    }

    label: str = field(metadata=named("coordinate"))  # name of the joint or drive, and ``rad`` or ``m``
    unit: str
    turns: tuple[str, ...]  # drives that turn in this motion; the friction of several cannot be separated
    pose: Mapping[str, float]  # middle of every run, and how each joint moves per rad or m of the coordinate
    direction: Mapping[str, float]
    centre: float  # position of the coordinate in the pose [rad or m]
    low: float  # see `excite.design.friction_runs.pose.Place`
    high: float
    gravity: str
    below: str
    above: str
    largest_gravity: float  # largest gravity torque within the strokes; NaN where it is not known [Nm or N]
    pace: Pace = field(metadata=INLINE)
    schedule: Schedule
    windows: tuple[Window, ...]  # in the order of playing
    left_out: tuple[SkippedSpeed, ...]
    limits: tuple[LimitUse, ...]  # every limit of joints and drives over continuous time
    torques_unchecked: str  # why torque limits are not among them; empty where they are
    distances: tuple[Distance, ...] | None  # of every pair of bodies that must not touch; none without a world
    ramps: TorqueRamps | None = field(metadata=named("torque_ramps"))  # of the drive's torque, in the same pose
    no_ramps: str = field(metadata=named("no_torque_ramps"))  # why there are no torque ramps

    @property
    def file(self) -> str:
        """Name of the trajectory file, such as ``z1.csv``."""
        return file_name(self.label)

    @property
    def place(self) -> Place:
        """Where it is measured."""
        return Place(np.array(list(self.pose.values())), self.low, self.high, self.gravity, self.below, self.above)

    @property
    def line(self) -> Array:
        """N of ``q = p + N s``, shape (n,)."""
        return np.array(list(self.direction.values()))

    @cached_property
    def runs(self) -> Runs:
        """Runs of the schedule in this place."""
        return scheduled_runs(self.schedule, self.pace, self.place.half, self.label, self.unit)

    @property
    def breakaways(self) -> list[Part]:
        """Creeping runs out of the pose and back, for the break-away tests."""
        return self.runs.breakaways

    @property
    def tests(self) -> list[dict[str, Any]]:
        """The break-away tests as plain values."""
        return [
            {
                "segment": part.segment,
                "direction": 1 if part.end > part.start else -1,
                "start": part.begin,
                "end": part.begin + (0.0 if part.law is None else part.law.duration),
            }
            for part in self.breakaways
        ]

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

    @property
    def top_speed(self) -> float:
        """Largest speed that is played [rad/s or m/s]."""
        return max(self.order) / 100.0 * self.pace.velocity

    def samples(self) -> tuple[Samples, list[str]]:
        """Motion of every joint at the samples, and the segment of each."""
        runs = self.runs
        time = np.arange(runs.steps + 1) / runs.rate
        values, number = runs.values(time)
        q, dq, ddq, dddq = (np.outer(row, self.line) + 0.0 for row in values)
        return Samples(time, q + self.place.pose, dq, ddq, dddq), [runs.parts[k].segment for k in number]

    def write_runs(self, path: Path) -> None:
        """Write the motion with its segments."""
        samples, segments = self.samples()
        write_motion_table(path, *motion_columns(self.pose, samples), segments)

    def write_ramps(self, path: Path) -> None:
        """Write the ramps of torque in the pose."""
        assert self.ramps is not None
        samples, torque, segments = self.ramps.samples(self.place.pose)
        header, table = motion_columns(self.pose, samples)
        table = np.column_stack([table, torque])
        write_motion_table(path, [*header, f"{self.ramps.drive}.effort"], table, segments)


@dataclass(frozen=True, eq=False, repr=False)
class FrictionPlan(Saved):
    """Measurements of the friction of a robot; the same when it is loaded.

    Parameters
    ----------
    robot : Robot
    coordinates : tuple of CoordinatePlan
        One or more.
    world : World, optional
        Shape of the robot and its environment.
    passages : tuple of Passage
        From pose to pose, in the order of the coordinates; none without a world.
    notes : tuple of str
        Parts of the world that are not checked, and joints that keep links apart.
    given_pose : bool
        Whether the pose was given, rather than searched for.
    unchecked : tuple of Unchecked
        Kinds of collisions that are not checked, and why.
    """

    beside: ClassVar[Beside] = {"units": lambda _: UNITS, "schedule": lambda p: p.schedule, "order": lambda _: ORDER}

    robot: Robot
    coordinates: tuple[CoordinatePlan, ...] = field(metadata=named("trajectories"))
    world: World | None = None
    passages: tuple[Passage, ...] = ()
    notes: tuple[str, ...] = field(default=(), metadata=named("not_looked_at"))
    given_pose: bool = False
    unchecked: tuple[Unchecked, ...] = ()

    def __post_init__(self) -> None:
        """Check that there is a coordinate, and that poses are those of the robot."""
        if not self.coordinates:
            raise InputError("a plan has one trajectory or more, given none")
        for c in self.coordinates:
            if not tuple(c.pose) == tuple(c.direction) == self.robot.joint_names:
                raise InputError(f"{c.label}: expected a pose and a direction of the joints of {self.robot.name}")

    def __repr__(self) -> str:
        """One line."""
        names = ", ".join(c.label for c in self.coordinates)
        return f"<FrictionPlan of {self.robot.name}: {names}, {self.duration / 60:.3g} min>"

    @property
    def schedule(self) -> Schedule:
        """Schedule of every coordinate."""
        return self.coordinates[0].schedule

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
        return sum(replace(c, schedule=schedule).runs.duration for c in self.coordinates)

    def motion(self, coordinate: str) -> MotionSource:
        """Runs of a coordinate, such as ``z1``, to be simulated without a folder; ramps are played from their files."""
        for planned in self.coordinates:
            if planned.label == coordinate:
                samples, _ = planned.samples()
                task = Task(self.robot.name, joints=self.robot.joint_names)
                origin = {"design": None, "friction_plan": {"folder": None, "sha256": None}}
                return MotionSource(self.robot, task, SampledMotion(samples), None, None, origin)
        raise UnknownName("coordinate of the plan", coordinate, (planned.label for planned in self.coordinates))

    def _written(self, place: Path, *, replace: bool) -> list[Path]:
        tables = self._tables()
        check_no_plan(place, tables, replace=replace)
        *written, plan = write_record(self, KIND, place, "plan", [FIGURE], tables, KIND, _stated_files(place))
        return [plan, *written]

    def _tables(self) -> dict[str, Callable[[Path], None]]:
        """What writes each trajectory file."""
        runs = [(c.file, c.write_runs) for c in self.coordinates]
        ramps = [(c.ramps.file, c.write_ramps) for c in self.coordinates if c.ramps is not None]
        tables: dict[str, Callable[[Path], None]] = dict([*runs, *ramps])
        if len(tables) < len(runs) + len(ramps):
            names = ", ".join(name for name, _ in runs)
            raise InputError(f"names of two coordinates make the same file name: {names}")
        return tables


def check_no_plan(folder: Path, names: Collection[str] = (), *, replace: bool = False) -> None:
    """Raise `TakenError` where a folder holds a plan, or other files of the given names, that may not be replaced."""
    check_not_taken(folder, PLAN, "a friction plan", names, replace=replace)


def load_friction_plan(folder: str | Path) -> FrictionPlan:
    """Load a plan of friction measurements."""
    path = Path(folder)
    return read_record(path if path.suffix == ".json" else path / PLAN, FrictionPlan, KIND)


def _stated_files(folder: Path) -> list[str]:
    """Trajectory files that the plan in a folder states, for folders without a manifest that lists them."""
    path = folder / PLAN
    if not path.exists():
        return []
    content = read_json(path)
    if not is_of_kind(KIND, content.get("schema")):
        raise InputError(f"{path}: expected schema {schema_of(KIND)}, given {content.get('schema')!r}")
    with complete(path, "friction plan"):
        stated = [part for c in content["trajectories"] for part in (c, c.get("torque_ramps")) if part]
        names = [str(part["file"]) for part in stated]
    return [name for name in names if name == Path(name).name and name.endswith(".csv")]
