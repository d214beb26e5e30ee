"""Options: fields of settings, such as the parts of a task, each with type, meaning and default stated once.

The command line, task files and documentation are generated from them; the unit and bounds of a number are those of
the quantity of its name in `regressors.quantities.QUANTITIES`.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from regressors.quantities import QUANTITIES

Kind = Literal[
    "flag", "integer", "number", "numbers", "ranges", "box", "triple", "pose", "poses", "names", "name", "text", "file",
    "prior", "margin", "count", "mount", "payload", "drives", "parameters",
    "folders", "precision", "size", "time", "distance", "impacts", "percent", "frame", "sides",
]  # fmt: skip

NUMERIC = frozenset(
    ("integer", "number", "numbers", "ranges", "box", "triple", "pose", "poses", "count", "margin", "size", "time",
     "distance", "percent", "sides")
)  # fmt: skip
_QUANTITIES: Mapping[Kind, str] = {"ranges": "position", "box": "tool_box", "sides": "tool_box", "pose": "home"}


@dataclass(frozen=True)
class Option:
    """Description of one field of settings, in addition to its type and default."""

    kind: Kind  # kind of values that it accepts
    help: str  # one sentence, without the unit, which is that of the quantity
    metavar: str | None = None  # placeholder of its value in the help
    part: str | None = None  # kind of parts in the registry: the option accepts their names, or objects
    choices: tuple[str, ...] = ()  # all values that it accepts, where these are few
    # name on the command line, if it is not the field's; after a slash, the name that turns a flag off
    flag: str | None = None
    hidden: bool = False  # not on the command line
    late: bool = False  # in stored tasks only where it is not the default: the option is younger than their schema
    quantity: str | None = None  # quantity of its numbers, if it is not that of the field's name
    # default that the command line shows where it is not the field's, since what is not given is chosen
    unset: str | None = None
    essential: bool = False  # in the short help too, as most uses need it
    word: str | None = None  # typed for a value that is not given, such as ``found``

    def unit(self, name: str) -> str:
        """Unit of its numbers, by the quantity of a field's name if it has none of its own; empty for plain ones."""
        quantity = self.quantity or _QUANTITIES.get(self.kind, name)
        return QUANTITIES[quantity].unit if self.kind in NUMERIC and quantity in QUANTITIES else ""

    def described(self, name: str) -> str:
        """The sentence, with the unit at the end of its first clause."""
        if not (unit := self.unit(name)):
            return self.help
        return re.sub(r"(?=; |\. |\.$)", f" [{unit}]", self.help, count=1)


_KEY = "option"


def option(default: Any, kind: Kind, help: str, **more: Any) -> Any:
    """Declare an option as a field of settings."""
    return dataclasses.field(default=default, metadata={_KEY: Option(kind, help, **more)})


def essential(default: Any, kind: Kind, help: str, **more: Any) -> Any:
    """Declare an option that the short help lists too."""
    return option(default, kind, help, essential=True, **more)


def options_of(part: type) -> Iterator[tuple[dataclasses.Field[Any], Option]]:
    """Fields of settings that are options, in their order."""
    for field in dataclasses.fields(part):
        if _KEY in field.metadata:
            yield field, field.metadata[_KEY]


Check = Callable[[Any], None]
