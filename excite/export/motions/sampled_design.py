"""The motion of a design, sampled for a format: instants, positions, velocities, accelerations of every joint."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from excite.design.design import Design
from excite.trajectories import Trajectory
from excite.trajectories.sequence import MotionSequence, WholeRobotMotion
from excite.trajectories.transfer import Transfer
from regressors.errors import InputError, NumericalError, printable
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

MOST_SAMPLES = 200_000
SEGMENTS = {"approach": 1, "excite": 2, "return": 3}  # numbers of the segments, where a file has no names
_STILL = 1e-6  # of the largest velocity or acceleration, that an end at rest may have
_FEWEST = 4  # samples in a period of the fastest harmonic
_APART = 0.1  # of a sampling period, the least between two breaks
_SECOND = 1e9  # ns
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class SampledDesign:
    """A design's whole motion, approach and return included, at the instants that a format writes."""

    design: Design
    robot: Robot  # the whole robot with the task's limits
    sequence: MotionSequence
    rate: float  # [Hz]
    samples: Samples  # motion of every joint; exactly at rest at both ends
    segments: tuple[str, ...]  # ``approach``, ``excite`` or ``return``, of each instant
    commanded: tuple[str, ...] | None = None  # joints of the samples, where they are not those of every joint

    @property
    def time(self) -> Array:
        """Instants from 0, shape (N,) [s]."""
        return self.samples.time

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that are written, in the robot's order."""
        return self.robot.joint_names if self.commanded is None else self.commanded

    @property
    def of_drives(self) -> SampledDesign:
        """The same motion of the joints that drives act on, which is what a controller commands."""
        names, s = self.robot.joint_names, self.samples
        driven = [k for k, name in enumerate(names) if name not in self.robot.passive]
        if len(driven) == len(names):
            return self
        samples = Samples(s.time, *(x[:, driven] for x in (s.q, s.dq, s.ddq, s.dddq)))
        return replace(self, samples=samples, commanded=tuple(names[k] for k in driven))

    @property
    def sha256(self) -> str:
        """The hash by which `identify` finds the design: that of ``design.json``, or else of its coefficients."""
        return self.design.file_sha256 or self.design.coefficients_sha256

    @property
    def heading(self) -> tuple[str, ...]:
        """Lines for the comment at the head of a file, in printable ASCII."""
        name = self.design.folder.resolve().name if self.design.folder is not None else "not saved"
        lines = (
            f"motion of a design of excite: {name}",
            f"robot: {self.robot.name}",
            f"design.json sha256: {self.design.file_sha256 or 'none, the design was not loaded from a folder'}",
            f"coefficients sha256: {self.design.coefficients_sha256}",
            f"joints: {', '.join(self.joints)}",
            *(("joints without a drive follow",) if self.commanded is not None else ()),
            f"{self.time.size} samples over {self.time[-1]:.9g} s, nominal rate {self.rate:.12g} Hz",
        )
        return tuple(printable(line).encode("ascii", "replace").decode() for line in lines)


def sampled_design(
    design: Design, rate: float, *, breaks: bool = False, whole_nanoseconds: bool = False, most: int = MOST_SAMPLES
) -> SampledDesign:
    """Sample a design's whole motion by the formulas of its pieces; until the last sample the robot rests there."""
    sequence = design.sequence
    family = design.trajectory.family
    fastest = max(family.richness, 1) / family.duration
    if rate < _FEWEST * fastest:
        raise InputError(
            f"`rate` {rate:g} Hz is too low to show the motion, whose {family.described} reach about {fastest:.3g} Hz: "
            f"give {_FEWEST * fastest:.4g} Hz or more"
        )
    count = math.ceil(sequence.duration * rate * (1.0 - _ROUNDING)) + 1
    if count > most:
        raise InputError(
            f"{sequence.duration:g} s at {rate:g} Hz are {count} samples; expected {most} or fewer: lower `rate`"
        )
    _check_rest(design)
    time = np.arange(max(count, 2)) / rate
    if breaks:
        time = _between_breaks(sequence, time[-1], rate)
    if whole_nanoseconds:  # the last one not before the end of the motion
        time = np.append(np.round(time[:-1] * _SECOND), np.ceil(time[-1] * _SECOND - 1e-3)) / _SECOND
    samples, segments = sequence.at(time)
    for quantity, values in (("position", samples.q), ("velocity", samples.dq), ("acceleration", samples.ddq)):
        finite = np.isfinite(values).all(axis=1)
        if not finite.all():  # which no limit would refuse
            at = samples.time[int(np.argmin(finite))]
            raise NumericalError(f"the {quantity} of the motion at {at:.6g} s is not a finite number")
        if quantity != "position":
            values[[0, -1]] = 0.0
    plain = Samples(time, *(x + 0.0 for x in (samples.q, samples.dq, samples.ddq, samples.dddq)))  # no negative zeros
    return SampledDesign(design, design.task.limits.applied(design.robot), sequence, rate, plain, tuple(segments))


def _check_rest(design: Design) -> None:
    """Raise `InputError` where the family's motion begins or ends with a velocity or an acceleration."""
    trajectory = design.trajectory
    time = np.linspace(0.0, trajectory.duration, 201)
    for derivative, quantity in ((1, "velocity"), (2, "acceleration")):
        motion = np.abs(trajectory.family.motion(trajectory.x, time, derivative))
        if motion[[0, -1]].max(initial=0.0) > _STILL * motion.max(initial=0.0):
            raise InputError(
                f"the motion of the family {trajectory.family.name} begins or ends with {quantity}, and a robot that "
                "stands still cannot follow it: design it with a family that begins and ends at rest, such as fourier"
            )


def _between_breaks(sequence: MotionSequence, end: float, rate: float) -> Array:
    """Breaks, and equal steps of a sampling period or longer between them; breaks that are too near are left out."""
    marks = [0.0]
    for at in breaks_of(sequence):
        if at - marks[-1] > _APART / rate and end - at > _APART / rate:
            marks.append(float(at))
    marks.append(end)
    counts = [max(1, math.floor((b - a) * rate * (1.0 + _ROUNDING))) for a, b in pairwise(marks)]
    steps = [np.linspace(a, b, n, endpoint=False) for (a, b), n in zip(pairwise(marks), counts, strict=True)]
    return np.concatenate([*steps, [end]])


def breaks_of(sequence: MotionSequence) -> Array:
    """Instants at which pieces meet, and at which a transfer or a spline changes its polynomial [s]."""
    instants, begin = [0.0], 0.0
    for piece in sequence.pieces:
        motion = piece.motion
        if isinstance(motion, Transfer):
            legs = np.concatenate([[0.0], motion.ends[:-1]])
            for at, leg in zip(legs, motion.legs, strict=True):
                instants += (begin + at + leg.law.breaks).tolist()
        if isinstance(motion, WholeRobotMotion) and isinstance(motion.motion, Trajectory):
            instants += (begin + motion.motion.family.breaks(motion.motion.x)).tolist()
        begin += motion.duration
        instants.append(begin)
    return np.unique(np.round(instants, 12))
