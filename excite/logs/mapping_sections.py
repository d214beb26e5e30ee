"""Schema of the sections of a log mapping: columns, units, and the conversion of cells to values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo, field_validator

from excite.logs.layout import Channel

_ANGLES = {"rad": 1.0, "deg": np.pi / 180, "turns": 2 * np.pi, "m": 1.0, "mm": 1e-3}
_SPEEDS = {**{f"{name}/s": scale for name, scale in _ANGLES.items()}, "rpm": 2 * np.pi / 60}


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
    """Base of all sections: unknown fields are refused."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class TimeSection(Section):
    """Column of the time, and its unit."""

    column: Column
    unit: Literal["s", "ms", "us", "ns"] = "s"


class ChannelSection(Section):
    """Columns of one channel, and the conversion of their cells to SI."""

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
            raise ValueError(f"gives {len(value)} values for {columns} columns; expected one for all, or one for each")
        return value

    @property
    def factor(self) -> list[float]:
        """Further factors of the values, from the gear ratios."""
        return [1.0]

    def channel(self, columns: tuple[int, ...]) -> Channel:
        """Channel in given columns."""
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
    """Three forces [N] and three torques [Nm] at the sensor; unit kN means kN and kNm."""

    units: ClassVar = {"N": 1.0, "kN": 1e3}
