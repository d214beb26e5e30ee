"""What spoils a simulated log: every option of it."""

from __future__ import annotations

from dataclasses import dataclass, fields

from excite.tasks.option import essential, option
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.quantities import check_options


@checked
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

    friction_drift: float = option(
        0.0, "number", "Change of friction over the log as joints warm up, -0.3 = 30 % less.", metavar="X"
    )
    torque_gain: tuple[float, ...] = option(
        (1.0,), "numbers", "Measured over true torque, 1.1 = 10 % too much; one for all, or one each.", metavar="G,..."
    )
    delay: tuple[float, ...] = option(
        (0.0,), "numbers", "Time by which torques are recorded later than positions [s], 0.004 = 4 ms.", metavar="T,..."
    )
    coloured_noise: tuple[float, ...] = essential(
        (0.0,), "numbers", "Standard deviation of slow torque noise [Nm]; below the noise corner.", metavar="S,..."
    )
    noise_corner: float = option(
        5.0, "number", "Corner frequency of the slow torque noise, which is of first order.", metavar="HZ"
    )
    position_step: tuple[float, ...] = option(
        (0.0,), "numbers", "Positions are rounded to multiples of Q [rad], such as 1e-4.", metavar="Q,..."
    )
    hold: float = option(
        0.0,
        "number",
        "Share of the rows that repeat the row before under a new stamp, 0.06 = 6 %.",
        metavar="SHARE",
    )
    clock_jitter: tuple[float, float] | None = option(
        None,
        "numbers",
        "Shortest and longest time between stamps [s]; the rate must fit between.",
        metavar="MIN,MAX",
    )
    drop_rows: float = option(0.0, "number", "Share of the rows that are missing, 0.05 = 5 %.", metavar="SHARE")

    def __post_init__(self) -> None:
        check_options(self, (field.name for field in fields(self)))
        if 0.0 in self.torque_gain:
            raise InputError("`torque_gain` must not be zero: measured torques would all be zero")
