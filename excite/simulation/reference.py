"""Reference motions: anything that can be sampled at any time; repeated, delayed, or interpolated from samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from regressors.errors import InputError
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
    """A motion repeated several times in sequence.

    Parameters
    ----------
    motion : Reference
    periods : int

    Raises
    ------
    InputError
        Several periods of a motion that does not end where it starts.
    """

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
    """A motion preceded by rest at its start.

    Parameters
    ----------
    motion : Reference
        At rest at its start.
    wait : float
        [s]
    """

    motion: Reference
    wait: float

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
    """Motion interpolated between samples by quintics with their positions, velocities and accelerations.

    Parameters
    ----------
    given : Samples
        Two or more, at increasing times; their jerk is not used.

    Raises
    ------
    InputError
        Fewer samples, or times that do not increase.
    """

    given: Samples

    def __post_init__(self) -> None:
        if self.given.time.size < 2 or not np.all(np.diff(self.given.time) > 0):
            raise InputError("a sampled motion needs two samples or more at increasing times")

    @property
    def duration(self) -> float:
        """Duration from the first sample to the last [s]."""
        return float(self.given.time[-1] - self.given.time[0])

    def samples(self, time: Array) -> Samples:
        """Motion at given instants [s], counted from the first sample."""
        at = self.given.time - self.given.time[0]
        k = np.clip(np.searchsorted(at, time, side="right") - 1, 0, at.size - 2)
        h = (at[k + 1] - at[k])[:, None]
        s = (np.asarray(time) - at[k])[:, None] / h
        q, dq, ddq = (x[k] for x in (self.given.q, self.given.dq, self.given.ddq))
        rise = self.given.q[k + 1] - q - h * dq - h**2 / 2 * ddq
        slope = h * (self.given.dq[k + 1] - dq) - h**2 * ddq
        bend = h**2 * (self.given.ddq[k + 1] - ddq)
        # of the quintic q + h dq s + h^2 ddq s^2 / 2 + a s^3 + b s^4 + c s^5
        a = 10 * rise - 4 * slope + bend / 2
        b = -15 * rise + 7 * slope - bend
        c = 6 * rise - 3 * slope + bend / 2
        return Samples(
            np.asarray(time, dtype=float),
            q + s * (h * dq + s * (h**2 * ddq / 2 + s * (a + s * (b + s * c)))),
            (h * dq + s * (h**2 * ddq + s * (3 * a + s * (4 * b + s * 5 * c)))) / h,
            (h**2 * ddq + s * (6 * a + s * (12 * b + s * 20 * c))) / h**2,
            (6 * a + s * (24 * b + s * 60 * c)) / h**3,
        )


def check_joints(reference: Samples, joints: tuple[str, ...]) -> None:
    """Raise `InputError` where a motion does not have one column per joint."""
    if reference.q.shape[1] != len(joints):
        raise InputError(
            f"the motion has {reference.q.shape[1]} joints, the robot that moves has {len(joints)}: {', '.join(joints)}"
        )
