"""Settings of an identification, from the log to the estimate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

from excite.registry import COVARIANCES, REPEATABLE, SIGNALS, OwnPart, built_in, instance, name_of
from excite.tasks.option import check_choices, essential, option
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.quantities import check, check_options, shown, whole_number_of
from regressors.work_prediction import FLOAT, check_memory

if TYPE_CHECKING:
    from excite.identification.estimator import Estimator


Sizes = float | tuple[float, ...]  # one for all drives, or one for each
Factors = tuple[tuple[str, float], ...]  # by drive
AUTO, ALL = "auto", "all"
_CHECKED = (
    "cutoff", "period", "harmonics", "low_pass", "every", "sign_width", "breakaway", "standstill", "temperature",
    "described_within", "delay", "bias",
)  # fmt: skip
_OF_WRENCH = 6


@checked
@dataclass(frozen=True)
class Recipe:
    """Settings of one identification; the defaults are those of the command line.

    Parameters
    ----------
    rows : str
        Which rows of each log: ``auto`` (the exciting stretch is found), ``all``, or ``FIRST:LAST`` counted from 1.
    signals : str
        Registered method from positions to velocities and accelerations.
    cutoff : float, optional
        Of its low-pass, for ``butterworth``, and of filters of its bandwidth for ``savitzky-golay`` and ``spline``
        [Hz]; chosen from the motion if not given.
    period : float, optional
        Of a periodic motion [s]: for ``fourier``, and for `average`; found from the motion if not given.
    harmonics : int, optional
        Of the motion, for ``fourier``; found from the motion if not given.
    average : bool
        Average each log over whole periods first.
    measured_velocity : bool
        Take the log's velocities instead of differentiating positions.
    low_pass : float, optional
        Cutoff of a low-pass on both sides of the equations [Hz].
    every : int, optional
        Decimation factor of the equations; if not given, 1, or, after a low-pass, the largest that its cutoff allows.
    sign_width : float or tuple of float, optional
        Velocity over which Coulomb friction changes its sign [rad/s or m/s], of all drives or of each moving one; 0 for
        the exact sign. Found from the data, unless it or `breakaway` is given.
    breakaway : float or tuple of float, optional
        Instead, the presliding distance over which it changes its direction, which it keeps at standstill [rad or m]; 0
        for none. See `excite.identification.equations`.
    standstill : float, optional
        Speed of a drive below which rows with its torque are left out, since friction may hold it there [rad/s or m/s];
        0 for none. See `excite.identification.biases`.
    torque_factors : mapping of str to float, optional
        Factors on the measured torques of drives whose gains are not the stated ones.
    friction_scale : bool
        Scale each known friction curve by one fitted factor, see `excite.identification.allowances`.
    estimator : str or Estimator
        Registered name, or an estimator.
    covariance : {"auto", "white", "robust"}
        Whether residuals are taken as white noise or as correlated in time; ``auto`` tests them.
    temperature : tuple of float, optional
        Of the joints in logs that have none, for known friction that depends on it: one for all, or one per moving
        joint [deg C].
    described_within : float, optional
        Standard deviation of the described bodies in the estimator physical, in their sizes.
    delay : float or tuple of float
        Of the recorded torques after the positions [s], of all moving joints or of each.
    log_delays : mapping of str to float, optional
        Further delay of single logs, by the name of their file [s].
    bias : tuple of float, optional
        Constant wrench that the force/torque sensor measures beside the load's, which is subtracted: forces [N], then
        torques [Nm]; chosen, or none, if not given.
    signals_chosen : bool
        The method was chosen and not given: logs to which it does not apply, such as those without velocities, or
        whose motion does not repeat itself, are low-passed at the cutoff.
    """

    rows: str = essential(
        AUTO,
        "text",
        "Rows to use: auto, where the motion is found, all, or from row A to B; then nothing else is checked.",
        metavar="A:B",
    )
    signals: str = essential(
        "butterworth",
        "name",
        "Method that differentiates the positions.",
        choices=SIGNALS,
        unset="butterworth, or chosen",
    )
    cutoff: float | None = essential(
        None,
        "number",
        "Cutoff frequency of butterworth, and bandwidth of savitzky-golay and spline.",
        metavar="HZ",
        unset="chosen",
    )
    period: float | None = option(None, "number", "Period of the motion.", metavar="S", unset="the design's, or found")
    harmonics: int | None = option(
        None, "integer", "Harmonics of the motion, for fourier.", metavar="N", unset="from the motion"
    )
    average: bool = option(False, "flag", "Average each log over whole periods first.")
    measured_velocity: bool = option(False, "flag", "Use the log's velocities.")
    low_pass: float | None = option(None, "number", "The same low-pass on both sides of the equations.", metavar="HZ")
    every: int | None = option(
        None, "integer", "Keep every N-th instant.", metavar="N", unset="all, or as the cutoff of the low-pass allows"
    )
    sign_width: Sizes | None = option(
        None,
        "size",
        "Velocity over which Coulomb friction changes sign, or one of each drive; 0: sign().",
        metavar="V",
        unset=AUTO,
    )
    breakaway: Sizes | None = option(
        None, "size", "Instead: presliding distance over which it changes sign; 0: none.", metavar="D", unset=AUTO
    )
    standstill: float | None = option(
        0.0,
        "size",
        "Leave out rows while a drive is slower, where friction may hold it; 0: none.",
        metavar="V",
        unset=AUTO,
    )
    torque_factors: Factors | Mapping[str, float] | None = None
    friction_scale: bool = option(
        False,
        "flag",
        "Scale each known friction curve by one fitted factor, or subtract it as given.",
        flag="scale-friction/no-scale-friction",
        unset="chosen",
    )
    estimator: str | Estimator | OwnPart = essential(
        "weighted", "name", "Estimator; see below.", part="estimator", unset="weighted or physical, chosen"
    )
    covariance: str = option(
        "auto", "name", "Residuals assumed white, or with their autocorrelation.", choices=COVARIANCES
    )
    temperature: tuple[float, ...] | None = option(
        None,
        "numbers",
        "Temperature of logs without NAME.temperature, for friction curves that depend on it; one, or one per joint.",
        metavar="T,...",
    )
    described_within: float | None = option(
        None,
        "number",
        "Hold bodies within about X times their size of the description (estimator physical).",
        metavar="X",
    )
    delay: Sizes = option(
        0.0,
        "size",
        "Delay of the recorded torques after the positions, or one of each moving joint; 0: none.",
        metavar="S",
        unset=AUTO,
    )
    bias: tuple[float, ...] | None = option(
        None,
        "numbers",
        "Bias of the force/torque sensor, which is subtracted: three forces [N] and three torques [Nm]; 0: none.",
        metavar="F,...",
        unset=AUTO,
    )
    log_delays: Factors | Mapping[str, float] | None = None
    signals_chosen: bool = False

    def __post_init__(self) -> None:
        check_choices(self)
        check_options(self, _CHECKED)
        if self.described_within is not None and self.estimator != "physical":
            raise InputError(f"`described_within` is for the estimator physical, not for {name_of(self.estimator)}")
        if self.bias is not None and any(self.bias) and len(self.bias) != _OF_WRENCH:
            raise InputError("`bias` must be six numbers, three forces and three torques, or 0 for none")
        if self.torque_factors is not None:
            object.__setattr__(self, "torque_factors", _named("torque_factors", self.torque_factors))
        if self.log_delays is not None:
            object.__setattr__(self, "log_delays", _named("delay", self.log_delays))
        if self.sign_width and self.breakaway:
            raise InputError(
                "friction changes sign over a velocity or over a distance; give `sign_width` or `breakaway`, not both"
            )
        self.stretch(2**62)

    def stretch(self, count: int) -> slice | None:
        """Rows of a log that are given by number; None where the exciting stretch is to be found.

        Parameters
        ----------
        count : int
            Rows of the log.

        Raises
        ------
        InputError
            Not two row numbers, or beyond the log.
        """
        if self.rows == AUTO:
            return None
        if self.rows == ALL:
            return slice(0, count)
        first, _, last = self.rows.partition(":")
        try:
            begin, end = whole_number_of(first), whole_number_of(last)
        except ValueError:
            message = f"rows must be auto, all, or FIRST:LAST such as 100:2000; given {shown(self.rows)}"
            raise InputError(message) from None
        if not 1 <= begin < end:
            raise InputError(f"rows: the first must be 1 or more and below the last, given {self.rows!r}")
        if end > count:
            raise InputError(f"rows: given {self.rows}, but the log has {count} rows")
        return slice(begin - 1, end)

    @property
    def row_numbers(self) -> tuple[int, int] | None:
        """First and last row where they are given, 1 for the first of a log."""
        stretch = self.stretch(2**62)
        return None if stretch is None or self.rows == ALL else (stretch.start + 1, stretch.stop)

    def check_repeatable(self, count: int) -> None:
        """Raise `InputError` where an identification cannot be repeated in simulation.

        Parameters
        ----------
        count : int
            Of the repetitions.
        """
        check("repeat", count)
        if count < 2:
            raise InputError(f"repeat must be 2 or more, or 0 for none, given {count}")
        check_estimates(count)  # of as few parameters as there may be
        if self.estimator not in REPEATABLE:
            raise InputError(
                f"repetitions are possible with the estimators {', '.join(REPEATABLE)}, not with {self.estimator}"
            )
        for what in ("average", "measured_velocity"):
            if getattr(self, what):
                raise InputError(f"repetitions simulate single instants and positions; leave out `{what}`")
        if isinstance(self.sign_width, tuple) or isinstance(self.breakaway, tuple):
            raise InputError("repetitions take one `sign_width` or `breakaway` for all drives")
        if isinstance(self.delay, tuple):
            raise InputError("repetitions take one `delay` for all joints; give one, or leave out `repeat`")
        if self.standstill:
            raise InputError("repetitions use every row; leave out `standstill`")

    @property
    def common_delay(self) -> float:
        """The delay of all joints, or that which half of them do not exceed [s]."""
        return sorted(self.delay)[(len(self.delay) - 1) // 2] if isinstance(self.delay, tuple) else self.delay

    def delay_of(self, log: str) -> float:
        """The common delay of a log, by the name of its file [s]."""
        return self.common_delay + dict(self.log_delays or ()).get(log, 0.0)

    @property
    def common_width(self) -> float:
        """Velocity over which the model's own Coulomb friction changes its sign; 0 where each drive has its own."""
        return self.sign_width if isinstance(self.sign_width, float | int) else 0.0

    def chosen_estimator(self) -> Estimator:
        """The estimator itself."""
        if self.described_within is not None:
            held: Estimator = built_in("estimator", "physical")(self.described_within)
            return held
        chosen: Estimator = instance("estimator", self.estimator)
        return chosen

    def to_dict(self) -> dict[str, object]:
        """Settings as plain values."""
        plain = {field.name: getattr(self, field.name) for field in fields(self)}
        return {**plain, "estimator": name_of(self.estimator)}


def _named(what: str, given: Mapping[str, float] | Factors) -> Factors:
    """Values as pairs of name and number, or `InputError` for one that is not in its bounds."""
    values = tuple((str(name), float(value)) for name, value in dict(given).items())
    for name, value in values:
        check(what, value, f"{what}: that of {name}")
    return values


def not_repeated() -> InputError:
    """Error where friction is known: noise of the motion affects it in reality, but not in repetitions."""
    return InputError(
        "repetitions cannot repeat friction that is subtracted, so they would show too little scatter; identify "
        "friction with the rest (`friction=True`), or leave out `repeat`"
    )


def check_estimates(count: int, parameters: int = 10) -> None:
    """Refuse estimates of repetitions, each with its covariance, that take more memory than they may."""
    size = FLOAT * count * parameters * (parameters + 3)
    check_memory("the repetition", size, f"{count:.3g} repetitions", "lower `repeat`")
