"""Command-line options generated from the parts of a task, where each is described once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import click
from click.core import ParameterSource

from excite.cli.options import (
    Box,
    DriveNames,
    Margin,
    Mount,
    Names,
    Number,
    NumberOr,
    Numbers,
    PartName,
    PayloadOption,
    Pose,
    PrecisionOption,
    PriorOption,
    Ranges,
    Triple,
)
from excite.registry import BUILT_IN
from excite.tasks.option import Kind, Option, options_of
from excite.tasks.task import PARTS, PLACE
from excite.tasks.values import AUTO

Command = Callable[..., Any]
_OF_QUANTITIES: dict[Kind, Callable[[str], Any]] = {
    "integer": Number,
    "number": Number,
    "count": lambda quantity: NumberOr(AUTO, quantity),
    "numbers": Numbers,
    "triple": Triple,
    "poses": Numbers,
}
_TYPES: dict[Kind, Any] = {
    "ranges": Ranges(),
    "box": Box(),
    "pose": Pose(),
    "names": Names(),
    "text": str,
    "file": str,
    "prior": PriorOption(),
    "margin": Margin(),
    "mount": Mount(),
    "payload": PayloadOption(),
    "drives": DriveNames(),
    "folders": Names(),
    "precision": PrecisionOption(),
}


def task_options(
    parts: Iterable[str],
    *,
    without: Iterable[str] = (),
    only: Iterable[str] | None = None,
    help: dict[str, str] | None = None,
) -> Callable[[Command], Command]:
    """Decorator that gives a command the options of some parts of a task."""
    left_out, taken = set(without), PLACE if only is None else set(only)
    chosen = [
        (field, option)
        for part in parts
        for field, option in options_of(PARTS[part])
        if field.name in taken and field.name not in left_out and not option.hidden
    ]

    def decorate(command: Command) -> Command:
        for field, option in reversed(chosen):
            text = (help or {}).get(field.name, option.help)
            command = _click_option(field.name, field.default, option, text)(command)
        return command

    return decorate


def installation_of(given: Mapping[str, Any]) -> dict[str, Any]:
    """Options of the robot's installation among those of a command."""
    return {field.name: given[field.name] for field, _ in options_of(PARTS["installation"])}


def flag_of(name: str, option: Option) -> str:
    """Command-line form of an option, such as ``--torque-margin``; for a flag, the form that turns it on."""
    return "--" + (option.flag or name.replace("_", "-")).partition("/")[0]


def _click_option(name: str, default: Any, option: Option, text: str) -> Callable[[Command], Command]:
    if option.kind == "flag" or "/" in (option.flag or ""):
        both = f"--{option.flag.replace('/', '/--')}" if option.flag and "/" in option.flag else flag_of(name, option)
        return click.option(both, name, is_flag=True, default=default, help=text)
    default = "none" if option.kind == "drives" else default
    several = option.kind in ("poses", "folders") or name == "constraints"
    kind = str if name == "constraints" else _type(name, option)
    shown = ",".join(default) if isinstance(default, tuple) and default and option.kind == "names" else default
    return click.option(
        flag_of(name, option),
        name,
        type=kind,
        multiple=several,
        default=None if shown in ((), None) or option.kind == "triple" else shown,
        metavar=option.metavar,
        help=text,
        callback=_all_of if option.kind == "folders" else None,
    )


def _all_of(ctx: click.Context, param: click.Parameter, value: tuple[tuple[str, ...], ...]) -> tuple[str, ...]:
    """Names of an option that is given several times, each time with one or several."""
    return tuple(name for several in value for name in several)


def _type(name: str, option: Option) -> Any:
    if option.part is not None:
        return PartName(option.part, tuple(BUILT_IN[option.part]))
    if option.kind in _OF_QUANTITIES:
        return _OF_QUANTITIES[option.kind](name)
    return click.Choice(option.choices) if option.choices else _TYPES[option.kind]


def typed_options(ctx: click.Context) -> dict[str, Any]:
    """Options of a task given on the command line, by name."""
    known = {field.name for part in PARTS.values() for field, _ in options_of(part)}
    return {
        name: value
        for name, value in ctx.params.items()
        if name in known and ctx.get_parameter_source(name) is not ParameterSource.DEFAULT
    }
