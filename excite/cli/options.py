"""Types of options that several commands share."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from excite.registry import CONVENTIONS
from excite.tasks.mounts import MOUNTS
from excite.tasks.values import MARGINS
from regressors.quantities import QUANTITIES, fault, number_of, shown, whole_number_of


class Folder(click.ParamType[Path]):
    """A folder; an empty name, as from an unset variable, would mean the current folder and is refused."""

    name = "folder"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Folders."""
        return [CompletionItem(incomplete, type="dir")]

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Convert the text of the option."""
        if value == "":
            self.fail("expected the name of a folder, given ''", param, ctx)
        return Path(value)


class RobotName(click.ParamType[str]):
    """A built-in robot, or the file of one."""

    name = "robot"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Built-in names that begin so, and files."""
        from regressors.robots import built_in_names

        names = [CompletionItem(name) for name in built_in_names() if name.startswith(incomplete)]
        return [*names, CompletionItem(incomplete, type="file")]


class OwnName(click.ParamType[str]):
    """A user-defined part as ``module:Name``."""

    name = "own part"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Check the name and return it."""
        from excite.registry import is_own

        if not is_own(str(value)):
            self.fail(f"expected MODULE:NAME, given {value!r}", param, ctx)
        return str(value)


_snap_angles = click.option(
    "--snap-angles/--no-snap-angles",
    default=None,
    help="Take rounded right angles of a URDF or MJCF, such as 1.5708, for right angles.  [default: snap]",
)
_xacro = click.option(
    "--xacro",
    is_flag=True,
    default=None,
    help="Expand ROBOT as xacro although its name does not end in .xacro. Evaluated are arithmetic and listed "
    "functions only, in a process with caps and no network; what remains is the risk of an error in Python itself.",
)


def reading_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """How the file of a robot is read."""
    return _snap_angles(_xacro(command))


own_parts = click.option(
    "--part",
    "parts",
    type=OwnName(),
    multiple=True,
    metavar="MODULE:NAME",
    help="Part of your own to import where a file of results names it; repeatable.",
)


class Number(click.ParamType[float]):
    """One number within the range of its quantity."""

    name = "number"

    def __init__(self, quantity: str | None = None) -> None:
        self.quantity = quantity

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Convert the text of the option."""
        quantity = _quantity(self.quantity, param)
        try:
            number: float = _number_of(quantity, value) if isinstance(value, str) else value
        except ValueError as error:
            self.fail(str(error), param, ctx)
        _check_all(self, quantity, [number], param, ctx)
        return number


class NumberOr(Number):
    """One number, or a word that stands for none."""

    def __init__(self, word: str, quantity: str | None = None) -> None:
        super().__init__(quantity)
        self.word = word

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Convert the text of the option."""
        if value == self.word:
            return value
        quantity = _quantity(self.quantity, param)
        try:
            number = _number_of(quantity, value) if isinstance(value, str) else value
        except ValueError:
            expected = "a whole number" if QUANTITIES[quantity].whole else "a number"
            self.fail(f"expected {self.word} or {expected}, given {shown(value)}", param, ctx)
        return super().convert(number, param, ctx)


class Numbers(click.ParamType[tuple[float, ...]]):
    """One number for all joints, or one per joint, separated by commas.

    Parameters
    ----------
    quantity : str, optional
        See `Number`.
    """

    name = "numbers"

    def __init__(self, quantity: str | None = None) -> None:
        self.quantity = quantity

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        """Convert the text of the option."""
        if isinstance(value, tuple):
            return value
        try:
            numbers = tuple(number_of(part) for part in str(value).split(","))
        except ValueError:
            self.fail(f"expected numbers separated by commas, such as 2.5,2,2, given {shown(value)}", param, ctx)
        if not all(math.isfinite(number) for number in numbers):
            self.fail(f"expected finite numbers, given {shown(value)}", param, ctx)
        _check_all(self, _quantity(self.quantity, param), numbers, param, ctx)
        return numbers


def _quantity(given: str | None, param: click.Parameter | None) -> str:
    """Quantity of an option: the one that is given, or its own name."""
    name = given if given is not None or param is None else param.name
    assert name is not None
    return name


def _number_of(quantity: str, text: str) -> float:
    return whole_number_of(text) if QUANTITIES[quantity].whole else number_of(text)


def _check_all(
    kind: click.ParamType[Any],
    quantity: str,
    numbers: Iterable[float],
    param: click.Parameter | None,
    ctx: click.Context | None,
) -> None:
    for number in numbers:
        if (wrong := fault(quantity, number)) is not None:
            kind.fail(wrong, param, ctx)


class SettingNames(click.ParamType[bool | tuple[str, ...]]):
    """Names of settings separated by commas, ``all`` or ``none``."""

    name = "settings"

    def __init__(self, known: tuple[str, ...]) -> None:
        self.known = known

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> bool | tuple[str, ...]:
        """Convert the text of the option."""
        if value in ("all", "none"):
            return bool(value == "all")
        names = tuple(part.strip().replace("-", "_") for part in str(value).split(","))
        for name in names:
            if name not in self.known:
                self.fail(f"expected all, none, or some of {', '.join(self.known)}; given {name!r}", param, ctx)
        return names


class Margin(click.ParamType[float | str]):
    """A part of a limit, ``auto`` or ``none``."""

    name = "margin"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float | str:
        """Value of the text that was typed."""
        if value in MARGINS:
            return str(value)
        try:
            number = number_of(str(value))
        except ValueError:
            self.fail(f"expected a number such as 0.2, {' or '.join(MARGINS)}; given {shown(value)}", param, ctx)
        _check_all(self, _quantity(None, param), [number], param, ctx)
        return number


class Mount(click.ParamType[str | tuple[float, ...]]):
    """How a base is mounted: a name, or three angles."""

    name = "mount"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str | tuple[float, ...]:
        """Value of the text that was typed."""
        if value in MOUNTS:
            return str(value)
        try:
            return Triple("mount").convert(value, param, ctx)
        except click.BadParameter:
            self.fail(f"expected {', '.join(MOUNTS)}, or roll, pitch, yaw [rad]; given {shown(value)}", param, ctx)


class PayloadOption(click.ParamType[str | tuple[float, ...]]):
    """Numbers of a payload, or the name of a file."""

    name = "payload"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str | tuple[float, ...]:
        """Value of the text that was typed."""
        if isinstance(value, tuple) or "," in str(value):
            return Numbers("payload").convert(value, param, ctx)
        return str(value)


class Pose(click.ParamType[tuple[float, ...] | str]):
    """A number for every joint, separated by commas, or ``robot`` for the pose in the robot's file."""

    name = "pose"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...] | str:
        """Convert the text of the option."""
        return "robot" if value == "robot" else Numbers("home").convert(value, param, ctx)


class Triple(Numbers):
    """Three numbers separated by commas."""

    name = "triple"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        """Convert the text of the option."""
        numbers = super().convert(value, param, ctx)
        if len(numbers) != 3:
            self.fail(f"expected three numbers separated by commas, given {shown(value)}", param, ctx)
        return numbers


class Ranges(click.ParamType[tuple[tuple[float, float], ...]]):
    """One range LOWER:UPPER per joint, separated by commas."""

    name = "ranges"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[tuple[float, float], ...]:
        """Convert the text of the option."""
        if isinstance(value, tuple):
            return value
        try:
            pairs = tuple(tuple(number_of(part) for part in pair.split(":")) for pair in str(value).split(","))
        except ValueError:
            pairs = ()
        if not pairs or any(len(pair) != 2 or not all(map(math.isfinite, pair)) for pair in pairs):
            self.fail(f"expected LOWER:UPPER per joint, such as -1:1,-2:0.5; given {shown(value)}", param, ctx)
        _check_all(self, "position", (bound for pair in pairs for bound in pair), param, ctx)
        return tuple((pair[0], pair[1]) for pair in pairs)


def _number(text: str) -> float | None:
    return number_of(text) if text.strip() else None


class Box(click.ParamType[tuple[tuple[float | None, float | None], ...]]):
    """Lower and upper bound of x, y, z; either may be left out."""

    name = "box"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[tuple[float | None, float | None], ...]:
        """Convert the text of the option."""
        if isinstance(value, tuple):
            return value
        try:
            sides = tuple(tuple(_number(part) for part in side.split(":")) for side in str(value).split(","))
        except ValueError:
            sides = ()
        numbers = [part for side in sides for part in side if part is not None]
        if len(sides) != 3 or any(len(side) != 2 for side in sides) or not all(map(math.isfinite, numbers)):
            self.fail(f"expected L:U for x, y and z, such as -1:1,-1:1,0: ; given {shown(value)}", param, ctx)
        _check_all(self, "tool_box", numbers, param, ctx)
        return tuple((side[0], side[1]) for side in sides)


class PriorOption(click.ParamType["float | dict[str, dict[str, float]]"]):
    """Prior knowledge of parameters: one relative uncertainty, or a file."""

    name = "prior"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float | dict[str, dict[str, float]]:
        """Convert the text to a number, or to the content of the file that it names."""
        if not isinstance(value, str):
            return value  # type: ignore[no-any-return]
        try:
            number = number_of(value)
        except ValueError:
            from excite.files.prior_file import read_prior

            return read_prior(Path(value))
        if not (math.isfinite(number) and number > 0.0):
            self.fail(f"expected a relative uncertainty greater than zero, or a file, given {shown(value)}", param, ctx)
        _check_all(self, "prior", [number], param, ctx)
        return number


class PrecisionOption(click.ParamType["float | dict[str, Any]"]):
    """A precision: a share, in per cent or as a number, or a file."""

    name = "precision"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float | dict[str, Any]:
        """Convert the text to a share, or to the content of the file that it names."""
        from excite.tasks.values import share_of

        if not isinstance(value, str):
            return value  # type: ignore[no-any-return]
        try:
            share = share_of(value)
        except ValueError:
            from excite.files.precision_target_file import read_precision_target

            return read_precision_target(Path(value))
        _check_all(self, "precision", [share], param, ctx)
        return share


class Names(click.ParamType[tuple[str, ...]]):
    """Names or numbers separated by commas."""

    name = "names"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, ...]:
        """Convert the text of the option."""
        if isinstance(value, tuple):
            return value
        names = tuple(part.strip() for part in str(value).split(","))
        if not all(names):
            self.fail(f"expected names or numbers separated by commas, such as 1,3; given {value!r}", param, ctx)
        return names


class DriveNames(click.ParamType[bool | tuple[str, ...]]):
    """All, none, or names or numbers of drives separated by commas."""

    name = "drives"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> bool | tuple[str, ...]:
        """Convert the text of the option."""
        if isinstance(value, bool | tuple):
            return value
        text = str(value).strip()
        if text in ("all", "none"):
            return text == "all"
        return Names().convert(text, param, ctx)


class PartName(click.ParamType[str]):
    """A built-in part by name, or a user-defined one as ``module:Name``."""

    name = "part"

    def __init__(self, kind: str, names: tuple[str, ...], *, own: bool = True) -> None:
        from excite.registry import ADDRESS_FORMS

        self.kind, self.names, self.own = kind, names, own
        self.forms = (*names, *ADDRESS_FORMS.get(kind, ()))

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """The built-in names, and the form of others."""
        return f"[{'|'.join((*self.forms, *(['MODULE:NAME'] if self.own else [])))}]"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Built-in names that begin so."""
        return [CompletionItem(name) for name in self.names if name.startswith(incomplete)]

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Check the name and return it."""
        from excite.registry import is_addressed, is_own

        name = str(value)
        if name not in self.names and not is_addressed(self.kind, name) and not (self.own and is_own(name)):
            near = get_close_matches(str(value), self.names, 1)
            meant = f"; did you mean {near[0]}?" if near else ""
            own = ", nor module:Name of your own" if self.own else ""
            self.fail(f"{value!r} is not one of {', '.join(self.forms)}{own}{meant}", param, ctx)
        return name


def split_base(values: tuple[str, ...]) -> tuple[str | None, str | None]:
    """Split the values of ``--base`` into the base columns' convention and the URDF's base link."""
    conventions = [value for value in values if value in CONVENTIONS]
    links = [value for value in values if value not in CONVENTIONS]
    for kind, matches in (("convention", conventions), ("base link", links)):
        if len(matches) > 1:
            raise click.UsageError(f"--base names more than one {kind}: {', '.join(matches)}")
    return next(iter(conventions), None), next(iter(links), None)
