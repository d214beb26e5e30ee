"""Values of options: how the text that was typed becomes a value, within the bounds of its quantity."""

from __future__ import annotations

import math
from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from excite.registry import ADDRESS_FORMS, FIGURE_FORMATS, is_addressed, is_own
from excite.tasks.mounts import MOUNTS
from excite.tasks.values import AUTO, MARGINS, NONE, share_of
from regressors.errors import InputError
from regressors.quantities import QUANTITIES, fault, number_of, shown, whole_number_of


class Value(click.ParamType[Any]):
    """A value that `read` makes of what was typed; what that refuses by a `ValueError` is an error of the option."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Convert the text of the option."""
        try:
            return self.read(value, "" if param is None else str(param.name))
        except InputError:
            raise  # of a file that the text names
        except ValueError as error:
            self.fail(str(error), param, ctx)

    def read(self, value: Any, name: str) -> Any:
        """The value of the option of a name."""
        raise NotImplementedError


class Folder(Value):
    """A folder; an empty name, as from an unset variable, would mean the current folder and is refused."""

    name = "folder"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Folders."""
        return [CompletionItem(incomplete, type="dir")]

    def read(self, value: Any, name: str) -> Path:
        """The path."""
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


class OwnName(Value):
    """A user-defined part as ``module:Name``."""

    name = "own part"

    def read(self, value: Any, name: str) -> str:
        """The name."""
        if not is_own(str(value)):
            raise ValueError(f"expected MODULE:NAME, given {value!r}")
        return str(value)


class PartName(Value):
    """A built-in part of a kind by name, or, where that is allowed, a user-defined one as ``module:Name``."""

    name = "part"

    def __init__(self, kind: str, names: tuple[str, ...], *, own: bool = True) -> None:
        self.kind, self.names, self.own = kind, names, own
        self.forms = (*names, *ADDRESS_FORMS.get(kind, ()))

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """The built-in names, and the form of others."""
        return f"[{'|'.join((*self.forms, *(['MODULE:NAME'] if self.own else [])))}]"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Built-in names that begin so."""
        return [CompletionItem(name) for name in self.names if name.startswith(incomplete)]

    def read(self, value: Any, name: str) -> str:
        """The name."""
        part = str(value)
        if part not in self.names and not is_addressed(self.kind, part) and not (self.own and is_own(part)):
            near = get_close_matches(part, self.names, 1)
            meant = f"; did you mean {near[0]}?" if near else ""
            own = ", nor module:Name of your own" if self.own else ""
            raise ValueError(f"{value!r} is not one of {', '.join(self.forms)}{own}{meant}")
        return part


class Number(Value):
    """One number within the range of its quantity, which is that of the option's name if none is given."""

    name = "number"

    def __init__(self, quantity: str | None = None) -> None:
        self.quantity = quantity

    def read(self, value: Any, name: str) -> Any:
        """The number."""
        quantity = self.quantity or name
        number: float = _number_of(quantity, value) if isinstance(value, str) else value
        return _within(quantity, [number])[0]


class NumberOr(Number):
    """One number, or a word that stands for none."""

    def __init__(self, word: str, quantity: str | None = None) -> None:
        super().__init__(quantity)
        self.word = word

    def read(self, value: Any, name: str) -> Any:
        """The number, or the word."""
        if value == self.word:
            return value
        quantity = self.quantity or name
        try:
            number = _number_of(quantity, value) if isinstance(value, str) else value
        except ValueError:
            expected = "a whole number" if QUANTITIES[quantity].whole else "a number"
            raise ValueError(f"expected {self.word} or {expected}, given {shown(value)}") from None
        return super().read(number, name)


class Delay(NumberOr):
    """A time, or ``auto``, which is None."""

    def read(self, value: Any, name: str) -> Any:
        """The time."""
        number = super().read(value, name)
        return None if number == self.word else number


class Percent(Number):
    """A share that is given in per cent."""

    def read(self, value: Any, name: str) -> float:
        """The share."""
        return float(super().read(value, name)) / 100


class Share(Value):
    """A number from 0 to 1."""

    name = "share"

    def read(self, value: Any, name: str) -> float:
        """The number."""
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not 0.0 <= number <= 1.0:
            raise ValueError(f"expected a number from 0 to 1, such as 0.05, given {str(value)[:40]!r}")
        return number


class Numbers(Value):
    """One number for all joints, or one per joint, separated by commas."""

    name = "numbers"

    def __init__(self, quantity: str | None = None) -> None:
        self.quantity = quantity

    def read(self, value: Any, name: str) -> Any:
        """The numbers."""
        if isinstance(value, tuple):
            return value
        try:
            numbers = tuple(number_of(part) for part in str(value).split(","))
        except ValueError:
            raise ValueError(f"expected numbers separated by commas, such as 2.5,2,2, given {shown(value)}") from None
        if not all(math.isfinite(number) for number in numbers):
            raise ValueError(f"expected finite numbers, given {shown(value)}")
        return _within(self.quantity or name, numbers)


class Triple(Numbers):
    """Three numbers separated by commas."""

    name = "triple"

    def read(self, value: Any, name: str) -> Any:
        """The numbers."""
        numbers = super().read(value, name)
        if len(numbers) != 3:
            raise ValueError(f"expected three numbers separated by commas, given {shown(value)}")
        return numbers


class FrameOption(Numbers):
    """Origin of a frame, or origin and roll, pitch, yaw."""

    name = "frame"

    def read(self, value: Any, name: str) -> Any:
        """Origin and angles."""
        numbers = Numbers("sensor_xyz").read(value, name)
        if len(numbers) not in (3, 6):
            raise ValueError("expected X,Y,Z or X,Y,Z,ROLL,PITCH,YAW")
        return numbers + (0.0,) * (6 - len(numbers))


class Width(Numbers):
    """A velocity or a distance, one of each drive, or ``auto``, which is None."""

    name = "width"

    def read(self, value: Any, name: str) -> Any:
        """One number, or several."""
        if value is None or value == AUTO:
            return None
        try:
            numbers = super().read(value, name)
        except ValueError as error:
            raise ValueError(f"expected auto or a number; {error}") from None
        return numbers if len(numbers) > 1 else numbers[0]


class Pose(Value):
    """A number for every joint, separated by commas, or a word: ``robot`` for the pose in the robot's file."""

    name = "pose"

    def read(self, value: Any, name: str) -> Any:
        """The numbers, or the word."""
        return value if value == "robot" else Numbers("home").read(value, name)


class PoseOrFound(Value):
    """A number for every joint, separated by commas, or ``found``, which is None."""

    name = "pose"

    def read(self, value: Any, name: str) -> Any:
        """The numbers."""
        return None if value == "found" else Numbers("pose").read(value, name)


class Margin(Value):
    """A part of a limit, ``auto`` or ``none``."""

    name = "margin"

    def read(self, value: Any, name: str) -> float | str:
        """The number, or the word."""
        if value in MARGINS:
            return str(value)
        try:
            number = number_of(str(value))
        except ValueError:
            expected = f"expected a number such as 0.2, {' or '.join(MARGINS)}"
            raise ValueError(f"{expected}; given {shown(value)}") from None
        return _within(name, [number])[0]


class Mount(Value):
    """How a base is mounted: a name, or three angles."""

    name = "mount"

    def read(self, value: Any, name: str) -> Any:
        """The name, or the angles."""
        if value in MOUNTS:
            return str(value)
        try:
            return Triple("mount").read(value, name)
        except ValueError:
            expected = f"expected {', '.join(MOUNTS)}, or roll, pitch, yaw [rad]"
            raise ValueError(f"{expected}; given {shown(value)}") from None


class PayloadOption(Value):
    """Numbers of a payload, or the name of a file."""

    name = "payload"

    def read(self, value: Any, name: str) -> Any:
        """The numbers, or the name."""
        return Numbers("payload").read(value, name) if isinstance(value, tuple) or "," in str(value) else str(value)


class Ranges(Value):
    """One range LOWER:UPPER per joint, separated by commas."""

    name = "ranges"

    def read(self, value: Any, name: str) -> Any:
        """Lower and upper bounds."""
        if isinstance(value, tuple):
            return value
        try:
            pairs = tuple(tuple(number_of(part) for part in pair.split(":")) for pair in str(value).split(","))
        except ValueError:
            pairs = ()
        if not pairs or any(len(pair) != 2 or not all(map(math.isfinite, pair)) for pair in pairs):
            raise ValueError(f"expected LOWER:UPPER per joint, such as -1:1,-2:0.5; given {shown(value)}")
        _within("position", (bound for pair in pairs for bound in pair))
        return pairs


class Box(Value):
    """Lower and upper bound of x, y, z; either may be left out."""

    name = "box"

    def read(self, value: Any, name: str) -> Any:
        """Lower and upper bounds, None for none."""
        if isinstance(value, tuple):
            return value
        try:
            sides = tuple(
                tuple(number_of(part) if part.strip() else None for part in side.split(":"))
                for side in str(value).split(",")
            )
        except ValueError:
            sides = ()
        numbers = [part for side in sides for part in side if part is not None]
        if len(sides) != 3 or any(len(side) != 2 for side in sides) or not all(map(math.isfinite, numbers)):
            raise ValueError(f"expected L:U for x, y and z, such as -1:1,-1:1,0: ; given {shown(value)}")
        _within("tool_box", numbers)
        return sides


class BoxOrSides(Box):
    """One side for all of x, y, z, three sides, or lower and upper bound of each."""

    def read(self, value: Any, name: str) -> Any:
        """Three sides, or bounds."""
        if isinstance(value, tuple) or ":" in str(value):
            return super().read(value, name)
        sides = Numbers("tool_box").read(value, name)
        if len(sides) not in (1, 3) or not all(side > 0 for side in sides):
            raise ValueError("expected one side greater than zero, three, or L:U,L:U,L:U")
        return sides * (3 // len(sides))


class PriorOption(Value):
    """Prior knowledge of parameters: one relative uncertainty, or a file."""

    name = "prior"

    def read(self, value: Any, name: str) -> Any:
        """The number, or the content of the file."""
        if not isinstance(value, str):
            return value
        try:
            number = number_of(value)
        except ValueError:
            from excite.files.robot_yaml import read_prior

            return read_prior(Path(value))
        if not (math.isfinite(number) and number > 0.0):
            raise ValueError(f"expected a relative uncertainty greater than zero, or a file, given {shown(value)}")
        return _within("prior", [number])[0]


class PrecisionOption(Value):
    """A precision: a share, in per cent or as a number, or a file."""

    name = "precision"

    def read(self, value: Any, name: str) -> Any:
        """The share, or the content of the file."""
        if not isinstance(value, str):
            return value
        try:
            share = share_of(value)
        except ValueError:
            from excite.files.precision_target_file import read_precision_target

            return read_precision_target(Path(value))
        return _within("precision", [share])[0]


class ImpactOption(Value):
    """``JOINT:TIME:TORQUE``, or ``JOINT:TIME:TORQUE:DURATION``."""

    name = "impact"

    def read(self, value: Any, name: str) -> Any:
        """The impact."""
        from excite.simulation.impact_pulse import ImpactPulse

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


class Names(Value):
    """Names or numbers separated by commas."""

    name = "names"

    def read(self, value: Any, name: str) -> tuple[str, ...]:
        """The names."""
        if isinstance(value, tuple):
            return value
        names = tuple(part.strip() for part in str(value).split(","))
        if not all(names):
            raise ValueError(f"expected names or numbers separated by commas, such as 1,3; given {value!r}")
        return names


class DriveNames(Names):
    """All, none, or names or numbers of drives separated by commas."""

    name = "drives"

    def read(self, value: Any, name: str) -> Any:
        """True, False, or the names."""
        if isinstance(value, bool | tuple):
            return value
        text = str(value).strip()
        return text == "all" if text in ("all", NONE) else super().read(text, name)


class SettingNames(Value):
    """Names of settings separated by commas, ``all`` or ``none``."""

    name = "settings"

    def __init__(self, known: tuple[str, ...]) -> None:
        self.known = known

    def read(self, value: Any, name: str) -> bool | tuple[str, ...]:
        """True, False, or the names."""
        if value in ("all", NONE):
            return bool(value == "all")
        names = tuple(part.strip().replace("-", "_") for part in str(value).split(","))
        for each in names:
            if each not in self.known:
                raise ValueError(f"expected all, none, or some of {', '.join(self.known)}; given {each!r}")
        return names


class Formats(Value):
    """Formats of figures separated by commas, or ``none``."""

    name = "formats"

    def read(self, value: Any, name: str) -> tuple[str, ...]:
        """The formats."""
        if isinstance(value, tuple):
            return value
        names = [part.strip() for part in str(value).split(",")]
        if names == [NONE]:
            return ()
        if any(each not in FIGURE_FORMATS for each in names):
            known = ", ".join(FIGURE_FORMATS)
            raise ValueError(f"expected none, or some of {known} separated by commas; given {value!r}")
        return tuple(dict.fromkeys(names))


def _number_of(quantity: str, text: str) -> float:
    return whole_number_of(text) if QUANTITIES[quantity].whole else number_of(text)


def _within(quantity: str, numbers: Iterable[float]) -> tuple[float, ...]:
    """Numbers that a quantity may be, or a `ValueError` that says what it may be."""
    checked = tuple(numbers)
    if (wrong := next(filter(None, (fault(quantity, number) for number in checked)), None)) is not None:
        raise ValueError(wrong)
    return checked
