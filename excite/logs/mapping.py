"""How a foreign file of measurements is laid out, as a small YAML file.

Columns are given by name or by number, 1 for the first; without a header by number. Of every channel the value is

    ``value = sign gain unit (cell - offset) / ratio``   (position, velocity)
    ``value = sign gain unit (cell - offset) ratio``     (effort, current)

with `ratio` the turns of the motor per turn of the joint, where the motor's side was recorded, and `gain` what the
unit does not say, such as the torque constant [Nm/A] of a measured current. Each of `unit`, `gain`, `ratio`,
`offset`, `sign` is one value for all joints or a list of one per joint. The logs of an arm that records motor currents,
six joints in 31 columns without a header, are read by::

    separator: ","
    header: false
    time: {column: 1, unit: s}
    joints: [shoulder_pan_joint, shoulder_lift_joint, elbow_joint, wrist_1_joint, wrist_2_joint, wrist_3_joint]
    position: {columns: [2, 3, 4, 5, 6, 7], unit: rad}
    velocity: {columns: [8, 9, 10, 11, 12, 13], unit: rad/s}
    current: {columns: [14, 15, 16, 17, 18, 19], unit: A, gain: [14.87, 13.26, 11.13, 10.62, 11.03, 11.47]}
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo, field_validator

from excite.logs.layout import Channel, Layout, cells, is_number, listed, twice
from excite.logs.log import WRENCH
from regressors.documents import checked, parse_document
from regressors.errors import InputError, UnknownName

_ANGLES = {"rad": 1.0, "deg": np.pi / 180, "turns": 2 * np.pi, "m": 1.0, "mm": 1e-3}
_SPEEDS = {**{f"{name}/s": scale for name, scale in _ANGLES.items()}, "rpm": 2 * np.pi / 60}
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_SEPARATORS = {",": ",", ";": ";", "\t": "\t", "tab": "\t", "whitespace": None}


def _several(value: object) -> object:
    return value if isinstance(value, list) else [value]


def _not_zero(value: list[float]) -> list[float]:
    if 0.0 in value:
        raise ValueError("must not be zero")
    return value


Column = Annotated[int, Field(ge=1)] | str
Numbers = Annotated[list[float], BeforeValidator(_several)]
Factors = Annotated[Numbers, AfterValidator(_not_zero)]
Names = Annotated[list[str], BeforeValidator(_several)]
Signs = Annotated[list[Literal[1, -1]], BeforeValidator(_several)]


class Section(BaseModel):
    """Fields that are all known."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class TimeSection(Section):
    """Column of the time, and its unit."""

    column: Column
    unit: Literal["s", "ms", "us", "ns"] = "s"


class ChannelSection(Section):
    """Columns of one channel, and what their cells are worth."""

    units: ClassVar[Mapping[str, float]] = {}

    columns: list[Column]
    unit: Names
    gain: Factors = [1.0]
    offset: Numbers = [0.0]
    sign: Signs = [1]

    @field_validator("unit")
    @classmethod
    def _known(cls, value: list[str]) -> list[str]:
        for unit in value:
            if unit not in cls.units:
                raise ValueError(f"no unit {unit!r}; available: {', '.join(cls.units)}")
        return value

    @field_validator("unit", "gain", "offset", "sign", "ratio", check_fields=False)
    @classmethod
    def _one_or_each(cls, value: list[object], info: ValidationInfo) -> list[object]:
        columns = len(info.data.get("columns", value))
        if len(value) not in (1, columns):
            raise ValueError(f"gives {len(value)} values for {columns} columns; one for all, or one for each")
        return value

    @property
    def factor(self) -> list[float]:
        """What is left to be multiplied with."""
        return [1.0]

    def channel(self, columns: tuple[int, ...]) -> Channel:
        """Channel that stands in given columns."""
        unit = np.array([self.units[name] for name in self.unit])
        scale = np.array(self.sign, dtype=float) * np.array(self.gain) * unit * np.array(self.factor)
        each = np.ones(len(columns))
        return Channel(columns, scale * each, np.array(self.offset) * each)


class PositionSection(ChannelSection):
    """Positions, of the joints or of their motors."""

    units: ClassVar = _ANGLES
    ratio: Factors = [1.0]

    @property
    def factor(self) -> list[float]:
        """Joint per motor."""
        return [1.0 / ratio for ratio in self.ratio]


class VelocitySection(PositionSection):
    """Velocities, of the joints or of their motors."""

    units: ClassVar = _SPEEDS


class EffortSection(ChannelSection):
    """Torques or forces, of the joints or of their motors."""

    units: ClassVar = {"Nm": 1.0, "mNm": 1e-3, "kNm": 1e3, "N": 1.0, "kN": 1e3}
    ratio: Factors = [1.0]

    @property
    def factor(self) -> list[float]:
        """Torque of the joint per torque of the motor."""
        return self.ratio


class CurrentSection(EffortSection):
    """Currents of the motors, with the torque constant [Nm/A] as their gain."""

    units: ClassVar = {"A": 1.0, "mA": 1e-3}
    gain: Factors = Field(default=...)


class TemperatureSection(ChannelSection):
    """Temperatures; kelvin needs ``offset: 273.15``."""

    units: ClassVar = {"degC": 1.0, "K": 1.0}


class WrenchSection(ChannelSection):
    """Three forces [N] and three torques [Nm] at the sensor; kN stands for kN and kNm."""

    units: ClassVar = {"N": 1.0, "kN": 1e3}


class LogMapping(Section):
    """Layout of a file, and units of its columns; see the module's example."""

    joints: Annotated[list[str], Field(min_length=1)]
    time: TimeSection
    position: PositionSection
    velocity: VelocitySection | None = None
    effort: EffortSection | None = None
    current: CurrentSection | None = None
    temperature: TemperatureSection | None = None
    wrench: WrenchSection | None = None
    separator: Literal[",", ";", "\t", "tab", "whitespace"] = ","
    header: bool = True
    skip: Annotated[int, Field(ge=0)] = 0

    @field_validator("joints")
    @classmethod
    def _once(cls, value: list[str]) -> list[str]:
        if (name := twice(value)) is not None:
            raise ValueError(f"{name!r} is given twice")
        return value

    @field_validator("position", "velocity", "effort", "current", "temperature", "wrench")
    @classmethod
    def _each(cls, value: ChannelSection | None, info: ValidationInfo) -> ChannelSection | None:
        expected = len(WRENCH) if info.field_name == "wrench" else len(info.data.get("joints", ()))
        if value is not None and "joints" in info.data and len(value.columns) != expected:
            what = "components" if info.field_name == "wrench" else "joints"
            raise ValueError(f"has {len(value.columns)} columns for {expected} {what}")
        return value

    @field_validator("current")
    @classmethod
    def _either(cls, value: CurrentSection | None, info: ValidationInfo) -> CurrentSection | None:
        if value is not None and info.data.get("effort") is not None:
            raise ValueError("is given beside effort; one of them makes the torque")
        return value

    def layout(self, source: str, lines: Sequence[str]) -> Layout:
        """Layout of a file's lines.

        Parameters
        ----------
        source : str
            Name of the file, for messages.
        lines : sequence of str

        Raises
        ------
        InputError
            The file does not have the lines or the columns that the mapping speaks of.
        """
        if len(lines) <= self.skip:
            raise InputError(f"{source} has {len(lines)} lines, of which the mapping skips {self.skip}")
        separator = _SEPARATORS[self.separator]
        head = cells(lines[self.skip], separator)
        numbers = [f"{k}" for k in range(1, len(head) + 1)]
        self._check_head(source, head)
        index = {name: k for k, name in reversed(list(enumerate(head)))} if self.header else {}
        found = {
            "q": self.position,
            "dq": self.velocity,
            "effort": self.effort or self.current,
            "temperature": self.temperature,
            "wrench": self.wrench,
        }
        channels = {
            name: section.channel(tuple(_place(source, c, index, len(head)) for c in section.columns))
            for name, section in found.items()
            if section is not None
        }
        return Layout(
            separator,
            self.skip + self.header,
            tuple(head if self.header else numbers),
            _place(source, self.time.column, index, len(head)),
            _SECONDS[self.time.unit],
            tuple(self.joints),
            channels,
        )

    def _check_head(self, source: str, head: list[str]) -> None:
        """Refuse a first line that is not what the mapping says it is."""
        here = f"{source}, line {self.skip + 1}"
        if self.header and all(is_number(cell) for cell in head):
            raise InputError(f"{here} holds numbers, where the mapping says that there is a header; header: false?")
        if not self.header and not any(is_number(cell) for cell in head):
            raise InputError(f"{here} holds no number: {listed(head)}; header: true, lines to skip, other separator?")


def _place(source: str, column: int | str, index: Mapping[str, int], count: int) -> int:
    if isinstance(column, str):
        if column not in index:
            raise UnknownName(f"column in {source}", column, index or ["numbers only, the file has no header"])
        return index[column]
    if column > count:
        raise InputError(f"{source} has {count} columns, the mapping asks for number {column}")
    return column - 1


def read_mapping(path: str | Path) -> LogMapping:
    """Mapping in a YAML file.

    Parameters
    ----------
    path : path

    Raises
    ------
    InputError
        Cannot be read, or malformed; with line and field.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read log mapping {path}: {getattr(error, 'strerror', None) or error}") from error
    return checked(parse_document(text, str(path)), LogMapping)
