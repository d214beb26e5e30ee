"""Plan of the friction measurements of a robot: for each coordinate where, how fast, in which order [KD96] section 5.2.

One coordinate moves at a time, about a pose in which gravity cancels (`excite.friction.pose`). After a warm-up it goes
slowly to break away from rest in both directions, then there and back at every speed, fast and slow ones in turn, so
that the power that heats the gear stays about the same throughout.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from constraints.certificate import LimitUse
from constraints.linear import LinearConstraint, linear_limits
from excite.friction.pose import Gravity, Place, found_place, given_place
from excite.friction.runs import Pace, Part, Runs, certificates, pace_of, samples_of
from excite.friction.schedule import Schedule, alternating
from excite.friction.torque import torque_uses
from excite.trajectories.transfer import check_pose
from regressors.errors import InputError
from regressors.partial import PartialMotion, drive_names, of_drives, of_joints
from regressors.robot import Robot
from regressors.samples import Array, Samples

WARM_UP, TRANSFER = "warm-up", "transfer"
_POSITIONS = 101


@dataclass(frozen=True, eq=False)
class Window:
    """A stretch of constant speed.

    Parameters
    ----------
    segment : str
        Such as ``z1 +30 %``.
    percent, speed : float
        Part of the largest speed, and the signed speed itself [%, rad/s or m/s].
    start, end : float
        [s]
    first, last : float
        Position of the coordinate at both ends [rad or m].
    gravity : float
        Mean gravity torque over the window; NaN where it is not known [Nm or N].
    """

    segment: str
    percent: float
    speed: float
    start: float
    end: float
    first: float
    last: float
    gravity: float


@dataclass(frozen=True, eq=False)
class CoordinatePlan:
    """Measurement of one coordinate.

    Parameters
    ----------
    label, unit : str
        Name of the joint or drive, and ``rad`` or ``m``.
    turns : tuple of str
        Drives that turn in this motion; the friction of several cannot be told apart.
    motion : PartialMotion
    place : Place
    centre : float
        Position of the coordinate in the pose [rad or m].
    largest_gravity : float
        Largest gravity torque within the strokes; NaN where it is not known [Nm or N].
    pace : Pace
    runs : Runs
    windows : tuple of Window
        In the order of playing.
    breakaways : tuple of Part
    left_out : dict of float to str
        Speeds that are not played [%], and why.
    limits : tuple of LimitUse
        Every limit of joints and drives over continuous time.
    torques_unchecked : str
        Why torque limits are not among them; empty where they are.
    """

    label: str
    unit: str
    turns: tuple[str, ...]
    motion: PartialMotion
    place: Place
    centre: float
    largest_gravity: float
    pace: Pace
    runs: Runs
    windows: tuple[Window, ...]
    breakaways: tuple[Part, ...]
    left_out: dict[float, str]
    limits: tuple[LimitUse, ...]
    torques_unchecked: str

    @property
    def stroke(self) -> float:
        """Largest way to both sides of the pose [rad or m]."""
        return max(max(abs(part.start), abs(part.end)) for part in self.runs.parts)

    @property
    def broken(self) -> list[LimitUse]:
        """Limits that do not hold."""
        return [use for use in self.limits if not use.holds]

    @property
    def order(self) -> list[float]:
        """Speeds in the order of playing, each once per repeat [%]."""
        return [window.percent for window in self.windows if window.speed > 0.0]

    def samples(self) -> tuple[Samples, list[str]]:
        """Motion of every joint at the samples, and the segment of each."""
        return samples_of(self.runs, self.place.pose, self.motion.matrix[:, 0])


@dataclass(frozen=True, eq=False)
class FrictionPlan:
    """Measurements of the friction of a robot.

    Parameters
    ----------
    robot : Robot
    schedule : Schedule
    coordinates : tuple of CoordinatePlan
    """

    robot: Robot
    schedule: Schedule
    coordinates: tuple[CoordinatePlan, ...]


def friction_plan(
    robot: Robot,
    schedule: Schedule | None = None,
    *,
    joints: Sequence[str] | None = None,
    drives: Sequence[str] | None = None,
    pose: Array | None = None,
    balanced: bool = False,
    seed: int = 0,
) -> FrictionPlan:
    """Plan the runs from which the friction characteristics of joints or drives are found.

    Parameters
    ----------
    robot : Robot
    schedule : Schedule, optional
    joints, drives : sequence of str, optional
        What to measure, by name or number; all drives if neither is given. While one drive moves the others hold
        their z; while one joint moves the other joints rest.
    pose : ndarray, shape (n,), optional
        Middle of every run [rad or m]; found if not given.
    balanced : bool
        Gravity is known to cancel about the pose given, though the inertias of links are not known.
    seed : int
        Of the poses that are tried.

    Raises
    ------
    InputError
        Unknown names, both joints and drives, a pose that is none, no room for any window, or gravity that is not
        known.
    """
    schedule = Schedule() if schedule is None else schedule
    limits, gravity = linear_limits(robot), Gravity(robot)
    if pose is not None:
        pose = _checked_pose(pose, robot, limits)
    elif balanced:
        raise InputError("--balanced says that gravity cancels about a pose that is given; give --pose too")
    planned = [
        _coordinate_plan(robot, schedule, motion, limits, gravity, pose, balanced, seed)
        for motion in _motions(robot, joints, drives)
    ]
    return FrictionPlan(robot, schedule, tuple(planned))


def _motions(robot: Robot, joints: Sequence[str] | None, drives: Sequence[str] | None) -> list[PartialMotion]:
    """One motion per coordinate, in the order asked for."""
    if joints is not None and drives is not None:
        raise InputError("give joints or drives, not both")
    if joints is not None:
        motions = [of_joints(robot, [robot.joint_index(name)]) for name in joints]
    else:
        motions = [of_drives(robot, [name]) for name in (drive_names(robot) if drives is None else drives)]
    labels = [motion.labels[0] for motion in motions]
    if len(set(labels)) < len(labels):
        raise InputError(f"a coordinate is named twice: {', '.join(labels)}")
    return motions


def _checked_pose(pose: Array, robot: Robot, limits: Sequence[LinearConstraint]) -> Array:
    pose = np.asarray(pose, dtype=float)
    if pose.shape != (robot.n,):
        raise InputError(
            f"pose needs {robot.n} numbers, one per joint {', '.join(robot.joint_names)}; given {pose.size}"
        )
    check_pose(pose, "pose", limits)
    return pose


def _coordinate_plan(
    robot: Robot,
    schedule: Schedule,
    motion: PartialMotion,
    limits: Sequence[LinearConstraint],
    gravity: Gravity,
    pose: Array | None,
    balanced: bool,
    seed: int,
) -> CoordinatePlan:
    pace, line, label = pace_of(motion, limits), motion.matrix[:, 0], motion.labels[0]
    fastest = pace.velocity * max(schedule.percent) / 100.0
    enough, wanted = (
        min(pace.ramp(fastest) + 0.5 * fastest * seconds, schedule.stroke)
        for seconds in (schedule.shortest, schedule.longest)
    )
    if pose is None:
        place = found_place(gravity, robot, motion, limits, enough, wanted, seed)
    else:
        place = given_place(gravity, motion, limits, pose, balanced=balanced)
    strokes, left_out = _strokes(schedule, pace, min(place.half, schedule.stroke), motion.units[0])
    if not strokes:
        slowest = min(schedule.percent)
        raise InputError(
            f"{label}: no speed leaves a window: {left_out[slowest]} at {slowest:g} %; choose another --pose, lower "
            "--speeds, a lower --shortest, or higher acceleration and jerk limits"
        )
    centre = _coordinate(robot, motion, place.pose)
    runs = Runs(pace, schedule.rate)
    _warm_up(runs, schedule, strokes)
    breakaways = _breakaways(runs, schedule, label, min(place.half, schedule.stroke))
    there_and_back = _there_and_back(runs, schedule, label, strokes)
    runs.go(TRANSFER, 0.0, 0.5 * pace.velocity)
    runs.wait(schedule.pause)
    uses, unchecked = torque_uses(robot, runs, place.pose, motion)
    stroke = max(strokes.values())
    g = gravity.along(line, place.pose + np.linspace(-stroke, stroke, _POSITIONS)[:, None] * line)
    return CoordinatePlan(
        label,
        motion.units[0],
        _turning(robot, line),
        motion,
        place,
        centre,
        float(np.abs(g).max()),
        pace,
        runs,
        tuple(_window(part, percent, place.pose, line, gravity, centre) for part, percent in there_and_back),
        tuple(breakaways),
        left_out,
        (*certificates(runs, place.pose, motion, limits), *uses),
        unchecked,
    )


def _strokes(schedule: Schedule, pace: Pace, half: float, unit: str) -> tuple[dict[float, float], dict[float, str]]:
    """How far to both sides each speed goes, and the speeds that leave no window, with the reason."""
    strokes: dict[float, float] = {}
    left_out: dict[float, str] = {}
    for percent in sorted(schedule.percent):
        speed = pace.velocity * percent / 100.0
        ramp = pace.ramp(speed)
        stroke = min(half, ramp + 0.5 * speed * schedule.longest)
        window = max(2.0 * (stroke - ramp) / speed, 0.0)
        if window < schedule.shortest * (1.0 - 1e-9):
            left_out[percent] = (
                f"within {max(half, 0.0):.3g} {unit} to both sides the ramps of {ramp:.3g} {unit} leave {window:.2g} s "
                f"of the {schedule.shortest:g} s wanted"
            )
        else:
            strokes[percent] = stroke
    return strokes, left_out


def _warm_up(runs: Runs, schedule: Schedule, strokes: dict[float, float]) -> None:
    """There and back at the speed nearest to half of the largest, until the time is over."""
    if schedule.warm_up == 0.0:
        return
    percent = min(strokes, key=lambda p: abs(p - 50.0))
    speed, stroke = runs.pace.velocity * percent / 100.0, strokes[percent]
    while runs.duration < schedule.warm_up:
        runs.go(WARM_UP, -stroke, speed)
        runs.go(WARM_UP, stroke, speed)
    runs.go(WARM_UP, 0.0, speed)


def _breakaways(runs: Runs, schedule: Schedule, label: str, half: float) -> list[Part]:
    """Very slow ways out of the pose and back, each after a rest: the torque rises until the coordinate breaks away."""
    speed = runs.pace.velocity * schedule.creep / 100.0
    distance = min(speed * schedule.creeping, half)
    found: list[Part] = []
    for _ in range(schedule.breakaways):
        for sign, end in (("+", distance), ("-", 0.0)):
            runs.wait(max(schedule.pause, 1.0))
            part = runs.go(f"{label} stiction {sign}", end, speed)
            assert part is not None
            found.append(part)
    runs.wait(schedule.pause)
    return found


def _there_and_back(
    runs: Runs, schedule: Schedule, label: str, strokes: dict[float, float]
) -> list[tuple[Part, float]]:
    """Every speed in both directions, in an order that keeps the temperature steady."""
    found = []
    for percent in alternating(list(strokes)) * schedule.repeats:
        speed, stroke = runs.pace.velocity * percent / 100.0, strokes[percent]
        runs.go(TRANSFER, -stroke, 0.5 * runs.pace.velocity)
        for sign, end in (("+", stroke), ("-", -stroke)):
            runs.wait(schedule.pause)
            part = runs.go(f"{label} {sign}{percent:g} %", end, speed)
            assert part is not None
            found.append((part, percent))
    runs.wait(schedule.pause)
    return found


def _window(part: Part, percent: float, pose: Array, line: Array, gravity: Gravity, centre: float) -> Window:
    start, end = part.steady()
    (first, last), speed = part.values(np.array([start, end]))[0], part.values(np.array([0.5 * (start + end)]))[1, 0]
    # trapezoids on equal steps: exact for what is odd, and the mean of a smooth torque to far below its size
    g = gravity.along(line, pose + np.linspace(first, last, _POSITIONS)[:, None] * line)
    mean = float(np.trapezoid(g) / (_POSITIONS - 1))
    return Window(part.segment, percent, float(speed), start, end, float(centre + first), float(centre + last), mean)


def _coordinate(robot: Robot, motion: PartialMotion, pose: Array) -> float:
    """Position of the coordinate in a pose: z of a drive, q of a joint."""
    label = motion.labels[0]
    if robot.transmission is None or label in robot.joint_names:
        return float(pose[robot.joint_names.index(label)])
    row = [drive.name for drive in robot.transmission.drives].index(label)
    return float(robot.transmission.coupling[row] @ pose + robot.transmission.offset[row])


def _turning(robot: Robot, line: Array) -> tuple[str, ...]:
    """Names of the drives that turn where the joints move on a line; of the joints, where there is no transmission."""
    if robot.transmission is None:
        return tuple(name for name, d in zip(robot.joint_names, line, strict=True) if d != 0.0)
    speeds = robot.transmission.coupling @ line
    return tuple(drive.name for drive, v in zip(robot.transmission.drives, speeds, strict=True) if abs(v) > 1e-12)
