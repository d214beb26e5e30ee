"""Reference motions, from a design or a file: anything that can be sampled at any time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from scipy.interpolate import PPoly

from constraints.bounds.interpolation import Curve, curve_pieces
from excite.simulation.ramps import GivenTorque
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

_CLOSED = 1e-6  # rad or m


class Reference(Protocol):
    """A motion that can be evaluated at any instant, such as `excite.trajectories.Trajectory`."""

    @property
    def duration(self) -> float:
        """Duration from start to end [s]."""

    def samples(self, time: Array) -> Samples:
        """Motion at given instants between 0 and the duration [s]."""


@dataclass(frozen=True, eq=False)
class Repeated:
    """A motion repeated several times in sequence."""

    motion: Reference
    periods: int

    def __post_init__(self) -> None:
        ends = self.motion.samples(np.array([0.0, self.motion.duration])).q
        gap = float(np.abs(ends[1] - ends[0]).max())
        if self.periods > 1 and gap > _CLOSED:
            raise InputError(
                f"a motion that ends {gap:.3g} rad (m) from where it starts cannot be repeated; play it once"
            )

    @property
    def duration(self) -> float:
        """Duration of all periods together [s]."""
        return self.periods * self.motion.duration

    def samples(self, time: Array) -> Samples:
        """Motion at given instants [s]; at rest at the end position afterwards."""
        period = self.motion.duration
        whole = np.clip(np.floor(time / period), 0, self.periods - 1)
        samples = self.motion.samples(np.clip(time - whole * period, 0.0, period))
        return Samples(time, samples.q, samples.dq, samples.ddq, samples.dddq)


@dataclass(frozen=True, eq=False)
class Awaited:
    """A motion preceded by rest at its start."""

    motion: Reference  # at rest at its start
    wait: float  # [s]

    @property
    def duration(self) -> float:
        """Duration of rest and motion together [s]."""
        return self.wait + self.motion.duration

    def samples(self, time: Array) -> Samples:
        """Rest, then the motion, at given instants [s]."""
        samples = self.motion.samples(np.maximum(time - self.wait, 0.0))
        moving = (time >= self.wait)[:, None]
        return Samples(time, samples.q, *(np.where(moving, x, 0.0) for x in (samples.dq, samples.ddq, samples.dddq)))


@dataclass(frozen=True, eq=False)
class SampledMotion:
    """Motion interpolated between samples by quintics with their positions, velocities and accelerations."""

    given: Samples  # two or more, at increasing times; their jerk is not used

    def __post_init__(self) -> None:
        if self.given.time.size < 2 or not np.all(np.diff(self.given.time) > 0):
            raise InputError("a sampled motion needs two samples or more at increasing times")

    @property
    def duration(self) -> float:
        """Duration from the first sample to the last [s]."""
        return float(self.given.time[-1] - self.given.time[0])

    def samples(self, time: Array) -> Samples:
        """Motion at given instants [s], counted from the first sample."""
        instants = np.asarray(time, dtype=float)
        return Samples(instants, *(self._curve(instants, nu=order) for order in range(4)))

    @cached_property
    def _curve(self) -> PPoly:
        """Positions over time from the first sample."""
        return PPoly(curve_pieces(self.given, Curve.QUINTICS), self.given.time - self.given.time[0])


def check_joints(reference: Samples, joints: tuple[str, ...]) -> None:
    """Raise `InputError` where a motion does not have one column per joint."""
    if reference.q.shape[1] != len(joints):
        raise InputError(
            f"the motion has {reference.q.shape[1]} joints, the robot that moves has {len(joints)}: {', '.join(joints)}"
        )


@dataclass(frozen=True, eq=False)
class MotionSource:
    """A motion and its origin.

    Parameters
    ----------
    robot : Robot
        The whole robot.
    task : Task
        Gives the moving joints.
    motion : Reference
    ramps : GivenTorque or None
    file : Path or None
        File of the motion, where it is not the design's own.
    origin : mapping
        Design or friction plan, for the sidecar of a log.
    """

    robot: Robot
    task: Task
    motion: Reference
    ramps: GivenTorque | None
    file: Path | None
    origin: Mapping[str, Any]

    @property
    def planned(self) -> bool:
        """True if the motion is from a friction plan."""
        return self.origin["friction_plan"] is not None
