"""Output of a design: sampling rate, approach and return, rehearsals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from excite.tasks.option import essential, option
from excite.tasks.values import strict
from regressors.errors import InputError

MOST_SAMPLES = 1_000_000  # rows of trajectory.csv
ROBOTS_HOME: Literal["robot"] = "robot"


@dataclass(frozen=True)
class Output:
    """Sampling and execution of a motion.

    Parameters
    ----------
    rate : float
        Sampling rate of the written motion and of the reported criteria [Hz].
    home : tuple of float, or "robot", optional
        Pose of all joints from which the robot comes and to which it returns [rad or m], or ``"robot"`` for the one in
        its description; the exciting motion alone if not given.
    via : tuple of (tuple of float)
        Poses to pass between home and the motion [rad or m].
    settle : float
        Rest between approach, exciting motion and return [s].
    speed : tuple of float
        Fractions of full speed, in (0, 1], at which the motion is written as well.

    Raises
    ------
    InputError
        Invalid numbers, or via poses without a home.
    """

    rate: float = essential(100.0, "number", "Samples per second of the file.", metavar="HZ")
    home: tuple[float, ...] | Literal["robot"] | None = option(
        None, "pose", "Home pose, before and after the motion; robot: that of its file.", metavar="Q,..."
    )
    via: tuple[tuple[float, ...], ...] = option(
        (), "poses", "Waypoint between home and the motion; repeatable.", metavar="Q,..."
    )
    settle: float = option(1.0, "number", "Rest before and after the exciting motion.", metavar="S")
    speed: tuple[float, ...] = option(
        (), "numbers", "Write slower rehearsals too: 0.1 for a tenth of speed.", metavar="V,..."
    )

    def __post_init__(self) -> None:
        strict(self)
        if self.via and self.home is None:
            raise InputError("`via` gives poses between home and the motion, but there is no home; give `home`")
        if isinstance(self.home, str) and self.home != ROBOTS_HOME:
            raise InputError(f"home must be a pose, or {ROBOTS_HOME!r} for that of its file; given {self.home!r}")

    def check_duration(self, period: float) -> None:
        """Raise `InputError` where a motion of this duration [s] is not a whole number of samples, or too many."""
        samples, description = self.rate * period, f"{period:g} s at {self.rate:g} Hz"
        if samples > MOST_SAMPLES:
            raise InputError(f"{description} is {samples:.6g} samples; expected {MOST_SAMPLES} or fewer")
        if samples < 1 or abs(samples - round(samples)) > 1e-9 * samples:
            nearest = max(1, round(samples)) / self.rate
            raise InputError(
                f"{description} is {samples:g} samples, not a whole number; the nearest period is {nearest:.12g} s"
            )
        for speed in self.speed:
            if (slower := samples / speed) > MOST_SAMPLES:
                raise InputError(f"at speed {speed:g} are {slower:.6g} samples; expected {MOST_SAMPLES} or fewer")
