"""Options that the commands of ``excite payload`` share."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from excite.cli.options import Box, Number, Numbers, reading_options
from excite.cli.task_options import installation_of, task_options
from excite.registry import DROPPABLE

if TYPE_CHECKING:
    from excite.payload.prepared_pair import LogChoice

Command = Callable[..., Any]


class BoxOrSides(Box):
    """One side for all of x, y, z, three sides, or lower and upper bound of each."""

    name = "box"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Convert the text of the option."""
        if isinstance(value, tuple) or ":" in str(value):
            return super().convert(value, param, ctx)
        sides = Numbers("tool_box").convert(value, param, ctx)
        if len(sides) not in (1, 3) or not all(side > 0 for side in sides):
            self.fail("expected one side greater than zero, three, or L:U,L:U,L:U", param, ctx)
        return sides * (3 // len(sides))


class FrameOption(Numbers):
    """Origin of a frame, or origin and roll, pitch, yaw."""

    name = "frame"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        """Convert the text of the option."""
        numbers = Numbers("sensor_xyz").convert(value, param, ctx)
        if len(numbers) not in (3, 6):
            self.fail("expected X,Y,Z or X,Y,Z,ROLL,PITCH,YAW", param, ctx)
        return numbers + (0.0,) * (6 - len(numbers))


class Share(click.ParamType[float]):
    """A number from 0 to 1."""

    name = "share"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Convert the text of the option."""
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not 0.0 <= number <= 1.0:
            self.fail(f"expected a number from 0 to 1, such as 0.05, given {str(value)[:40]!r}", param, ctx)
        return number


def robot_options(command: Command) -> Command:
    """How ROBOT is read and installed."""
    for decorate in (
        reading_options,
        task_options(("installation",), without=("payload",)),
        click.option("--tip", metavar="LINK", help="Last link of the chain, for a URDF or MJCF."),
        click.option(
            "--base-link", "--base", "base_link", metavar="LINK", help="First link of the chain, for a URDF or MJCF."
        ),
    ):
        command = decorate(command)
    return command


def log_options(command: Command) -> Command:
    """How logs are read."""
    for decorate in (
        click.option(
            "--low-pass", type=Number(), metavar="HZ",
            help="The same low-pass on both sides of the equations.  [default: 15 where logs are fast]",
        ),
        click.option(
            "--cutoff", type=Number(), metavar="HZ",
            help="Cutoff of the low-pass of positions.  [default: as --low-pass, or chosen]",
        ),
        click.option(
            "--without-rows", default="auto", metavar="A:B", help="Rows of --without; as --rows.", show_default=True
        ),
        click.option(
            "--rows", default="auto", metavar="A:B",
            help="Rows of --with: auto finds the motion; all; or from row A to B.",
        ),
        click.option("--drop", multiple=True, type=click.Choice(DROPPABLE), help="Faulty rows to leave out."),
        click.option(
            "--mapping", type=click.Path(path_type=Path), metavar="FILE",
            help="YAML file with the columns and units of logs in another format.",
        ),
    ):  # fmt: skip
        command = decorate(command)
    return command


def frame_option(command: Command) -> Command:
    """The frame in which a load is stated."""
    return click.option(
        "--frame", type=FrameOption(), metavar="X,Y,Z[,R,P,Y]",
        help="Flange or sensor in the frame of the last link [m, rad]; panda: 0,0,0.107.  [default: that frame itself]",
        show_default=False,
    )(command)  # fmt: skip


def robot_of(given: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of the API for how the robot is read and installed."""
    from excite.tasks.installation import Installation

    return {
        "base_link": given["base_link"],
        "tip": given["tip"],
        "snap_angles": given["snap_angles"] is not False,
        "xacro": bool(given["xacro"]),
        "installation": Installation(**installation_of({"payload": None, **given})),
    }


def logs_of(given: Mapping[str, Any]) -> LogChoice:
    """How the logs are read."""
    from excite.payload.prepared_pair import LogChoice

    mapping, drop = given["mapping"], tuple(given["drop"])
    return LogChoice(mapping, drop, given["rows"], given["without_rows"], given["cutoff"], given["low_pass"])
