"""Options of the figures that a command writes: their formats and their width."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import Any

import click

from excite.registry import FIGURE_FORMATS, FIGURE_WIDTHS

Command = Callable[..., Any]
_NONE = "none"


@dataclass(frozen=True)
class FigureChoice:
    """Figures that were asked for."""

    formats: tuple[str, ...]  # empty where none are to be drawn
    width: str

    def __bool__(self) -> bool:
        return bool(self.formats)

    @property
    def how(self) -> dict[str, Any]:
        """Arguments of the functions that write figures."""
        return {"formats": self.formats, "width": self.width}


class Formats(click.ParamType[tuple[str, ...]]):
    """Formats separated by commas, or ``none``."""

    name = "formats"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, ...]:
        """Convert the text of the option."""
        if isinstance(value, tuple):
            return value
        names = [part.strip() for part in str(value).split(",")]
        if names == [_NONE]:
            return ()
        for name in names:
            if name not in FIGURE_FORMATS:
                known = ", ".join(FIGURE_FORMATS)
                self.fail(f"expected none, or some of {known} separated by commas; given {value!r}", param, ctx)
        return tuple(dict.fromkeys(names))


def figure_options(default: str = "png") -> Callable[[Command], Command]:
    """Decorator that gives a command the options of figures, and one argument ``figures``, a `FigureChoice`."""
    alone: dict[str, Any] = {"is_flag": False, "flag_value": "png"} if default == _NONE else {}

    def decorate(command: Command) -> Command:
        @wraps(command)
        def with_choice(*args: Any, figures: tuple[str, ...], figure_width: str, **options: Any) -> Any:
            return command(*args, figures=FigureChoice(figures, figure_width), **options)

        for option in (
            click.option(
                "--figure-width",
                type=click.Choice(FIGURE_WIDTHS),
                default="screen",
                help="Width of the figures: for a screen, or for one column of a paper (3.5 in) or both (7.16 in).",
            ),
            click.option(
                "--figures",
                type=Formats(),
                default=default,
                metavar="png|pdf|svg|none",
                help="Formats of the figures; several separated by commas.",
                **alone,
            ),
        ):
            with_choice = option(with_choice)
        return with_choice

    return decorate
