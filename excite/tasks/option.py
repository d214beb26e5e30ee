"""Options: fields of settings, such as the parts of a task, each with type, meaning and default stated once.

The command line, task files and documentation are generated from them; the unit and bounds of a number are those of
the quantity of its name in `regressors.quantities.QUANTITIES`.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from numbers import Integral, Real
from pathlib import Path
from typing import Any, Literal

from excite.registry import check_part
from excite.tasks.precision_target import PrecisionTarget
from excite.tasks.stored_files import UnopenedFile
from regressors.arguments import Unfit, fit, rule_of
from regressors.errors import InputError, UnknownName, check_names
from regressors.quantities import QUANTITIES, check, number_of

Kind = Literal[
    "flag", "integer", "number", "numbers", "ranges", "box", "triple", "pose", "poses", "names", "name", "text", "file",
    "prior", "margin", "count", "mount", "payload", "drives", "parameters",
    "folders", "precision", "size", "distance", "impacts", "percent", "frame", "sides", "several", "parts",
]  # fmt: skip

_PLAIN = ("integer", "number", "numbers", "ranges", "box", "triple", "pose", "poses")
NUMERIC = frozenset((*_PLAIN, "count", "margin", "size", "distance", "percent", "sides"))
_QUANTITIES: Mapping[Kind, str] = {"ranges": "position", "box": "tool_box", "sides": "tool_box", "pose": "home"}


@dataclass(frozen=True)
class Option:
    """Description of one field of settings, in addition to its type and default."""

    kind: Kind  # kind of values that it accepts
    help: str  # one sentence, without the unit, which is that of the quantity, and without the drives to choose from
    metavar: str | None = None  # placeholder of its value in the help, if it is not that of the kind or the unit
    part: str | None = None  # kind of parts in the registry: the option accepts their names, or objects
    choices: tuple[str, ...] = ()  # all values that it accepts, where these are few
    # name on the command line, if it is not the field's; after a slash, the name that turns a flag off, if it is not
    # no- and the name for one that is on by default
    flag: str | None = None
    hidden: bool = False  # not on the command line
    late: bool = False  # in stored tasks only where it is not the default: the option is younger than their schema
    quantity: str | None = None  # quantity of its numbers, if it is not that of the field's name
    # default that the command line shows where it is not the field's, since what is not given is chosen
    unset: str | None = None
    essential: bool = False  # in the short help too, as most uses need it
    word: str | None = None  # typed for a value that is not given, such as ``found``
    required: bool = False  # the command line refuses to go on without it

    def unit(self, name: str) -> str:
        """Unit of its numbers, by the quantity of a field's name if it has none of its own; empty for plain ones."""
        quantity = self.quantity or _QUANTITIES.get(self.kind, name)
        return QUANTITIES[quantity].unit if self.kind in NUMERIC and quantity in QUANTITIES else ""

    def described(self, name: str) -> str:
        """The sentence, with the unit at the end of its first clause, or with the drives that can be chosen."""
        if self.kind == "drives" and self.flag is None:
            return f"{self.help}: of all drives, none, or these."
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


MOUNTS: dict[str, tuple[float, float, float]] = {  # roll, pitch and yaw of the base [rad]
    "floor": (0.0, 0.0, 0.0),
    "wall": (0.0, math.pi / 2, 0.0),
    "ceiling": (math.pi, 0.0, 0.0),
}


AUTO, NONE, ALL = "auto", "none", "all"
MARGINS = (AUTO, NONE)
_NUMBERS = frozenset((*_PLAIN, "mount", "payload", "parameters"))


def strict(part: Any) -> None:
    """Convert every option of a part to its type, in place: numbers to float, lists to tuples."""
    for field, option in options_of(type(part)):
        value = getattr(part, field.name)
        if value is None or value is field.default:
            if value is None and field.default is not None and option.kind != "margin":
                raise InputError(f"{field.name}: expected {EXPECTED[option.kind]}, given nothing")
            continue
        plain = fit(field.name, value, rule_of_option(option))
        if (option.kind in _NUMBERS and not isinstance(plain, UnopenedFile)) or (
            option.kind in ("prior", "margin", "count") and isinstance(plain, Real)
        ):
            check(field.name, plain)
        object.__setattr__(part, field.name, plain)
    check_choices(part)


def rule_of_option(option: Option) -> tuple[Callable[[Any], Any], str]:
    """What converts a value of an option, or raises `Unfit`; and what it expects, in words."""
    return (_text, EXPECTED["name"]) if option.kind == "name" and option.part is None else _KINDS[option.kind]


def check_choices(part: object) -> None:
    """Raise `UnknownName` or `InputError` for an option that is none of its few values, or no part of its kind."""
    for field, option in options_of(type(part)):
        value = getattr(part, field.name)
        if option.part is not None:
            check_part(option.part, value)
        elif option.choices and value not in option.choices:
            raise UnknownName(field.name, str(value), option.choices)


def _number(value: object) -> float:
    return float(_real(value))


def _flag(value: object) -> bool:
    if not isinstance(value, bool):
        raise Unfit
    return value


def _sequence(value: Any) -> Sequence[Any]:
    if isinstance(value, str | bytes | Mapping) or not isinstance(value, Iterable) or getattr(value, "ndim", 1) == 0:
        raise Unfit
    return list(value)


def _numbers(value: object) -> tuple[float, ...]:
    return (_number(value),) if isinstance(value, Real) else tuple(map(_number, _sequence(value)))


def _so_many(count: int, value: object) -> tuple[float, ...]:
    numbers = _numbers(value)
    if len(numbers) != count:
        raise Unfit
    return numbers


def _box(value: object) -> tuple[tuple[float | None, ...], ...]:
    return tuple(tuple(None if x is None else _number(x) for x in _sequence(side)) for side in _sequence(value))


def _name(value: object) -> object:
    if isinstance(value, Integral) and not isinstance(value, bool):
        return str(value)  # of a joint
    if isinstance(value, bool | Real | None):
        raise Unfit
    return value


def _text(value: object) -> str:
    name = _name(value)
    if not isinstance(name, str):
        raise Unfit
    return name


def _names(value: object, one: Callable[[object], Any] = _text) -> tuple[Any, ...]:
    return tuple(map(one, [value] if isinstance(value, str) else _sequence(value)))


def _drives(value: object) -> object:
    """All, none, or names and numbers of drives as text."""
    if isinstance(value, bool):
        return value
    if isinstance(value, str) and value in (ALL, NONE):
        return value == ALL
    if not all(names := _names([value] if isinstance(value, Integral) else value)):
        raise Unfit
    return tuple(dict.fromkeys(names)) or False


def _parameters(value: object) -> dict[str, float]:
    if not isinstance(value, Mapping) or not all(isinstance(name, str) for name in value):
        raise Unfit
    numbers = {name: _number(number) for name, number in value.items()}
    if not all(map(math.isfinite, numbers.values())):
        raise Unfit
    return numbers


def _folders(value: object) -> tuple[object, ...]:
    """Folders, or objects that were read from them; one alone too."""
    several = hasattr(value, "__iter__") and not isinstance(value, str | bytes | Mapping)
    if hasattr(value, "dtype"):
        raise Unfit
    folders = tuple(value) if several else (value,)  # type: ignore[arg-type]
    if any(each is None or isinstance(each, bool | Real | bytes | Mapping) or each == "" for each in folders):
        raise Unfit
    return tuple(str(each) if isinstance(each, Path) else each for each in folders)


def _or_word(words: Container[str], convert: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return lambda value: value if isinstance(value, str) and value in words else convert(value)


def _payload(value: object) -> object:
    if isinstance(value, UnopenedFile):
        return value
    return str(value) if isinstance(value, str | Path) else _numbers(value)


def _file(value: object) -> object:
    if isinstance(value, Real | list | tuple):
        raise Unfit
    return value


def _prior(value: object) -> object:
    return _number(value) if isinstance(value, Real) else value


def _precision(value: object) -> PrecisionTarget:
    if isinstance(value, PrecisionTarget):
        return value
    if isinstance(value, Mapping):
        check_names("entry of `precision`", map(str, value), PrecisionTarget.__dataclass_fields__)
        return PrecisionTarget(**value)
    if not isinstance(value, str):
        return PrecisionTarget(_number(value))
    try:
        return PrecisionTarget(share_of(value))
    except ValueError as error:
        raise error if isinstance(error, InputError) else Unfit from error


def share_of(text: str) -> float:
    """A share from text: ``5%`` or ``0.05``."""
    return number_of(text.removesuffix("%").rstrip()) / 100.0 if text.endswith("%") else number_of(text)


_as_it_is, _real = (rule_of(hint)[0] for hint in (object, float))
_pair, _triple = (partial(_so_many, count) for count in (2, 3))
_KINDS: dict[Kind, tuple[Callable[[Any], Any], str]] = {  # conversion, and what is expected
    "flag": (_flag, "true or false"),
    "integer": rule_of(int),
    "number": (_number, "a number"),
    "numbers": (_numbers, "a number, or a list of numbers"),
    "frame": (_as_it_is, "three numbers, or six"),
    "sides": (_as_it_is, "one side, three, or a pair [lower, upper] for each of x, y, z"),
    "ranges": (lambda value: tuple(map(_pair, _sequence(value))), "a list of pairs [lower, upper]"),
    "box": (_box, "a pair [lower, upper] for each of x, y, z"),
    "triple": (_triple, "three numbers"),
    "pose": (lambda value: value if isinstance(value, str) else _numbers(value), "a list of numbers, one per joint"),
    "poses": (lambda value: tuple(map(_numbers, _sequence(value))), "a list of poses"),
    "names": (_names, "a list of names"),
    "parts": (lambda value: _names(value, _name), "a list of names"),
    "name": (_name, "a name"),
    "text": (_name, "a name"),
    "file": (_file, "the name of a file, or its content"),
    "prior": (_prior, "a relative uncertainty, or parameters with value and deviation"),
    "margin": (_or_word(MARGINS, _number), f"a number, {' or '.join(MARGINS)}"),
    "count": (_or_word((AUTO,), rule_of(int)[0]), f"a whole number, or {AUTO}"),
    "mount": (_or_word(MOUNTS, _triple), f"{', '.join(MOUNTS)}, or roll, pitch and yaw"),
    "payload": (_payload, "a list of numbers, or the name of a file"),
    "drives": (_drives, "all, none, or names or numbers of drives"),
    "parameters": (_parameters, "standard parameters, each with a finite number"),
    "folders": (_folders, "results or designs, or their folders"),
    "precision": (_precision, "a share such as 0.05, or a precision target"),
    "size": (_as_it_is, f"{AUTO}, a number, or a list of numbers"),
    "distance": (_as_it_is, f"{AUTO}, or a number"),
    "impacts": (_as_it_is, "a list of impacts"),
    "several": (_names, "some of its names"),
    "percent": (_as_it_is, "a share, on the command line in per cent"),
}
EXPECTED: dict[Kind, str] = {kind: expected for kind, (_, expected) in _KINDS.items()}
