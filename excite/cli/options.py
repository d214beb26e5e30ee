"""Options generated from the fields of settings, and those that several commands share."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

import excite
from excite.cli.command import FurtherOption
from excite.cli.option_types import (
    ALL_OR_NONE,
    BOX,
    BOX_OR_SIDES,
    FORMATS,
    IMPACT,
    MARGIN,
    MOUNT,
    PAYLOAD,
    PRECISION,
    PRIOR,
    RANGES,
    Names,
    Number,
    Numbers,
    PartName,
    Size,
)
from excite.cli.streams import tell
from excite.registry import BUILT_IN, CONVENTIONS, DROPPABLE, EXECUTORS, FIGURE_WIDTHS
from excite.tasks.option import AUTO, Kind, Option, options_of
from excite.tasks.task import PARTS

if TYPE_CHECKING:
    from constraints.geometry import World
    from excite.views.view import View


Command = Callable[..., Any]
_OF_QUANTITIES: dict[Kind, Callable[[str], Any]] = {
    "integer": Number,
    "number": Number,
    "count": lambda quantity: Number(quantity, {AUTO: AUTO}),
    "numbers": Numbers,
    "triple": lambda quantity: Numbers(quantity, (3,)),
    "frame": lambda quantity: Numbers(quantity, (3, 6)),
    "poses": Numbers,
    "distance": lambda quantity: Number(quantity, {AUTO: AUTO}),
    "time": lambda quantity: Number(quantity, {AUTO: None}),
    "size": Size,
    "percent": lambda quantity: Number(quantity, percent=True),
}
_SEVERAL = ("poses", "folders", "impacts", "several")
_TYPES: dict[Kind, Any] = {
    "ranges": RANGES,
    "box": BOX,
    "sides": BOX_OR_SIDES,
    "pose": Numbers("home", words={"robot": "robot"}),
    "names": Names(),
    "text": str,
    "file": str,
    "prior": PRIOR,
    "margin": MARGIN,
    "mount": MOUNT,
    "payload": PAYLOAD,
    "drives": Names(ALL_OR_NONE),
    "folders": Names(),
    "precision": PRECISION,
    "impacts": IMPACT,
}


def task_options(parts: Iterable[str], *, without: Iterable[str] = (), **more: Any) -> Callable[[Command], Command]:
    """Decorator that gives a command the options of some parts of a task, see `settings_options`."""

    def decorate(command: Command) -> Command:
        for part in reversed(tuple(parts)):
            command = settings_options(PARTS[part], without=without, **more)(command)
        return command

    return decorate


def settings_options(
    settings: type,
    *,
    without: Iterable[str] = (),
    only: Iterable[str] | None = None,
    help: Mapping[str, str] | None = None,
    unset: Mapping[str, str] | None = None,
    essential: Iterable[str] | None = None,
) -> Callable[[Command], Command]:
    """Decorator that gives a command the options of settings, in their order."""

    def decorate(command: Command) -> Command:
        for field, option in reversed(list(options_of(settings))):
            name = field.name
            if option.hidden or name in set(without) or (only is not None and name not in set(only)):
                continue
            changed: dict[str, Any] = {"help": help[name]} if help is not None and name in help else {}
            changed |= {"unset": unset[name]} if unset is not None and name in unset else {}
            changed |= {} if essential is None else {"essential": name in set(essential)}
            command = _click_option(name, field.default, dataclasses.replace(option, **changed))(command)
        return command

    return decorate


def chosen_of(settings: type, given: Mapping[str, Any]) -> dict[str, Any]:
    """Options of settings among those of a command, as far as they have a value."""
    names = (field.name for field, _ in options_of(settings))
    return {name: given[name] for name in names if given.get(name) is not None}


def flag_of(name: str, option: Option) -> str:
    """Command-line form of an option, such as ``--torque-margin``; for a flag, the form that turns it on."""
    return "--" + (option.flag or name.replace("_", "-")).partition("/")[0]


def _click_option(name: str, default: Any, option: Option) -> Callable[[Command], Command]:
    text = option.described(name) + (f"  [default: {option.unset}]" if option.unset is not None else "")
    shared: dict[str, Any] = {"cls": click.Option if option.essential else FurtherOption, "help": text}
    default = None if option.unset is not None else default
    if option.kind == "flag" or "/" in (option.flag or ""):
        both = f"--{option.flag.replace('/', '/--')}" if option.flag and "/" in option.flag else flag_of(name, option)
        return click.option(both, name, is_flag=True, default=default, **shared)
    return click.option(
        flag_of(name, option),
        name,
        type=str if name == "constraints" else _type(name, option),
        multiple=option.kind in _SEVERAL or name == "constraints",
        default=_typed_default(default, option),
        required=option.required,
        metavar=option.metavar,
        callback=_all_of if option.kind == "folders" else None,
        **shared,
    )


def _typed_default(default: Any, option: Option) -> Any:
    """The default of an option as it is typed."""
    if option.kind == "drives":
        return "none"
    if default in ((), None) or option.kind == "triple":
        return None
    if option.kind == "percent":
        return f"{100 * default:g}"
    if isinstance(default, tuple) and option.kind in ("names", "numbers"):
        return ",".join(f"{each:g}" if isinstance(each, float) else each for each in default)
    return default


def _all_of(ctx: click.Context, param: click.Parameter, value: tuple[tuple[str, ...], ...]) -> tuple[str, ...]:
    """Names of an option that is given several times, each time with one or several."""
    return tuple(name for several in value for name in several)


def _type(name: str, option: Option) -> Any:
    if option.part is not None:
        return PartName(option.part, tuple(BUILT_IN[option.part]))
    if option.word is not None:
        return Numbers(option.quantity or name, words={option.word: None})
    if option.kind in _OF_QUANTITIES:
        return _OF_QUANTITIES[option.kind](option.quantity or name)
    return click.Choice(option.choices) if option.choices else _TYPES[option.kind]


def check_not_typed(ctx: click.Context, names: Iterable[str], why: str) -> None:
    """Refuse options of another use of a command, with the reason."""
    for param in (each for each in ctx.command.params if each.name in set(names)):
        if ctx.get_parameter_source(str(param.name)) is not ParameterSource.DEFAULT:
            raise click.UsageError(f"{param.opts[-1]} {why}")


def typed_options(ctx: click.Context, *settings: type) -> dict[str, Any]:
    """Options of settings, those of a task if none are named, that are given on the command line."""
    known = {field.name for each in settings or PARTS.values() for field, _ in options_of(each)}
    return {
        name: value
        for name, value in ctx.params.items()
        if name in known and ctx.get_parameter_source(name) is not ParameterSource.DEFAULT
    }


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

    def write_view(self, view: View, folder: Path) -> list[Path]:
        """Draw the figures of a view, and write them."""
        from excite.views.figures import write_view_figures

        return write_view_figures(view, folder, **self.how)


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
