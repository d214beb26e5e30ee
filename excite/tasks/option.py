"""Fields of a task's parts: each says once what it is called, what it may be, what it means and what it is by default.

Command line, task files and documentation are made from them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal

Kind = Literal[
    "flag", "integer", "number", "numbers", "ranges", "box", "triple", "pose", "poses", "names", "name", "text", "file",
    "prior", "margin", "mount",
]  # fmt: skip


@dataclass(frozen=True)
class Option:
    """Description of one field of a task, in addition to its type and default.

    Parameters
    ----------
    kind : str
        Which values it takes.
    help : str
        One line, with the unit.
    metavar : str, optional
        What stands for its value in the help.
    part : str, optional
        Of the registry: it takes names of such parts, or objects.
    choices : tuple of str
        All values that it takes, where these are few.
    flag : str, optional
        Name on the command line, where that is not the field's; after a slash, what turns a flag off.
    """

    kind: Kind
    help: str
    metavar: str | None = None
    part: str | None = None
    choices: tuple[str, ...] = ()
    flag: str | None = None


_KEY = "option"


def option(default: Any, kind: Kind, help: str, **more: Any) -> Any:
    """Field of a part of a task.

    Parameters
    ----------
    default : object
    kind, help
        As in `Option`.
    **more
        The rest of `Option`.
    """
    return dataclasses.field(default=default, metadata={_KEY: Option(kind, help, **more)})


def options_of(part: type) -> Iterator[tuple[dataclasses.Field[Any], Option]]:
    """Fields of a part that are options, in their order."""
    for field in dataclasses.fields(part):
        if _KEY in field.metadata:
            yield field, field.metadata[_KEY]


Check = Callable[[Any], None]
