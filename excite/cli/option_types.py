"""Values of options: how the text that was typed becomes a value, within the bounds of its quantity."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from excite.registry import ADDRESS_FORMS, FIGURE_FORMATS, is_addressed, is_own
from excite.tasks.option import AUTO, MOUNTS, NONE, share_of
from regressors.errors import InputError
from regressors.quantities import QUANTITIES, fault, number_of, shown, whole_number_of

Words = Mapping[str, Any]  # what stands for another value than a number or a name
ALL_OR_NONE: Words = {"all": True, NONE: False}
FILE = click.Path(path_type=Path)


class Value(click.ParamType[Any]):
    """A value that `read` makes of a text and its option's name; what that refuses is an error of the option."""

    def __init__(self, name: str, read: Callable[[Any, str], Any], words: Words | None = None) -> None:
        self.name, self.read, self.words = name, read, words or {}

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Convert the text of the option."""
        if isinstance(value, str) and value in self.words:
            return self.words[value]
        try:
            return self.read(value, "" if param is None else str(param.name))
        except InputError:
            raise  # of a file that the text names
        except ValueError as error:
            self.fail(str(error), param, ctx)


class Folder(Value):
    """A folder; an empty name, as from an unset variable, would mean the current folder and is refused."""

    def __init__(self) -> None:
        super().__init__("folder", _folder)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Folders."""
        return [CompletionItem(incomplete, type="dir")]


def _folder(value: Any, _: str) -> Path:
    if value == "":
        raise ValueError("expected the name of a folder, given ''")
    return Path(value)


class RobotName(click.ParamType[str]):
    """A built-in robot, or the file of one."""

    name = "robot"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Built-in names that begin so, and files."""
        from regressors.robots import built_in_names

        names = [CompletionItem(name) for name in built_in_names() if name.startswith(incomplete)]
        return [*names, CompletionItem(incomplete, type="file")]


class PartName(Value):
    """A built-in part of a kind by name, or, where that is allowed, a user-defined one as ``module:Name``."""

    def __init__(self, kind: str, names: tuple[str, ...] = (), *, own: bool = True) -> None:
        super().__init__("part", self._part)
        self.kind, self.names, self.own = kind, names, own
        self.forms = (*names, *ADDRESS_FORMS.get(kind, ()))

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """The built-in names, and the form of others."""
        return f"[{'|'.join((*self.forms, *(['MODULE:NAME'] if self.own else [])))}]"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Built-in names that begin so."""
        return [CompletionItem(name) for name in self.names if name.startswith(incomplete)]

    def _part(self, value: Any, _: str) -> str:
        part = str(value)
        if part in self.names or is_addressed(self.kind, part) or (self.own and is_own(part)):
            return part
        if not self.names:
            raise ValueError(f"expected MODULE:NAME, given {value!r}")
        near = get_close_matches(part, self.names, 1)
        meant = f"; did you mean {near[0]}?" if near else ""
        own = ", nor module:Name of your own" if self.own else ""
        raise ValueError(f"{value!r} is not one of {', '.join(self.forms)}{own}{meant}")


class Number(Value):
    """One number within the range of its quantity, which is that of the option's name if none is given, or a word."""

    def __init__(self, quantity: str | None = None, words: Words | None = None, *, percent: bool = False) -> None:
        super().__init__("number", self._number, words)
        self.quantity, self.percent = quantity, percent

    def _number(self, value: Any, name: str) -> Any:
        quantity = self.quantity or name
        whole = QUANTITIES[quantity].whole
        try:
            number = (whole_number_of if whole else number_of)(value) if isinstance(value, str) else value
        except ValueError:
            if not self.words:
                raise
            kind = "a whole number" if whole else "a number"
            raise ValueError(f"expected {', '.join(self.words)} or {kind}, given {shown(value)}") from None
        (number,) = _within(quantity, [number])
        return number / 100 if self.percent else number


class Numbers(Value):
    """One number for all joints, or one per joint, separated by commas; or a word."""

    def __init__(
        self, quantity: str | None = None, counts: tuple[int, ...] = (), words: Words | None = None, expected: str = ""
    ) -> None:
        super().__init__("numbers", self._numbers, words)
        self.quantity, self.counts = quantity, counts
        self.expected = expected  # in place of a message on the numbers alone

    def _numbers(self, value: Any, name: str) -> Any:
        if isinstance(value, tuple):
            return value
        try:
            numbers = _within(self.quantity or name, _numbers_of(str(value)))
            if self.counts and len(numbers) not in self.counts:
                counts = " or ".join({3: "three", 6: "six"}[count] for count in self.counts)
                raise ValueError(f"expected {counts} numbers separated by commas, given {shown(value)}")
        except ValueError:
            if not self.expected:
                raise
            raise ValueError(f"expected {self.expected}; given {shown(value)}") from None
        return numbers


def size(quantity: str) -> Value:
    """A velocity or a distance, one of each drive, or ``auto``, which is None."""

    def read(value: Any, name: str) -> Any:
        try:
            numbers = Numbers(quantity).read(str(value), name)
        except ValueError as error:
            raise ValueError(f"expected auto or a number; {error}") from None
        return numbers[0] if len(numbers) == 1 else numbers

    return Value("numbers", read, {AUTO: None})


class Sides(Value):
    """Pairs LOWER:UPPER, separated by commas; for a box three, of which either number may be left out."""

    def __init__(self, quantity: str, form: str, *, box: bool = False, widths: bool = False) -> None:
        super().__init__("box" if box else "ranges", self._widths if widths else self._sides)
        self.quantity, self.form, self.box = quantity, form, box

    def _sides(self, value: Any, _: str) -> Any:
        if isinstance(value, tuple):
            return value
        try:
            sides = tuple(
                tuple(None if self.box and not part.strip() else number_of(part) for part in side.split(":"))
                for side in str(value).split(",")
            )
        except ValueError:
            sides = ()
        numbers = [number for side in sides for number in side if number is not None]
        right = len(sides) == 3 if self.box else bool(sides)
        if not right or any(len(side) != 2 for side in sides) or not all(map(math.isfinite, numbers)):
            raise ValueError(f"expected {self.form}; given {shown(value)}")
        _within(self.quantity, numbers)
        return sides

    def _widths(self, value: Any, name: str) -> Any:
        """One side for all of x, y, z, three sides, or bounds."""
        if isinstance(value, tuple) or ":" in str(value):
            return self._sides(value, name)
        sides = _within(self.quantity, _numbers_of(str(value)))
        if len(sides) not in (1, 3) or not all(side > 0 for side in sides):
            raise ValueError("expected one side greater than zero, three, or L:U,L:U,L:U")
        return sides * (3 // len(sides))


MOUNT = Numbers(
    counts=(3,), words={name: name for name in MOUNTS}, expected=f"{', '.join(MOUNTS)}, or roll, pitch, yaw [rad]"
)


class Names(Value):
    """Names or numbers separated by commas, all of them known ones if these are stated; or a word."""

    def __init__(self, words: Words | None = None, known: tuple[str, ...] = ()) -> None:
        super().__init__("names", self._names, words)
        self.known = known

    def _names(self, value: Any, _: str) -> Any:
        if isinstance(value, bool | tuple):
            return value
        if (text := str(value).strip()) in self.words:
            return self.words[text]
        names = tuple(part.strip() for part in text.split(","))
        if self.known:
            names = tuple(dict.fromkeys(name.replace("-", "_") for name in names))
            if not set(names) <= set(self.known):
                raise ValueError(
                    f"expected {', '.join(self.words)}, or some of {', '.join(self.known)} separated by commas; "
                    f"given {value!r}"
                )
        if not all(names):
            raise ValueError(f"expected names or numbers separated by commas, such as 1,3; given {value!r}")
        return names


FORMATS = Names({NONE: ()}, FIGURE_FORMATS)


def _payload(value: Any, name: str) -> Any:
    """Numbers of a payload, or the name of a file."""
    return Numbers("payload").read(value, name) if isinstance(value, tuple) or "," in str(value) else str(value)


def _prior(value: Any, _: str) -> Any:
    """One relative uncertainty, or what a file of prior knowledge holds."""
    if not isinstance(value, str):
        return value
    try:
        number = number_of(value)
    except ValueError:
        from excite.tasks.friction_file import read_prior

        return read_prior(Path(value))
    if not (math.isfinite(number) and number > 0.0):
        raise ValueError(f"expected a relative uncertainty greater than zero, or a file, given {shown(value)}")
    return _within("prior", [number])[0]


def _precision(value: Any, _: str) -> Any:
    """A share, in per cent or as a number, or what a file holds."""
    if not isinstance(value, str):
        return value
    try:
        share = share_of(value)
    except ValueError:
        from excite.design.design_json import read_precision_target

        return read_precision_target(Path(value))
    return _within("precision", [share])[0]


def _impact(value: Any, _: str) -> Any:
    """``JOINT:TIME:TORQUE``, or ``JOINT:TIME:TORQUE:DURATION``."""
    from excite.simulation.settings import ImpactPulse

    joint, *numbers = str(value).split(":")
    try:
        given = [number_of(number) for number in numbers]
    except ValueError:
        given = []
    if not joint or len(given) not in (2, 3):
        raise ValueError(
            "expected JOINT:TIME:TORQUE or JOINT:TIME:TORQUE:DURATION, such as q2:3.5:200 for 200 Nm at 3.5 s; "
            f"given {shown(value)}"
        )
    return ImpactPulse(joint, *given)


PAYLOAD, PRIOR, PRECISION, IMPACT = (Value(read.__name__[1:], read) for read in (_payload, _prior, _precision, _impact))


def _numbers_of(text: str) -> tuple[float, ...]:
    try:
        numbers = tuple(map(number_of, text.split(",")))
    except ValueError:
        raise ValueError(f"expected numbers separated by commas, such as 2.5,2,2, given {shown(text)}") from None
    if not all(map(math.isfinite, numbers)):
        raise ValueError(f"expected finite numbers, given {shown(text)}")
    return numbers


def _within(quantity: str, numbers: Sequence[float]) -> tuple[float, ...]:
    """Numbers that a quantity may be, or a `ValueError` that says what it may be."""
    for wrong in filter(None, (fault(quantity, number) for number in numbers)):
        raise ValueError(wrong)
    return tuple(numbers)
