"""Options that several commands share: the file of a robot, logs, figures, executors, parts of the user's own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import excite
from excite.cli.command import FurtherOption
from excite.cli.option_types import FORMATS, Number, PartName
from excite.cli.sign_of_life import tell
from excite.registry import CONVENTIONS, DROPPABLE, EXECUTORS, FIGURE_WIDTHS

if TYPE_CHECKING:
    from constraints.geometry import World

Command = Callable[..., Any]

_snap_angles = click.option(
    "--snap-angles/--no-snap-angles",
    cls=FurtherOption,
    default=None,
    help="Take rounded right angles of a URDF or MJCF, such as 1.5708, for right angles.  [default: snap]",
)
_xacro = click.option(
    "--xacro",
    cls=FurtherOption,
    is_flag=True,
    default=None,
    help="Expand ROBOT as xacro although its name does not end in .xacro. Evaluated are arithmetic and listed "
    "functions only, in a process with caps and no network; what remains is the risk of an error in Python itself.",
)


def robot_file_options(*names: str) -> Callable[[Command], Command]:
    """How the file of a robot is read: the chain in it, whose first link has further names, angles, and xacro."""
    ends = {"metavar": "LINK", "help": "First link of the chain, for a URDF or MJCF."}

    def decorate(command: Command) -> Command:
        tip = click.option("--tip", metavar="LINK", help="Last link of the chain, for a URDF or MJCF.")
        base = click.option("--base-link", *names, "base_link", cls=FurtherOption, **ends)
        return base(tip(_snap_angles(_xacro(command))))

    return decorate


def robot_file_of(given: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of the API for how the file of a robot is read."""
    read = {"snap_angles": given["snap_angles"] is not False, "xacro": bool(given["xacro"])}
    return {"base_link": given["base_link"], "tip": given["tip"], **read}


def robot_file_typed(given: Mapping[str, Any]) -> dict[str, Any]:
    """Options of how the file of a robot is read that are given, as keys of a task."""
    names = ("base_link", "tip", "snap_angles", "xacro")
    return {name: given[name] for name in names if given[name] is not None}


def task_file_option(text: str) -> Callable[[Command], Command]:
    """A task file; options that are given win over it."""
    return click.option("--task", "task_file", type=click.Path(path_type=Path), metavar="FILE", help=text)


def world_of(robot: str, given: Mapping[str, Any]) -> World | None:
    """The world that ``--world`` names, with the shape of a robot."""
    if given["world"] is None:
        return None
    read = robot_file_of(given)
    return excite.read_world(given["world"], robot, read["base_link"], read["tip"], snap_angles=read["snap_angles"])


def executor_options(where: str, processes: str) -> Callable[[Command], Command]:
    """Where the work of a command runs, and in how many processes."""
    kind = PartName("executor", EXECUTORS, own=False)

    def decorate(command: Command) -> Command:
        workers = click.option("--workers", cls=FurtherOption, type=Number(), metavar="N", help=processes)
        return click.option("--executor", cls=FurtherOption, type=kind, default="process", help=where)(workers(command))

    return decorate


own_parts = click.option(
    "--part",
    "parts",
    cls=FurtherOption,
    type=PartName("own part"),
    multiple=True,
    metavar="MODULE:NAME",
    help="Part of your own to import where a file of results names it; repeatable.",
)


mapping_option = click.option(
    "--mapping",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="YAML file with the columns and units of a log in another format.",
)
drop_option = click.option(
    "--drop",
    multiple=True,
    cls=FurtherOption,
    type=click.Choice(DROPPABLE),
    help="Faulty rows to leave out instead of refusing the log.",
)


@dataclass(frozen=True)
class FigureChoice:
    """Formats of the figures that were asked for, none if empty, and their width."""

    formats: tuple[str, ...]
    width: str

    def __bool__(self) -> bool:
        return bool(self.formats)

    @property
    def how(self) -> dict[str, Any]:
        """Arguments of the functions that write figures."""
        return {"formats": self.formats, "width": self.width}

    def write(self, result: Any, folder: Path) -> list[Path]:
        """Draw a result into its folder, where figures are asked for."""
        if not self.formats:
            return []
        tell("drawing")
        return excite.write_figures(result, folder, **self.how)


def figure_options(default: str = "png") -> Callable[[Command], Command]:
    """Decorator that gives a command the options of figures, and one argument ``figures``, a `FigureChoice`.

    With the default ``none``, ``--figures`` alone means ``png``.
    """
    alone: dict[str, Any] = {"is_flag": False, "flag_value": "png"} if default == "none" else {}

    def decorate(command: Command) -> Command:
        @wraps(command)
        def with_choice(*args: Any, figures: tuple[str, ...], figure_width: str, **options: Any) -> Any:
            return command(*args, figures=FigureChoice(figures, figure_width), **options)

        for option in (
            click.option(
                "--figure-width",
                cls=FurtherOption,
                type=click.Choice(FIGURE_WIDTHS),
                default="screen",
                help="Width of the figures: for a screen, or for one column of a paper (3.5 in) or both (7.16 in).",
            ),
            click.option(
                "--figures",
                cls=FurtherOption,
                type=FORMATS,
                default=default,
                metavar="png|pdf|svg|none",
                help="Formats of the figures; several separated by commas.",
                **alone,
            ),
        ):
            with_choice = option(with_choice)
        return with_choice

    return decorate


def split_base(values: tuple[str, ...]) -> tuple[str | None, str | None]:
    """Convention of the base columns, and base link of a URDF, among the values of ``--base``."""
    conventions = [value for value in values if value in CONVENTIONS]
    links = [value for value in values if value not in CONVENTIONS]
    for kind, matches in (("convention", conventions), ("base link", links)):
        if len(matches) > 1:
            raise click.UsageError(f"--base names more than one {kind}: {', '.join(matches)}")
    return next(iter(conventions), None), next(iter(links), None)
