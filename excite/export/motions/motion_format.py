"""Interface of the formats of motions, what to record while one is played, and what its limits are then."""

from __future__ import annotations

import json
import re
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any, ClassVar

import numpy as np

from constraints.certificate import LimitUse
from constraints.enclosure import uses_of
from constraints.interpolation import Curve, InterpolatedLimits, curve_pieces, interpolated_limits
from constraints.linear import linear_limits
from excite.design.design import Design
from excite.errors import BrokenLimitError
from excite.export.motions.sampled_design import MOST_SAMPLES, SampledDesign, sampled_design
from excite.tasks.reference import MotionSource, broken_limits, refuse_broken
from excite.trajectories.transfer import Transfer
from regressors.errors import InputError, printable
from regressors.robot.robot import Robot
from regressors.samples import Array


@dataclass(frozen=True)
class MotionFile:
    """Content of the file or the folder of a motion, and what has to be known of it."""

    content: bytes
    notes: tuple[str, ...] = ()  # one sentence each
    folder: Mapping[str, bytes] = field(default_factory=dict)  # files below it, the last of which makes it complete


class MotionFormat(ABC):
    """A file that a controller, or another program, plays a motion from.

    Attributes
    ----------
    name : str
        Short name, as in ``--format``.
    suffix : str
        Ending that the file must have; any where it is empty.
    default_rate, slowest, fastest : float
        Rates of the samples [Hz]: where none is given, and the least and the largest that the controller takes.
    most : int
        Samples that a file may have.
    joints : tuple of int
        Numbers of joints that fit; any where it is empty.
    revolute : bool
        True where the format has no prismatic joints.
    interpolation : Interpolation
        What the controller makes of the samples.
    given : int
        Highest derivative of the positions that the file has: 0, 1 or 2.
    whole_nanoseconds : bool
        True where times are written in whole nanoseconds.
    decimals : int or None
        Of the positions in the file; all digits where it is None.
    degrees : bool
        True where the positions in the file are angles in degrees.
    checked : str
        What the format is checked with, and what not, one sentence.
    """

    name: ClassVar[str]
    suffix: ClassVar[str] = ""
    default_rate: ClassVar[float]
    slowest: ClassVar[float] = 1e-3
    fastest: ClassVar[float]
    most: ClassVar[int] = MOST_SAMPLES
    joints: ClassVar[tuple[int, ...]] = ()
    revolute: ClassVar[bool] = True
    interpolation: ClassVar[Interpolation]
    given: ClassVar[int] = 2
    whole_nanoseconds: ClassVar[bool] = False
    decimals: ClassVar[int | None] = None
    degrees: ClassVar[bool] = False
    checked: ClassVar[str]

    @abstractmethod
    def file(self, motion: SampledDesign, stem: str) -> MotionFile:
        """Content of the file, the same bytes for the same motion.

        Parameters
        ----------
        motion : SampledDesign
            As of `sampled`.
        stem : str
            Name of the file without its ending.
        """

    @abstractmethod
    def recorder(self, motion: SampledDesign, name: str) -> Recorder:
        """What to record while the motion is played; the file has the given name."""

    def sampled(self, design: Design, rate: float) -> SampledDesign:
        """A motion at a rate [Hz], in the numbers that are written: what is certified."""
        quintics = self.interpolation is Interpolation.QUINTIC
        motion = sampled_design(design, rate, breaks=quintics, whole_nanoseconds=self.whole_nanoseconds, most=self.most)
        if self.decimals is None:
            return motion
        unit = np.pi / 180.0 if self.degrees else 1.0
        q = unit * np.round(motion.samples.q / unit, self.decimals)
        return replace(motion, samples=replace(motion.samples, q=q))

    def check(self, motion: SampledDesign) -> None:
        """Raise an error where the controller would not take the motion, beside the robot's own limits."""
        return None

    def check_robot(self, robot: Robot) -> None:
        """Raise `InputError` where the joints of a robot do not fit the format."""
        if self.joints and robot.n not in self.joints:
            expected = " or ".join(map(str, self.joints))
            raise InputError(
                f"the format {self.name} is for robots of {expected} joints, and {robot.name} has {robot.n}: "
                f"{', '.join(robot.joint_names)}"
            )
        prismatic = [joint.name for joint in robot.joints if joint.kind == "prismatic"]
        if self.revolute and prismatic:
            raise InputError(
                f"the format {self.name} has angles of revolute joints only, and {robot.name} has prismatic ones: "
                f"{', '.join(prismatic)}"
            )

    def check_rate(self, rate: float) -> None:
        """Raise `InputError` where the controller does not take a rate [Hz]."""
        if not self.slowest <= rate <= self.fastest:
            least = "" if self.slowest == self.fastest else f"{self.slowest:g} to "
            raise InputError(f"`rate` {rate:g} Hz: the format {self.name} takes {least}{self.fastest:g} Hz")


@dataclass(frozen=True)
class Recorder:
    """A recorder of a played motion."""

    mapping: Mapping[str, Any]  # sections of a log mapping, see `excite.logs.mapping`
    about: tuple[str, ...]  # lines for the comment of the mapping: what records, at which rate, where the motion starts
    suffix: str = ""  # ending of the file that the recorder takes, such as ``.xml``; empty where there is none
    content: str = ""  # of that file
    notes: tuple[str, ...] = ()  # what has to be known of the recording, one sentence each

    def mapping_text(self, motion: SampledDesign) -> str:
        """The log mapping as YAML, with the hash of the design by which `identify` finds it."""
        comment = [f"# {printable(line)}" for line in (*self.about, *motion.heading)]
        entries = {**self.mapping, "joints": list(motion.joints), "design": motion.sha256}
        lines = [f"{name}: {json.dumps(value, ensure_ascii=False)}" for name, value in entries.items()]
        return "\n".join([*comment, *lines, ""])


def columns(form: str, names: Sequence[object]) -> list[str]:
    """Names of the columns of every joint, such as ``state.q[0]`` of the form ``state.q[{}]``."""
    return [form.format(name) for name in names]


def channels(time: tuple[str, str], names: Sequence[object], **signals: tuple[str, str]) -> dict[str, Any]:
    """Sections of a log mapping: column and unit of the time, and form and unit of the columns of each signal."""
    sections = {name: {"columns": columns(form, names), "unit": unit} for name, (form, unit) in signals.items()}
    gains = {"gain": [1.0] * len(names)}
    return {
        "time": {"column": time[0], "unit": time[1]},
        **{name: section | (gains if name == "current" else {}) for name, section in sections.items()},
    }


def xml_comment(motion: SampledDesign) -> str:
    """Lines of the heading for a comment of XML, in which two hyphens are not allowed."""
    return "\n".join(f"  {re.sub('-(?=-)', '- ', line)}" for line in motion.heading)


def check_stem(stem: str, suffix: str, what: str, form: str, expected: str) -> None:
    """Raise `InputError` where the name of a file cannot be that of the program in it."""
    if not re.fullmatch(form, stem):
        raise InputError(
            f"{stem}{suffix}: the {what} has the name of the file, which must be letters, digits and _{expected}"
        )


HOUSE = "time [s], then NAME.position, NAME.velocity, NAME.effort of every joint [SI], as a CSV file with this header"


def house_recorder(motion: SampledDesign) -> Recorder:
    """A recorder that writes CSV as `excite simulate` does."""
    signals = {"position": "rad", "velocity": "rad/s", "effort": "Nm"}
    return Recorder(
        channels(("time", "s"), motion.joints, **{name: (f"{{}}.{name}", unit) for name, unit in signals.items()}),
        (
            f"record: {HOUSE}",
            f"rate: {motion.rate:g} Hz or faster, from before the start of the motion until after its end",
            "start marker: none; the robot rests before the motion and after it, and identify finds where it moves",
        ),
    )


def rows_of(table: Array, separator: str = ",") -> Iterator[str]:
    """Text of each row, from which the numbers are read back exactly."""  # table (N, k)
    row_form = separator.join(["%.17g"] * table.shape[1])
    return (row_form % tuple(row) for row in table.tolist())


def timed_rows(motion: SampledDesign, names: Sequence[str], table: Array) -> bytes:
    """A CSV file: heading as a comment, names, rows of time [s] to the nanosecond and numbers that read back."""
    # table (N, len(names))
    head = [*(f"# {line}" for line in motion.heading), ",".join(["time", *names])]
    rows = zip(motion.time.tolist(), rows_of(table + 0.0), strict=True)
    return "\n".join([*head, *(f"{t:.9f},{row}" for t, row in rows), ""]).encode()


_ROUNDING = 1e-9  # of a limit that a formula may touch


class Interpolation(Enum):
    """What a controller makes of samples, as the text of a note; where it is not known, every curve is certified."""

    QUINTIC = "quintics through positions, velocities and accelerations, whose extrema are exact"
    LINEAR = "straight lines between positions; velocities, accelerations and jerks are differences of the samples"
    NOT_DOCUMENTED = "what the controller makes of the samples is not documented"
    NONE = "what a program makes of the samples between them is not known"

    @property
    def curves(self) -> tuple[Curve, ...]:
        """Curves that may pass through the samples."""
        return {Interpolation.QUINTIC: (Curve.QUINTICS,), Interpolation.LINEAR: (Curve.LINES,)}.get(self, tuple(Curve))


def check_formula(motion: SampledDesign) -> None:
    """Refuse a design whose own motion breaks a limit; what `broken_limits` does not know, the design states."""
    design = motion.design
    source = MotionSource(design.robot, design.task, design.trajectory, None, None, {"friction_plan": None})
    transfers = [piece.motion for piece in motion.sequence.pieces if isinstance(piece.motion, Transfer)]
    limits = linear_limits(motion.robot)
    uses = [use for transfer in transfers for use in uses_of(transfer, limits)]
    broken = [*broken_limits(source), *(use for use in uses if use.margin < -_ROUNDING * abs(use.bound))]
    remedy = "design it again within the limits"
    if broken:
        refuse_broken(broken, remedy)
    if design.broken:
        more = f" and {len(design.broken) - 1} more" if len(design.broken) > 1 else ""
        raise BrokenLimitError(f"the design does not keep its limits: {design.broken[0]}{more}; {remedy}")


Certificate = list[InterpolatedLimits]  # of every curve that a controller may lay through the samples


def certify(motion: SampledDesign, interpolation: Interpolation, given: int = 2) -> Certificate:
    """Certificate of the limits of joints and drives for what is interpolated, to 1e-6 of their bounds."""
    limits = linear_limits(motion.robot)
    return [interpolated_limits(limits, motion.samples, curve, given) for curve in interpolation.curves]


def closest_first(certificate: Certificate, *, broken: bool = False) -> list[LimitUse]:
    """Uses of the limits by every curve, or those beyond a limit by more than 1e-6 of it, the closest first."""
    uses = (use for each in certificate for use in (each.broken if broken else each.uses))
    return sorted(uses, key=lambda use: -use.use)


def deviation(motion: SampledDesign, interpolation: Interpolation) -> float | None:
    """Largest distance of what is interpolated from the design in mid-step [rad or m]; None where that is not known."""
    if len(interpolation.curves) > 1:
        return None
    half = 0.5 * np.diff(motion.time)
    exact = motion.sequence.at(motion.time[:-1] + half)[0].q
    pieces = curve_pieces(motion.samples, interpolation.curves[0])
    powers = half[:, None] ** np.arange(len(pieces) - 1.0, -1.0, -1.0)[:, None, None]
    return float(np.abs((pieces * powers).sum(axis=0) - exact).max())


def check_interpolated(certificate: Certificate, interpolation: Interpolation) -> None:
    """Raise `BrokenLimitError` where what is interpolated breaks a limit."""
    if broken := closest_first(certificate, broken=True):
        remedy = f"raise `rate`, or design it again with a lower `{broken[0].quantity}`"
        refuse_broken(broken, f"between the samples of the file: {interpolation.value}; {remedy}")
