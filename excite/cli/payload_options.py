"""Options that the commands of ``excite payload`` share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import click

from excite.cli.command import FurtherOption
from excite.cli.option_types import FrameOption
from excite.cli.options import drop_option, mapping_option, robot_file_of, robot_file_options
from excite.cli.task_options import chosen_of, settings_options, task_options
from excite.identification.recipe import Recipe

if TYPE_CHECKING:
    from excite.payload.load_rows import LogChoice

Command = Callable[..., Any]


def robot_options(command: Command) -> Command:
    """How ROBOT is read and installed."""
    return robot_file_options("--base")(task_options(("installation",), without=("payload",))(command))


def log_options(command: Command) -> Command:
    """How logs are read."""
    for decorate in (
        settings_options(
            Recipe,
            only=("rows", "cutoff", "low_pass"),
            unset={"cutoff": "as --low-pass, or chosen", "low_pass": "15 where logs are fast"},
        ),
        click.option(
            "--without-rows", cls=FurtherOption, default="auto", metavar="A:B", help="Rows of --without; as --rows."
        ),
        drop_option,
        mapping_option,
    ):
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

    return {**robot_file_of(given), "installation": Installation(**chosen_of(Installation, given))}


def logs_of(given: Mapping[str, Any]) -> LogChoice:
    """How the logs are read."""
    from excite.payload.load_rows import LogChoice

    mapping, drop = given["mapping"], tuple(given["drop"])
    return LogChoice(mapping, drop, given["rows"], given["without_rows"], given["cutoff"], given["low_pass"])
