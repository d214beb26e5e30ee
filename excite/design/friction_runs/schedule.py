"""Schedule of the runs of each measured coordinate: speeds, windows, warm-up, break-away tests; its runs and its ramps.

Ramps are slow rises of a drive's torque from rest, up to where it breaks away: stiction of robots with a torque
interface. The coordinate is held in a pose; the torque of its drive alone rises in proportion to time, in one direction
and then in the other, with rests between in which a position controller returns the drive to the pose. The torque is
that of friction: the controller adds the gravity torque of the pose.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import ClassVar

import numpy as np

from excite.design.friction_runs.runs import LEAST_RUN, REST, Pace, Runs
from excite.storage.codec import Beside
from excite.tasks.option import essential, option
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.quantities import check_options
from regressors.robot.robot import Robot, transmission_of
from regressors.samples import Array, Samples
from regressors.work_prediction import FLOAT, check_memory

PERCENT = (5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0)
LONGEST = 1.5  # of the windows by default, so that the gears hardly cool in slow runs [s]
_SAMPLES = 10  # in a window, at least


@checked
@dataclass(frozen=True)
class Schedule:
    """Schedule of the runs of each coordinate.

    Parameters
    ----------
    percent : tuple of float
        Speeds in percent of the largest one, above 0 and up to 100.
    rate : float
        Samples per second of the files [Hz].
    shortest, longest : float
        Least and largest length of the windows of constant speed; the latter may be infinite [s].
    stroke : float
        Largest displacement to both sides of the pose; infinite for the whole range [rad or m].
    warm_up : float
        Least length of the warm-up; 0 for none [s].
    repeats : int
        How often every speed is played.
    creep : float
        Speed of the runs that break away from rest, in percent of the largest one.
    creeping : float
        Duration of each of them [s].
    breakaways : int
        Number of these runs in each direction, and of the torque ramps; 0 for none.
    pause : float
        Rest between runs [s].
    ramping : float
        Duration of each torque ramp [s].

    Raises
    ------
    InputError
        A number outside its range.
    """

    percent: tuple[float, ...] = essential(
        PERCENT, "numbers", "Speeds, in percent of the largest.", metavar="P,...", flag="speeds"
    )
    rate: float = essential(500.0, "number", "Samples per second of the files.", metavar="HZ")
    shortest: float = essential(0.2, "number", "Shortest window of constant speed.", metavar="S")
    longest: float = essential(
        LONGEST, "number", "Longest window of constant speed; inf: as long as the range allows.", metavar="S"
    )
    stroke: float = option(
        math.inf, "number", "Largest stroke to each side of the pose.", metavar="R", unset="the range"
    )
    warm_up: float = option(30.0, "number", "Warm-up of each joint; 0 for none.", metavar="S")
    repeats: int = option(1, "integer", "Number of times that every speed is played.", metavar="N")
    creep: float = option(
        0.1, "number", "Creeping speed of the break-away tests, in percent of the largest.", metavar="P"
    )
    creeping: float = option(10.0, "number", "Duration of each creeping break-away test.", metavar="S")
    breakaways: int = option(3, "integer", "Break-away tests per direction, of each kind.", metavar="N")
    pause: float = option(0.5, "number", "Rest between runs.", metavar="S")
    ramping: float = option(5.0, "number", "Duration of each torque ramp.", metavar="S")

    def __post_init__(self) -> None:
        check_options(self, (field.name for field in fields(self)))
        if not self.percent:
            raise InputError("`percent` needs at least one speed, given none")
        if len(set(self.percent)) < len(self.percent):
            speeds = ", ".join(f"{percent:g}" for percent in self.percent)
            raise InputError(f"duplicate speeds in `percent`: {speeds}; give `repeats` to play all speeds again")
        if self.rate * self.shortest < _SAMPLES:
            raise InputError(
                f"{self.rate:g} samples per second leave {self.rate * self.shortest:.2g} in a window of "
                f"{self.shortest:g} s, too few to detect a constant speed; "
                f"the rate must be {_SAMPLES / self.shortest:.3g} or more"
            )
        if self.longest < self.shortest:
            raise InputError(f"longest window {self.longest:g} s is below the shortest one, {self.shortest:g} s")
        if self.repeats < 1:
            raise InputError(f"`repeats` must be 1 or more, given {self.repeats}")


def alternating(percent: Sequence[float]) -> list[float]:
    """Fastest, slowest, next fastest, next slowest and so on: any two successive runs generate about the same heat."""
    left = sorted(percent)
    return [left.pop(-1 if k % 2 == 0 else 0) for k in range(len(left))]


WARM_UP, TRANSFER = "warm-up", "transfer"


def scheduled_runs(schedule: Schedule, pace: Pace, half: float, label: str, unit: str, because: str = "") -> Runs:
    """Build the runs of a schedule within the range of a place; empty where no speed leaves a window."""
    half = min(half, schedule.stroke)
    runs = Runs(pace, schedule.rate)
    _strokes(runs, schedule, half, unit, because)
    if runs.strokes:
        _warm_up(runs, schedule)
        _breakaways(runs, schedule, label, half)
        _there_and_back(runs, schedule, label)
        runs.go(TRANSFER, 0.0, 0.5 * pace.velocity)
        runs.wait(schedule.pause)
    return runs


def _strokes(runs: Runs, schedule: Schedule, half: float, unit: str, because: str) -> None:
    """Stroke to both sides for each speed, and the speeds that leave no window, with the reason."""
    for percent in sorted(schedule.percent):
        speed = runs.pace.velocity * percent / 100.0
        ramp = runs.pace.ramp(speed)
        stroke = min(half, ramp + 0.5 * speed * schedule.longest)
        window = max(2.0 * (stroke - ramp) / speed, 0.0)
        if window < schedule.shortest * (1.0 - 1e-9):
            runs.left_out[percent] = (
                f"in a stroke of {max(half, 0.0):.3g} {unit} to each side{because}, ramps of {ramp:.3g} {unit} leave "
                f"{window:.2g} s of constant speed, less than the shortest window of {schedule.shortest:g} s"
            )
        elif stroke <= LEAST_RUN:
            runs.left_out[percent] = f"a stroke of {stroke:.3g} {unit} to each side is too short for a run"
        else:
            runs.strokes[percent] = stroke


def _warm_up(runs: Runs, schedule: Schedule) -> None:
    """There and back at the speed nearest to half of the largest, until the time is over."""
    if schedule.warm_up == 0.0:
        return
    percent = min(runs.strokes, key=lambda p: abs(p - 50.0))
    speed, stroke = runs.pace.velocity * percent / 100.0, runs.strokes[percent]
    while runs.duration < schedule.warm_up:
        runs.go(WARM_UP, -stroke, speed)
        runs.go(WARM_UP, stroke, speed)
    runs.go(WARM_UP, 0.0, speed)


def _breakaways(runs: Runs, schedule: Schedule, label: str, half: float) -> None:
    """Creeping runs out of the pose and back, each after a rest: the torque rises until the coordinate breaks away."""
    speed = runs.pace.velocity * schedule.creep / 100.0
    distance = min(speed * schedule.creeping, half)
    if schedule.breakaways and distance <= LEAST_RUN:
        raise InputError(
            f"{label}: the break-away tests creep only {distance:.3g} far, at {speed:.3g} per second for "
            f"{schedule.creeping:g} s: give more `creeping`, more `creep`, or `breakaways=0`"
        )
    for _ in range(schedule.breakaways):
        for sign, end in (("+", distance), ("-", 0.0)):
            runs.wait(max(schedule.pause, 1.0))
            part = runs.go(f"{label} stiction {sign}", end, speed)
            assert part is not None
            runs.breakaways.append(part)
    runs.wait(schedule.pause)


def _there_and_back(runs: Runs, schedule: Schedule, label: str) -> None:
    """Every speed in both directions, in an order that keeps the temperature steady."""
    for percent in alternating(list(runs.strokes)) * schedule.repeats:
        speed, stroke = runs.pace.velocity * percent / 100.0, runs.strokes[percent]
        runs.go(TRANSFER, -stroke, 0.5 * runs.pace.velocity)
        for sign, end in (("+", stroke), ("-", -stroke)):
            runs.wait(schedule.pause)
            part = runs.go(f"{label} {sign}{percent:g} %", end, speed)
            assert part is not None
            runs.windowed.append((part, percent))
    runs.wait(schedule.pause)


_OF_ANY, _OF_JOINT = 10.0, 7.0  # numbers of each sample, and of each of its joints
_RAMPS = 0.5  # seconds of speeding up and braking in a run


def check_size(robot: Robot, schedule: Schedule) -> None:
    """Refuse a plan whose samples take more memory than they may; the factors are measured."""
    run = math.sqrt(schedule.shortest * min(schedule.longest, 10.0 * schedule.shortest)) + _RAMPS
    runs, tests = 2.0 * schedule.repeats * len(schedule.percent), 2.0 * schedule.breakaways
    of_tests = tests * (schedule.creeping + schedule.pause + schedule.ramping)
    samples = schedule.rate * (schedule.warm_up + runs * (1.5 * run + schedule.pause) + of_tests)
    remedy = "lower `rate`, `warm_up`, `repeats`, `pause`, `creeping` or `ramping`"
    check_memory("the plan", FLOAT * samples * (_OF_ANY + _OF_JOINT * robot.n), f"{samples:.3g} samples", remedy)


STICTION = ".stiction"  # of the file with the ramps
STATED = 1.5  # times the friction that the robot's description states
CAP = 0.5  # of the torque limit, unless a torque is given


@dataclass(frozen=True)
class Ramp:
    """One rise of the torque, ``tau(t) = rate (t - start)``."""

    segment: str  # such as ``z1 stiction +``
    direction: int  # of the coordinate, 1 or -1
    start: float  # [s]
    end: float
    rate: float  # of the drive's torque, with its sign [Nm/s or N/s]

    @property
    def torque(self) -> float:
        """Size at its end [Nm or N]."""
        return abs(self.rate) * (self.end - self.start)


@dataclass(frozen=True)
class TorqueRamps:
    """Ramps of one drive's torque."""

    beside: ClassVar[Beside] = {"duration": lambda ramps: ramps.duration}

    file: str  # name of their file, such as ``z1.stiction.csv``
    drive: str  # the drive, and the unit of its torque: ``Nm`` or ``N``
    unit: str
    largest: float  # torque at the end of each [Nm or N]
    origin: str  # source of `largest`
    # gravity torque of the coordinate in the pose, in addition to the ramps; NaN where it is not known [Nm or N]
    gravity: float
    ramps: tuple[Ramp, ...]
    steps: int  # sampling periods in all
    rate: float  # samples per second [Hz]

    @property
    def duration(self) -> float:
        """From start to end [s]."""
        return self.steps / self.rate

    def samples(self, pose: Array) -> tuple[Samples, Array, list[str]]:
        """The pose at every sample, the torque of the drive, which is zero outside the ramps, and the segments."""
        time = np.arange(self.steps + 1) / self.rate
        still, torque = np.zeros((time.size, pose.size)), np.zeros(time.size)
        segments = np.full(time.size, REST, dtype=object)
        for ramp in self.ramps:
            inside = (time >= ramp.start - 1e-9) & (time <= ramp.end + 1e-9)
            segments[inside] = ramp.segment
            torque += np.where(inside, ramp.rate * (time - ramp.start), 0.0)
        return Samples(time, still + pose, still, still, still), torque, list(segments)


def torque_ramps(
    robot: Robot, schedule: Schedule, label: str, line: Array, gravity: float, given: float | None = None
) -> tuple[TorqueRamps | None, str]:
    """Ramps of the torque of the one drive that turns with a coordinate.

    Each lasts ``schedule.ramping`` and ends at the largest torque: the one that is given, or 1.5 times the Coulomb
    friction that the robot's description states, but no more than half of the torque limit.
    """
    turning = turning_drives(robot, line)
    if schedule.breakaways == 0 or given == 0.0:
        return None, "none were requested"
    if len(turning) != 1:
        return None, (
            f"{', '.join(name for _, name, _ in turning)} move together, so their frictions cannot be "
            "separated; give `drives`"
        )
    ((number, drive, slope),) = turning
    limits = robot.limits if robot.transmission is None else robot.transmission.limits
    slides = any(d != 0.0 and j.kind == "prismatic" for j, d in zip(robot.joints, line, strict=True))
    limit, unit = float(limits.torque[number]), "N" if slides else "Nm"
    weight = abs(gravity) if np.isfinite(gravity) else 0.0
    if given is not None and given + weight > limit:
        bearing = f" on top of the {weight:.3g} {unit} of gravity" if weight > 1e-6 else ""
        raise InputError(
            f"{label}: a torque ramp to {given:g} {unit}{bearing} exceeds the limit of {limit:g} {unit}; "
            "give a lower `torque_ramp`"
        )
    largest, origin = (given, "given") if given is not None else _largest(robot, number, limit, weight, unit)
    if largest is None:
        return None, origin
    ramps, steps = _schedule(schedule, label, largest, 1.0 if slope > 0 else -1.0)
    file = file_name(label, STICTION)
    return TorqueRamps(file, drive, unit, largest, origin, gravity, ramps, steps, schedule.rate), ""


def file_name(label: str, ending: str = "") -> str:
    """Name of a coordinate's trajectory file, such as ``z1.csv``, or of that with its ramps, ``z1.stiction.csv``."""
    return re.sub(r"[^\w.-]", "_", label) + ending + ".csv"


def turning_drives(robot: Robot, line: Array) -> list[tuple[int, str, float]]:
    """Number, name and speed of the drives that turn where the joints move on a line."""
    transmission = transmission_of(robot)
    speeds = enumerate(zip(transmission.drives, transmission.coupling @ line, strict=True))
    return [(k, drive.name, float(v)) for k, (drive, v) in speeds if abs(v) > 1e-12]


def _largest(robot: Robot, number: int, limit: float, weight: float, unit: str) -> tuple[float | None, str]:
    """Largest torque and its source; None and the reason where there is none."""
    stated = transmission_of(robot).drives[number].coulomb
    if stated is None or not stated > 0.0:
        return None, "the robot's description states no friction; give `torque_ramp`, the largest torque"
    wanted, most = STATED * stated, min(CAP * limit, limit - weight)
    if wanted <= most:
        return wanted, f"{STATED:g} times the Coulomb friction that the robot's description states"
    if most <= 0.0:
        return None, f"gravity of {weight:.3g} {unit} exceeds the torque limit of {limit:g} {unit}"
    beyond = f"; the stated friction of {stated:g} {unit} is larger, so the drive may not break away"
    return most, f"{100 * CAP:g} % of the torque limit, or what gravity leaves of it{beyond if most < stated else ''}"


def _schedule(schedule: Schedule, label: str, largest: float, sign: float) -> tuple[tuple[Ramp, ...], int]:
    """Ramps one after the other, in alternating directions, and the sampling periods that all of it takes."""
    rest, rise = (int(np.ceil(s * schedule.rate - 1e-9)) for s in (max(schedule.pause, 1.0), schedule.ramping))
    ramps, steps = [], 0
    for number in range(2 * schedule.breakaways):
        steps += rest
        direction = 1 if number % 2 == 0 else -1
        start, end = steps / schedule.rate, (steps + rise) / schedule.rate
        rate = sign * direction * largest / (end - start)
        ramps.append(Ramp(f"{label} stiction {'+' if direction > 0 else '-'}", direction, start, end, rate))
        steps += rise
    return tuple(ramps), steps + rest
