"""Slow ramps of a drive's torque from rest, up to where it breaks away: stiction of robots with a torque interface.

The coordinate is held in a pose; the torque of its drive alone rises in proportion to time, in one direction and then
in the other, with rests between in which a position controller returns the drive to the pose. The torque is that of
friction: the controller adds the gravity torque of the pose.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from excite.friction.plan.runs import REST
from excite.friction.plan.schedule import Schedule
from excite.storage.codec import Beside
from regressors.errors import InputError
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

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

    def torque(self, time: Array) -> Array:
        """Torque of the drive at given instants, zero outside the ramps [s, Nm or N]."""
        torques = np.zeros(time.size)
        for ramp in self.ramps:
            torques += np.where(_inside(ramp, time), ramp.rate * (time - ramp.start), 0.0)
        return torques

    def samples(self, pose: Array) -> tuple[Samples, Array, list[str]]:
        """The pose at every sample, the torque of the drive, and the segments."""
        time = np.arange(self.steps + 1) / self.rate
        still = np.zeros((time.size, pose.size))
        segments = np.full(time.size, REST, dtype=object)
        for ramp in self.ramps:
            segments[_inside(ramp, time)] = ramp.segment
        return Samples(time, still + pose, still, still, still), self.torque(time), list(segments)


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
    limit, unit = _limit(robot, number), _unit(robot, line)
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
    if robot.transmission is None:
        named = zip(robot.joint_names, line, strict=True)
    else:
        named = zip((d.name for d in robot.transmission.drives), robot.transmission.coupling @ line, strict=True)
    return [(k, name, float(v)) for k, (name, v) in enumerate(named) if abs(v) > 1e-12]


def _inside(ramp: Ramp, time: Array) -> Array:
    return np.asarray((time >= ramp.start - 1e-9) & (time <= ramp.end + 1e-9))


def _limit(robot: Robot, number: int) -> float:
    limits = robot.limits if robot.transmission is None else robot.transmission.limits
    return float(limits.torque[number])


def _unit(robot: Robot, line: Array) -> str:
    return "N" if any(d != 0.0 and j.kind == "prismatic" for j, d in zip(robot.joints, line, strict=True)) else "Nm"


def _largest(robot: Robot, number: int, limit: float, weight: float, unit: str) -> tuple[float | None, str]:
    """Largest torque and its source; None and the reason where there is none."""
    stated = None if robot.transmission is None else robot.transmission.drives[number].coulomb
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
