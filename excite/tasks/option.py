"""Options of a task: fields of its parts, each with name, type, meaning and default stated once.

The command line, task files and documentation are generated from them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal

Kind = Literal[
    "flag", "integer", "number", "numbers", "ranges", "box", "triple", "pose", "poses", "names", "name", "text", "file",
    "prior", "margin", "count", "mount", "payload", "drives", "parameters",
    "folders", "precision",
]  # fmt: skip


@dataclass(frozen=True)
class Option:
    """Description of one field of a task, in addition to its type and default."""

    kind: Kind  # kind of values that it accepts
    help: str  # one line, with the unit
    metavar: str | None = None  # placeholder of its value in the help
    part: str | None = None  # kind of parts in the registry: the option accepts their names, or objects
    choices: tuple[str, ...] = ()  # all values that it accepts, where these are few
    # name on the command line, if it is not the field's; after a slash, the name that turns a flag off
    flag: str | None = None
    hidden: bool = False  # not on the command line
    late: bool = False  # in stored tasks only where it is not the default: the option is younger than their schema


_KEY = "option"


def option(default: Any, kind: Kind, help: str, **more: Any) -> Any:
    """Declare an option as a field of a part of a task."""
    return dataclasses.field(default=default, metadata={_KEY: Option(kind, help, **more)})


def options_of(part: type) -> Iterator[tuple[dataclasses.Field[Any], Option]]:
    """Fields of a part that are options, in their order."""
    for field in dataclasses.fields(part):
        if _KEY in field.metadata:
            yield field, field.metadata[_KEY]


Check = Callable[[Any], None]
