"""What spoils a simulated log: every option of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from regressors.errors import InputError

_PER_JOINT = ("torque_gain", "delay", "coloured_noise", "position_step")


@dataclass(frozen=True)
class Degradation:
    """What happens to a log between the robot and the file; nothing does by default.

    First come the torques: friction that drifts, a wrong gain, a delay, noise that is not white; then what the recorder
    does with whole rows: positions in steps, rows held, rows stamped late, rows dropped.

    Parameters
    ----------
    friction_drift : float
        Relative change of friction from the first instant to the last, as the joints warm up: -0.3 is 30 % less.
    torque_gain : tuple of float
        Measured over true torque, one for all joints or one each.
    delay : tuple of float
        Time by which torques are recorded later than positions, one for all joints or one each [s].
    coloured_noise : tuple of float
        Standard deviation of torque noise that is correlated in time, one for all joints or one each [Nm or N].
    noise_corner : float
        Corner frequency of the first-order low-pass that colours it [Hz].
    position_step : tuple of float
        Positions are rounded to whole multiples of it, one for all joints or one each [rad or m]; 0 for none.
    hold : float
        Share of the rows that repeat the numbers of the row before.
    clock_jitter : tuple of two floats, optional
        Shortest and longest time between two stamps [s].
    drop_rows : float
        Share of the rows that are missing.

    Raises
    ------
    InputError
        An invalid number.
    """

    friction_drift: float = 0.0
    torque_gain: tuple[float, ...] = (1.0,)
    delay: tuple[float, ...] = (0.0,)
    coloured_noise: tuple[float, ...] = (0.0,)
    noise_corner: float = 5.0
    position_step: tuple[float, ...] = (0.0,)
    hold: float = 0.0
    clock_jitter: tuple[float, float] | None = None
    drop_rows: float = 0.0

    def __post_init__(self) -> None:
        for name in _PER_JOINT:
            given = getattr(self, name)
            object.__setattr__(self, name, tuple(given) if isinstance(given, tuple | list) else (float(given),))
        if not (math.isfinite(self.friction_drift) and self.friction_drift > -1):
            raise InputError(f"friction_drift must be a number above -1, given {self.friction_drift:g}")
        if not (math.isfinite(self.noise_corner) and self.noise_corner > 0):
            raise InputError(f"noise_corner must be a frequency greater than zero, given {self.noise_corner:g}")
        for name in ("hold", "drop_rows"):
            if not 0 <= getattr(self, name) < 1:
                raise InputError(f"{name} must be a share of rows, from 0 to below 1, given {getattr(self, name):g}")
        _check_all("torque_gain", self.torque_gain, lambda value: value != 0, "a number other than zero")
        _check_all("delay", self.delay, lambda value: True, "a finite number of seconds")
        for name in ("coloured_noise", "position_step"):
            _check_all(name, getattr(self, name), lambda value: value >= 0, "zero or more")
        if self.clock_jitter is not None and len(self.clock_jitter) != 2:
            raise InputError(
                f"clock_jitter needs the shortest and the longest time between stamps, given {list(self.clock_jitter)}"
            )


def _check_all(name: str, values: tuple[float, ...], holds: Callable[[float], bool], expected: str) -> None:
    for value in values:
        if not (math.isfinite(value) and holds(value)):
            raise InputError(f"{name} must be {expected}, given {value:g}")
