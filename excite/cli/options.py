"""Options generated from the fields of settings, and those that several commands share."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Container, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

import excite
from excite.cli.command import FurtherOption, further_option
from excite.cli.option_types import (
    ALL_OR_NONE,
    FILE,
    FORMATS,
    IMPACT,
    MOUNT,
    PAYLOAD,
    PRECISION,
    PRIOR,
    Folder,
    Names,
    Number,
    Numbers,
    PartName,
    Sides,
    size,
)
from excite.cli.streams import tell
from excite.registry import BUILT_IN, CONVENTIONS, DROPPABLE, EXECUTORS, FIGURE_WIDTHS
from excite.tasks.option import AUTO, MARGINS, Kind, Option, options_of
from excite.tasks.task import PARTS

Command = Callable[..., Any]
_OF_QUANTITIES: dict[Kind, Callable[[str], Any]] = {
    "integer": Number,
    "number": Number,
    **dict.fromkeys(("count", "distance"), lambda quantity: Number(quantity, {AUTO: AUTO})),
    "numbers": Numbers,
    "triple": lambda quantity: Numbers(quantity, (3,)),
    "frame": lambda quantity: Numbers(quantity, (3, 6)),
    "poses": Numbers,
    "size": size,
    "percent": lambda quantity: Number(quantity, percent=True),
}
_BOX = ("tool_box", "L:U for x, y and z, such as -1:1,-1:1,0: ")
_SEVERAL = ("poses", "folders", "impacts", "several", "parts")
_TYPES: dict[Kind, Any] = {
    "ranges": Sides("position", "LOWER:UPPER per joint, such as -1:1,-2:0.5"),
    "box": Sides(*_BOX, box=True),
    "sides": Sides(*_BOX, box=True, widths=True),
    "pose": Numbers("home", words={"robot": "robot"}),
    "names": Names(),
    "prior": PRIOR,
    "margin": Number(words=dict(zip(MARGINS, MARGINS, strict=True))),
    "mount": MOUNT,
    "payload": PAYLOAD,
    "drives": Names(ALL_OR_NONE),
    "folders": Names(),
    "precision": PRECISION,
    "impacts": IMPACT,
}
# by kind or unit, where an option states none
_METAVARS = {"drives": "all|1,3", "integer": "N", "triple": "X,Y,Z", "s": "S", "Hz": "HZ"}


def settings_options(
    *settings: type,
    without: Container[str] = (),
    only: Container[str] | None = None,
    help: Mapping[str, str] | None = None,
    unset: Mapping[str, str] | None = None,
    essential: Container[str] | None = None,
) -> Callable[[Command], Command]:
    """Decorator that gives a command the options of settings, in their order."""

    def decorate(command: Command) -> Command:
        for field, option in reversed([each for part in settings for each in options_of(part)]):
            name = field.name
            if option.hidden or name in without or (only is not None and name not in only):
                continue
            others = {"help": help, "unset": unset}
            changed: dict[str, Any] = {what: texts[name] for what, texts in others.items() if texts and name in texts}
            changed |= {} if essential is None else {"essential": name in essential}
            command = _click_option(name, field.default, dataclasses.replace(option, **changed))(command)
        return command

    return decorate


def chosen_of(given: Mapping[str, Any], *settings: type) -> dict[str, Any]:
    """Options of settings among those of a command, as far as they have a value."""
    names = (field.name for part in settings for field, _ in options_of(part))
    return {name: given[name] for name in names if given.get(name) is not None}


def task_of(robot: str, given: Mapping[str, Any], *parts: type, **more: Any) -> excite.Task:
    """Task of a robot with what is given of some parts, and more options."""
    return excite.Task(robot, **{**robot_file_of(given), **chosen_of(given, *parts), **more})


def flag_of(name: str, option: Option) -> str:
    """Command-line form of an option, such as ``--torque-margin``; for a flag, the form that turns it on."""
    return "--" + (option.flag or name.replace("_", "-")).partition("/")[0]


def _click_option(name: str, default: Any, option: Option) -> Callable[[Command], Command]:
    text = option.described(name) + (f"  [default: {option.unset}]" if option.unset is not None else "")
    shared: dict[str, Any] = {"cls": click.Option if option.essential else FurtherOption, "help": text}
    default = None if option.unset is not None else default
    words = option.flag or name.replace("_", "-")
    if option.kind == "flag" and default is True and option.flag is None:
        words += f"/no-{words}"
    if option.kind == "flag" or "/" in words:
        return click.option("--" + words.replace("/", "/--"), name, is_flag=True, default=default, **shared)
    return click.option(
        flag_of(name, option),
        name,
        type=_type(name, option),
        multiple=option.kind in _SEVERAL,
        default=_typed_default(default, option),
        required=option.required,
        metavar=option.metavar or _METAVARS.get(option.kind) or _METAVARS.get(option.unit(name)),
        callback=(lambda _, __, several: sum(several, ())) if option.kind == "folders" else None,
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


def _type(name: str, option: Option) -> Any:
    if option.part is not None:
        return PartName(option.part, tuple(BUILT_IN[option.part]))
    if option.word is not None:
        return Numbers(option.quantity or name, words={option.word: None})
    if option.kind in _OF_QUANTITIES:
        return _OF_QUANTITIES[option.kind](option.quantity or name)
    return click.Choice(option.choices) if option.choices else _TYPES.get(option.kind, str)


def check_not_typed(names: Iterable[str], why: str) -> None:
    """Refuse options of another use of a command, with the reason."""
    ctx = click.get_current_context()
    for param in (each for each in ctx.command.params if each.name in set(names)):
        if ctx.get_parameter_source(str(param.name)) is not ParameterSource.DEFAULT:
            raise click.UsageError(f"{param.opts[-1]} {why}")


def typed_options(*settings: type) -> dict[str, Any]:
    """Options of settings, those of a task if none are named, that are given on the command line."""
    ctx = click.get_current_context()
    known = {field.name for each in settings or PARTS.values() for field, _ in options_of(each)}
    return {
        name: value
        for name, value in ctx.params.items()
        if name in known and ctx.get_parameter_source(name) is not ParameterSource.DEFAULT
    }


_snap_angles = further_option(
    "--snap-angles/--no-snap-angles",
    default=None,
    help="Take rounded right angles of a URDF or MJCF, such as 1.5708, for right angles.  [default: snap]",
)
_xacro = further_option(
    "--xacro",
    is_flag=True,
    default=None,
    help="Expand ROBOT as xacro although its name does not end in .xacro. Evaluated are arithmetic and listed "
    "functions only, in a process with caps and no network; what remains is the risk of an error in Python itself.",
)


def robot_file_options(*names: str) -> Callable[[Command], Command]:
    """How the file of a robot is read: what moves in it, whose first link has further names, angles, and xacro."""
    text = "First link of what moves, for a URDF or MJCF."
    base = further_option("--base-link", *names, "base_link", metavar="LINK", help=text)
    tip = click.option(
        "--tip",
        multiple=True,
        callback=lambda ctx, _, links: links or None,
        metavar="LINK",
        help="Last link of what moves, for a URDF or MJCF; repeatable, for a tree. By default all limbs move.",
    )
    return lambda command: base(tip(_snap_angles(_xacro(command))))


def robot_file_of(given: Mapping[str, Any]) -> dict[str, Any]:
    """Options of how the file of a robot is read that are given, as keys of a task."""
    names = ("base_link", "tip", "snap_angles", "xacro")
    return {name: given[name] for name in names if given[name] is not None}


def executor_options(where: str, processes: str) -> Callable[[Command], Command]:
    """Where the work of a command runs, and in how many processes."""
    kind = PartName("executor", EXECUTORS, own=False)
    executor = further_option("--executor", type=kind, default="process", help=where)
    workers = further_option("--workers", type=Number(), metavar="N", help=processes)
    return lambda command: executor(workers(command))


file_option = partial(click.option, type=FILE, metavar="FILE")
folder_option = partial(click.option, type=Folder(), metavar="DIR")
own_parts = further_option(
    "--part",
    "parts",
    type=PartName("own part"),
    multiple=True,
    metavar="MODULE:NAME",
    help="Part of your own to import where a file of results names it; repeatable.",
)


mapping_option = file_option("--mapping", help="YAML file with the columns and units of a log in another format.")
drop_option = further_option(
    "--drop", multiple=True, type=click.Choice(DROPPABLE), help="Faulty rows to leave out instead of refusing the log."
)


@dataclass(frozen=True)
class FigureChoice:
    """Formats of the figures that were asked for, none if empty, and their width."""

    formats: tuple[str, ...]
    width: str

    def write(self, result: Any, folder: Path) -> list[Path]:
        """Draw a result, or what its view has, into its folder, where figures are asked for."""
        if not self.formats:
            return []
        tell("drawing")
        return excite.write_figures(result, folder, **vars(self))


_figure_width = further_option(
    "--figure-width",
    type=click.Choice(FIGURE_WIDTHS),
    default="screen",
    is_eager=True,  # known when the formats are
    help="Width of the figures: for a screen, or for one column of a paper (3.5 in) or both (7.16 in).",
)


def figure_options(default: str = "png") -> Callable[[Command], Command]:
    """Decorator that gives a command the options of figures, and one argument ``figures``, a `FigureChoice`."""
    alone: dict[str, Any] = {"is_flag": False, "flag_value": "png"} if default == "none" else {}
    formats = further_option(
        "--figures",
        type=FORMATS,
        default=default,
        metavar="png|pdf|svg|none",
        callback=lambda ctx, _, chosen: FigureChoice(chosen, ctx.params.pop("figure_width")),
        help="Formats of the figures; several separated by commas.",
        **alone,
    )
    return lambda command: formats(_figure_width(command))


def split_base(values: tuple[str, ...]) -> tuple[str | None, str | None]:
    """Convention of the base columns, and base link of a URDF, among the values of ``--base``."""
    conventions = [value for value in values if value in CONVENTIONS]
    links = [value for value in values if value not in CONVENTIONS]
    for kind, matches in (("convention", conventions), ("base link", links)):
        if len(matches) > 1:
            raise click.UsageError(f"--base names more than one {kind}: {', '.join(matches)}")
    return next(iter(conventions), None), next(iter(links), None)
