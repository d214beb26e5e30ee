"""What a design is asked for: every option of ``excite design``, and the keys of a task file."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from constraints.collision.geometry import World
from excite.files.friction_file import friction_content, friction_of_content
from excite.registry import (
    CONVENTIONS,
    CRITERIA,
    EXECUTORS,
    MODELS,
    SCALES,
    SOLVERS,
    STARTS,
    TRAJECTORIES,
    WINDOWS,
)
from regressors.errors import InputError, UnknownName
from regressors.friction.curves import FrictionCurves
from regressors.models.columns import Terms
from regressors.robot.robot import Robot

ROBOTS_HOME: Literal["robot"] = "robot"
_MOST_SAMPLES = 1_000_000  # rows of trajectory.csv


@dataclass(frozen=True)
class LimitOverrides:
    """Joint limits given for one task; they replace those of the robot's description.

    Parameters
    ----------
    position : tuple of (float, float), optional
        Lower and upper bound per joint [rad or m].
    velocity, acceleration, jerk : tuple of float, optional
        One per joint, or one for all [rad/s, rad/s^2, rad/s^3, or with m].
    """

    position: tuple[tuple[float, float], ...] | None = None
    velocity: tuple[float, ...] | None = None
    acceleration: tuple[float, ...] | None = None
    jerk: tuple[float, ...] | None = None

    def applied(self, robot: Robot) -> Robot:
        """The robot with these limits.

        Raises
        ------
        InputError
            A wrong count, or limits that leave no room.
        """
        changes: dict[str, Any] = {}
        for name in ("velocity", "acceleration", "jerk"):
            values = getattr(self, name)
            if values is not None:
                changes[name] = np.array(_one_per_joint(values, name, robot))
        if self.position is not None:
            if len(self.position) != robot.n:
                raise InputError(f"limits: position needs {robot.n} pairs, one per joint, given {len(self.position)}")
            changes["lower"], changes["upper"] = np.array(self.position, dtype=float).T
        return robot.replace(limits=dataclasses.replace(robot.limits, **changes)) if changes else robot


def _one_per_joint(values: tuple[float, ...], name: str, robot: Robot) -> tuple[float, ...]:
    if len(values) == 1:
        return values * robot.n
    if len(values) != robot.n:
        raise InputError(
            f"limits: {name} needs one value, or {robot.n} for the joints {', '.join(robot.joint_names)}; "
            f"given {len(values)}"
        )
    return values


@dataclass(frozen=True)
class Belief:
    """What is known of one parameter before the experiment.

    Parameters
    ----------
    name : str
        Of a standard parameter, such as ``m3`` or ``F1c``, or of a column of the model, such as ``X7``.
    value, deviation : float
        Value and its standard deviation, above zero, in SI.
    """

    name: str
    value: float
    deviation: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.value) and np.isfinite(self.deviation) and self.deviation > 0.0):
            raise InputError(
                f"prior: {self.name} needs a finite value and a deviation greater than zero, "
                f"given {self.value:g} and {self.deviation:g}"
            )


@dataclass(frozen=True)
class Task:
    """One design task; the defaults are those of the command line.

    Parameters
    ----------
    robot : str
        Built-in name or file that the robot came from; kept to run the task again.
    base_link, tip : str, optional
        Ends of the chain, for a URDF.
    joints : tuple of str, optional
        Names or numbers of the joints that move; the others rest. All of them, or the set for which the robot's
        description names its parameters, if not given.
    drives : tuple of str, optional
        Instead of joints: names or numbers of the drives that move; the others hold their coordinate z.
    model, trajectory, criterion, base, solver, executor : str
        Registered names.
    window : {"short", "long"}
        Time windows of the models energy and load-integral.
    window_length : float
        Length of the short windows [s].
    sensor : str, optional
        Link that carries the force/torque sensor of the load models, by name or number; the last one if not given.
    sensor_xyz, sensor_rpy : tuple of float
        Pose of the sensor's frame in that link's frame [m, rad].
    equations : tuple of str, optional
        Which equations are used: of the load models some of fx, fy, fz, nx, ny, nz, of the differential model the
        torques of some moving coordinates; all if not given.
    start : tuple of {"random", "cosine", "quintic", "sines"}
        Motion that the search starts from, one for all moving coordinates or one each.
    begin : str, optional
        Folder of a design to begin with, of any family: its motion is brought into this one.
    require : tuple of str
        Parameters that the motion must show, each on its own.
    friction, rotor, offset : bool
        Which parameters the model has beside the links': Coulomb and viscous friction, rotor inertias, friction offset.
    joint_rotors : bool
        A rotor inertia for every drive, also where the robot's description knows of none.
    friction_curves : FrictionCurves or dict, optional
        Friction that is known beforehand, by drive [KD96] section 4. It is kept as the content of a friction file. The
        model then has no friction parameters, `friction` and `offset` are false whatever was given; torque limits take
        the friction of the curves.
    period : float
        Duration of the motion [s].
    harmonics : int
        Of the Fourier and cosine series; number of free sines.
    intervals, order : int
        Intervals of the period, equal ones of the B-splines and free ones between waypoints; order of the B-splines,
        4 (cubic) to 6 (quintic).
    starts : int
        Number of random starts.
    seed : int
    workers : int, optional
        Processes; one per core if not given.
    rate : float
        Sampling rate of the written motion and of the reported criteria [Hz].
    noise : tuple of float, optional
        Standard deviation of the torque noise, one for all joints or one each [Nm]; 1 if not given.
    torque_margin : float, optional
        Impose the torque limits of joints and drives, this part of them kept in reserve; not imposed if not given.
    tool_point : tuple of float
        Point of the robot's last link whose place and speed are limited, in that link's frame [m].
    tool_box : tuple of (float, float), optional
        Lower and upper bound of its x, y, z in the base frame, None where there is none [m].
    tool_speed : float, optional
        Largest speed of that point [m/s].
    world : World, optional
        Shape of the robot and what stands around it, to stay apart; nothing is checked if not given.
    home : tuple of float, or "robot", optional
        Pose of all joints of the robot from which it comes and to which it returns [rad or m], or the one in the
        robot's description; the exciting motion alone if not given.
    via : tuple of (tuple of float)
        Poses on the way from home.
    settle : float
        Rest between the ways and the exciting motion [s].
    speed : tuple of float
        Parts of full speed, in (0, 1], at which the motion is written as well.
    weighted : bool
        Rows of W are divided by the noise of their equations before M is formed.
    prior : float or tuple of Belief, optional
        What is known of the parameters beforehand: the relative uncertainty of what the robot's description states, or
        values with deviations. Adds to M, whose rows are then divided by their noise, see
        `excite.information.weighting`.
    scale : {"unit", "prior", "value"}
        What each column's parameter is measured in: its SI unit, its deviation as known beforehand, its value.
    limits : LimitOverrides
    """

    robot: str
    base_link: str | None = None
    tip: str | None = None
    joints: tuple[str, ...] | None = None
    drives: tuple[str, ...] | None = None
    model: str = "differential"
    window: str = "short"
    window_length: float = 0.005
    sensor: str | None = None
    sensor_xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sensor_rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)
    equations: tuple[str, ...] | None = None
    friction: bool = True
    rotor: bool = True
    offset: bool = False
    joint_rotors: bool = False
    friction_curves: FrictionCurves | dict[str, Any] | None = None
    trajectory: str = "fourier"
    period: float = 10.0
    harmonics: int = 5
    intervals: int = 15
    order: int = 6
    criterion: str = "condition"
    base: str = "gautier"
    start: tuple[str, ...] = ("random",)
    begin: str | None = None
    require: tuple[str, ...] = ()
    solver: str = "sqp"
    starts: int = 12
    seed: int = 0
    executor: str = "process"
    workers: int | None = None
    rate: float = 100.0
    noise: tuple[float, ...] | None = None
    torque_margin: float | None = None
    tool_point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tool_box: tuple[tuple[float | None, float | None], ...] | None = None
    tool_speed: float | None = None
    world: World | None = None
    home: tuple[float, ...] | Literal["robot"] | None = None
    via: tuple[tuple[float, ...], ...] = ()
    settle: float = 1.0
    speed: tuple[float, ...] = ()
    weighted: bool = False
    prior: float | tuple[Belief, ...] | None = None
    scale: str = "unit"
    limits: LimitOverrides = field(default_factory=LimitOverrides)

    def __post_init__(self) -> None:
        for what, known in (
            ("model", MODELS),
            ("trajectory", TRAJECTORIES),
            ("criterion", CRITERIA),
            ("base", CONVENTIONS),
            ("solver", SOLVERS),
            ("executor", EXECUTORS),
            ("window", WINDOWS),
            ("scale", SCALES),
        ):
            if getattr(self, what) not in known:
                raise UnknownName(what, str(getattr(self, what)), known)
        for name in self.start:
            if name not in STARTS:
                raise UnknownName("start", name, STARTS)
        if self.joints is not None and self.drives is not None:
            raise InputError("joints and drives exclude each other: name those that move in one of the two ways")
        for what in ("period", "rate", "window_length"):
            if not (np.isfinite(getattr(self, what)) and getattr(self, what) > 0):
                raise InputError(f"{what} must be a positive number, given {getattr(self, what)}")
        if self.starts < 1:
            raise InputError(f"starts must be 1 or more, given {self.starts}")
        if self.workers is not None and self.workers < 1:
            raise InputError(f"workers must be 1 or more, given {self.workers}")
        if self.seed < 0:
            raise InputError(f"seed must be 0 or more, given {self.seed}")
        self._check_samples()
        self._check_ways()
        self._check_tool()
        if self.noise is not None and not all(np.isfinite(s) and s > 0 for s in self.noise):
            given = ", ".join(f"{s:g}" for s in self.noise)
            raise InputError(f"noise must be numbers greater than zero, given {given}")
        self._check_prior()
        if self.friction_curves is not None:
            self._without_friction_parameters(self.friction_curves)

    def _without_friction_parameters(self, curves: FrictionCurves | dict[str, Any]) -> None:
        if self.model.startswith("load"):
            raise InputError("friction_curves: for models of joint torques; a wrench has no friction in it")
        content = friction_content(curves) if isinstance(curves, FrictionCurves) else curves
        friction_of_content(content)
        for name, value in (("friction_curves", content), ("friction", False), ("offset", False)):
            object.__setattr__(self, name, value)

    def _check_prior(self) -> None:
        if isinstance(self.prior, int | float) and not (np.isfinite(self.prior) and self.prior > 0.0):
            raise InputError(f"prior must be a relative uncertainty greater than zero, given {self.prior:g}")
        if self.weighted and self.noise is None:
            raise InputError("weighted: rows are divided by the noise of their equations; give it with --noise")
        if self.scale == "prior" and self.prior is None:
            raise InputError("scale prior: nothing is known beforehand; give it with --prior")
        if self.scale != "unit" and self.base == "orthonormal":
            raise InputError(f"scale {self.scale}: columns of the orthonormal base are no parameters to measure")

    def _check_samples(self) -> None:
        samples, told = self.rate * self.period, f"{self.period:g} s at {self.rate:g} Hz"
        if samples > _MOST_SAMPLES:
            raise InputError(f"{told} is {samples:.6g} samples; expected {_MOST_SAMPLES} or fewer")
        if samples < 1 or abs(samples - round(samples)) > 1e-9 * samples:
            nearest = max(1, round(samples)) / self.rate
            raise InputError(
                f"{told} is {samples:g} samples, not a whole number; the nearest period is {nearest:.12g} s"
            )
        spline = self.trajectory in ("bspline", "waypoints")
        fewest = self.intervals if spline else 2 * self.harmonics
        if samples <= fewest:
            what = f"{self.intervals} intervals" if spline else f"{self.harmonics} harmonics"
            raise InputError(
                f"{told} is {samples:g} samples, too few for {what}; expected a rate above {fewest / self.period:g} Hz"
            )

    def _check_tool(self) -> None:
        box, point = self.tool_box, self.tool_point
        if box is not None and (len(box) != 3 or any(len(side) != 2 for side in box)):
            raise InputError("tool_box needs a lower and an upper bound for each of x, y, z")
        if len(point) != 3 or not np.all(np.isfinite(point)):
            raise InputError(f"tool_point needs three finite numbers, given {', '.join(map(str, point))}")
        if any(point) and box is None and self.tool_speed is None:
            raise InputError("tool_point: there is no limit of the tool; give a tool_box or a tool_speed")

    def _check_ways(self) -> None:
        if self.via and self.home is None:
            raise InputError("via: poses on the way from home need a home")
        if isinstance(self.home, str) and self.home != ROBOTS_HOME:
            raise InputError(f"home must be a pose, or {ROBOTS_HOME!r} for that of its file; given {self.home!r}")
        poses = self.via if self.home is None or isinstance(self.home, str) else (self.home, *self.via)
        if not all(np.isfinite(value) for pose in poses for value in pose):
            raise InputError("home and via must be finite numbers")
        if not (np.isfinite(self.settle) and self.settle >= 0):
            raise InputError(f"settle must be zero or a positive number of seconds, given {self.settle}")
        for speed in self.speed:
            if not 0 < speed <= 1:
                raise InputError(f"speed must be above 0 and at most 1, given {speed:g}")
            if (samples := self.rate * self.period / speed) > _MOST_SAMPLES:
                raise InputError(f"at speed {speed:g} are {samples:.6g} samples; expected {_MOST_SAMPLES} or fewer")

    @property
    def terms(self) -> Terms:
        """Columns that the task asks for beside the links' parameters."""
        return Terms(rotor=self.rotor, coulomb=self.friction, viscous=self.friction, offset=self.offset)

    @property
    def known_friction(self) -> FrictionCurves | None:
        """Friction that is known beforehand."""
        if self.friction_curves is None or isinstance(self.friction_curves, FrictionCurves):
            return self.friction_curves
        return friction_of_content(self.friction_curves)

    def to_dict(self) -> dict[str, object]:
        """Options as plain values, the same keys that a task file has."""
        world = self.world.to_dict() if self.world is not None else None
        options = {**dataclasses.asdict(self), "world": world}
        if isinstance(self.prior, tuple):
            options["prior"] = {b.name: {"value": b.value, "deviation": b.deviation} for b in self.prior}
        return options
