"""Options of ``excite simulate`` for what spoils a log, from impacts on the robot to rows that are missing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

from excite.cli.options import Number, Numbers
from regressors.quantities import number_of, shown

_Command = TypeVar("_Command", bound=Callable[..., Any])


class ImpactOption(click.ParamType[Any]):
    """``JOINT:TIME:TORQUE``, or ``JOINT:TIME:TORQUE:DURATION``."""

    name = "impact"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Convert the text of the option."""
        from excite.simulation.impact_pulse import ImpactPulse

        joint, *numbers = str(value).split(":")
        try:
            given = [number_of(number) for number in numbers]
        except ValueError:
            given = []
        if not joint or len(given) not in (2, 3):
            self.fail(
                "expected JOINT:TIME:TORQUE or JOINT:TIME:TORQUE:DURATION, such as q2:3.5:200 for 200 Nm at 3.5 s; "
                f"given {shown(value)}",
                param,
                ctx,
            )
        return ImpactPulse(joint, *given)


def _numbers(name: str, default: str | None, metavar: str, help: str) -> Callable[[_Command], _Command]:
    return click.option(name, type=Numbers(), default=default, metavar=metavar, help=help)


def _number(name: str, default: float, metavar: str, help: str) -> Callable[[_Command], _Command]:
    return click.option(name, type=Number(), default=default, metavar=metavar, help=help)


_OPTIONS = (
    click.option(
        "--impact",
        type=ImpactOption(),
        multiple=True,
        metavar="J:T:TAU[:D]",
        help="Half a sine of TAU [Nm] from outside on joint J at T [s], for D [s], 0.01 if not given; repeatable.",
    ),
    _number("--friction-drift", 0.0, "X", "Change of friction over the log as joints warm up, -0.3 = 30 % less."),
    _numbers(
        "--torque-gain", "1", "G,...", "Measured over true torque, 1.1 = 10 % too much; one for all, or one each."
    ),
    _numbers("--delay", "0", "T,...", "Time by which torques are recorded later than positions [s], 0.004 = 4 ms."),
    _numbers("--coloured-noise", "0", "S,...", "Standard deviation of slow torque noise [Nm], below --noise-corner."),
    _number("--noise-corner", 5.0, "HZ", "Corner frequency of --coloured-noise, which is of first order."),
    _numbers("--position-step", "0", "Q,...", "Positions are rounded to multiples of Q [rad], such as 1e-4."),
    _number("--hold", 0.0, "SHARE", "Share of the rows that repeat the row before under a new stamp, 0.06 = 6 %."),
    _numbers(
        "--clock-jitter", None, "MIN,MAX", "Shortest and longest time between stamps [s]; --rate must fit between."
    ),
    _number("--drop-rows", 0.0, "SHARE", "Share of the rows that are missing, 0.05 = 5 %."),
)


def degradation_options(command: _Command) -> _Command:
    """Add the options to a command."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command
