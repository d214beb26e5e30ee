"""Schedule of the runs of each measured coordinate: speeds, windows, warm-up, break-away tests, order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from regressors.arguments import checked
from regressors.errors import InputError
from regressors.quantities import check_options

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

    percent: tuple[float, ...] = PERCENT
    rate: float = 500.0
    shortest: float = 0.2
    longest: float = LONGEST
    stroke: float = np.inf
    warm_up: float = 30.0
    repeats: int = 1
    creep: float = 0.1
    creeping: float = 10.0
    breakaways: int = 3
    pause: float = 0.5
    ramping: float = 5.0

    def __post_init__(self) -> None:
        check_options(self, (field.name for field in fields(self)))
        if not self.percent:
            raise InputError("`percent` needs at least one speed, given none")
        if len(set(self.percent)) < len(self.percent):
            raise InputError(
                f"duplicate speeds in `percent`: {_list(self.percent)}; give `repeats` to play all speeds again"
            )
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


def _list(numbers: Sequence[float]) -> str:
    return ", ".join(f"{number:g}" for number in numbers) or "none"
