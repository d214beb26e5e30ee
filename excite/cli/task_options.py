"""Command-line options generated from the fields of settings, where each is described once."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import click
from click.core import ParameterSource

from excite.cli.command import FurtherOption
from excite.cli.option_types import (
    ALL_OR_NONE,
    BOX,
    BOX_OR_SIDES,
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
from excite.registry import BUILT_IN
from excite.tasks.option import AUTO, Kind, Option, options_of
from excite.tasks.task import PARTS

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
_SEVERAL = ("poses", "folders", "impacts")
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
