"""Schema of the sections of a log mapping: columns, units, and the conversion of cells to values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationInfo,
    field_validator,
    model_validator,
)

from excite.logs.layout import Channel
from regressors.readers.sized_numbers import within

_LEAST = 1e-15  # of factors
TICKS = "ticks"  # of an encoder: the field ticks says how many per turn
_ANGLES = {
    "rad": 1.0, "deg": np.pi / 180, "turns": 2 * np.pi, "rev": 2 * np.pi, TICKS: 2 * np.pi, "m": 1.0, "mm": 1e-3,
}  # fmt: skip
_SPEEDS = {**{f"{name}/s": scale for name, scale in _ANGLES.items()}, "rpm": 2 * np.pi / 60}


def _several(value: object) -> object:
    return value if isinstance(value, list) else [value]


def _not_zero(value: list[float]) -> list[float]:
    if 0.0 in value:
        raise ValueError("must not be zero")
    if any(abs(x) < _LEAST for x in value):
        raise ValueError(f"must be {_LEAST:g} or more, or {-_LEAST:g} or less")
    return value


def _within(quantity: str) -> tuple[object, ...]:
    """Validators of one number or a list, each within the range of its quantity."""
    return AfterValidator(within(quantity)), BeforeValidator(_several)


Column = Annotated[int | str, AfterValidator(within("column"))]
Offsets = Annotated[list[float], *_within("reading")]
Gains = Annotated[list[float], AfterValidator(_not_zero), *_within("gain")]
Ratios = Annotated[list[float], AfterValidator(_not_zero), *_within("ratio")]
Ticks = Annotated[list[float], AfterValidator(_not_zero), *_within("ticks")]
Names = Annotated[list[str], BeforeValidator(_several)]
Signs = Annotated[list[Literal[1, -1]], BeforeValidator(_several)]


class Section(BaseModel):
    """Base of all sections: unknown fields are refused."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class TimeSection(Section):
    """Column of the time, and its unit."""

    column: Column
    unit: Literal["s", "ms", "us", "ns"] = "s"


class ChannelSection(Section):
    """Columns of one channel, and the conversion of their cells to SI."""

    units: ClassVar[Mapping[str, float]] = {}
    zeros: ClassVar[Mapping[str, float]] = {}  # readings at zero of the SI unit

    file: str | None = None
    time: TimeSection | None = None
    columns: list[Column]
    unit: Names
    gain: Gains = [1.0]
    offset: Offsets = [0.0]
    sign: Signs = [1]

    @field_validator("unit")
    @classmethod
    def _known(cls, value: list[str]) -> list[str]:
        for unit in value:
            if unit not in cls.units:
                raise ValueError(f"no unit {unit!r}; available: {', '.join(cls.units)}")
        return value

    @field_validator("unit", "gain", "offset", "sign", "ratio", "ticks", check_fields=False)
    @classmethod
    def _one_or_each(cls, value: list[object] | None, info: ValidationInfo) -> list[object] | None:
        if value is None:
            return None
        columns = len(info.data.get("columns", value))
        if len(value) not in (1, columns):
            raise ValueError(f"gives {len(value)} values for {columns} columns; expected one for all, or one for each")
        return value

    @property
    def factor(self) -> list[float]:
        """Further factors of the values, from the gear ratios and the ticks of encoders."""
        return [1.0]

    @property
    def zero(self) -> list[float]:
        """Readings at zero [unit of the cell]."""
        own = [self.zeros.get(name, 0.0) for name in self.unit]
        return [a if b == a else a + b for a, b in _pairs(own, self.offset)]

    def channel(self, columns: tuple[int, ...]) -> Channel:
        """Channel in given columns."""
        unit = np.array([self.units[name] for name in self.unit])
        scale = np.array(self.sign, dtype=float) * np.array(self.gain) * unit * np.array(self.factor)
        each = np.ones(len(columns))
        return Channel(columns, scale * each, np.array(self.zero) * each)


def _pairs(one: list[float], other: list[float]) -> list[tuple[float, float]]:
    """Values of two lists, of which either may hold one for all."""
    count = max(len(one), len(other))
    return [(one[k % len(one)], other[k % len(other)]) for k in range(count)]


class GearedSection(ChannelSection):
    """A channel of the joints, or of their motors.

    On the motors' side it goes through the gears and the coupling that the robot's description states, see
    `excite.logs.motor_channels`; a `ratio` that is given replaces the gears.
    """

    side: Literal["joint", "motor"] = "joint"
    ratio: Ratios = [1.0]

    @property
    def own_gears(self) -> bool:
        """Whether the gears of the robot's description are meant."""
        return self.side == "motor" and "ratio" not in self.model_fields_set


class PositionSection(GearedSection):
    """Positions, of the joints or of their motors."""

    units: ClassVar = _ANGLES
    ticks: Ticks | None = None

    @model_validator(mode="after")
    def _ticks_with_their_unit(self) -> Self:
        counted = any(TICKS in name for name in self.unit)
        if counted and self.ticks is None:
            raise ValueError("unit ticks needs the field ticks: how many the encoder counts per turn")
        if self.ticks is not None and not all(TICKS in name for name in self.unit):
            raise ValueError("ticks is given, but the unit is not ticks")
        return self

    @property
    def factor(self) -> list[float]:
        """Joint per motor, and turn per tick."""
        return [1.0 / (ratio * ticks) for ratio, ticks in _pairs(self.ratio, self.ticks or [1.0])]


class VelocitySection(PositionSection):
    """Velocities, of the joints or of their motors."""

    units: ClassVar = _SPEEDS


class EffortSection(GearedSection):
    """Torques or forces, of the joints or of their motors."""

    units: ClassVar = {"Nm": 1.0, "mNm": 1e-3, "kNm": 1e3, "N": 1.0, "kN": 1e3}

    @property
    def factor(self) -> list[float]:
        """Torque of the joint per torque of the motor."""
        return self.ratio


class CurrentSection(EffortSection):
    """Currents of the motors, with the torque constant [Nm/A] as their gain."""

    units: ClassVar = {"A": 1.0, "mA": 1e-3}
    gain: Gains = Field(default=...)


class TemperatureSection(ChannelSection):
    """Temperatures; an offset of kelvin's own 273.15 is not subtracted twice."""

    units: ClassVar = {"degC": 1.0, "K": 1.0, "degF": 5 / 9}
    zeros: ClassVar = {"K": 273.15, "degF": 32.0}


class WrenchSection(ChannelSection):
    """Three forces [N] and three torques [Nm] at the sensor; unit kN means kN and kNm."""

    units: ClassVar = {"N": 1.0, "kN": 1e3}
