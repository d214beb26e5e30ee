"""Fields of friction files, schema ``excite.friction/1``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

_CONFIG = ConfigDict(extra="forbid", allow_inf_nan=False)


class SideEntry(BaseModel):
    """Friction in one direction."""

    model_config = _CONFIG
    coulomb: float
    viscous: float = 0.0
    stiction: float | None = None
    stribeck: float = 0.05
    exponent: float = 2.0


class SlopeEntry(BaseModel):
    """Temperature dependence of friction in one direction."""

    model_config = _CONFIG
    coulomb: float = 0.0
    viscous: float = 0.0


class TemperatureEntry(BaseModel):
    """Temperature dependence of friction."""

    model_config = _CONFIG
    reference: float
    coulomb: float | None = None
    viscous: float | None = None
    forward: SlopeEntry | None = None
    backward: SlopeEntry | None = None
    range: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None


class LoadEntry(BaseModel):
    """Share of the carried torque in each direction."""

    model_config = _CONFIG
    forward: float
    backward: float


class UncertaintyEntry(BaseModel):
    """Covariance of a curve's parameters."""

    model_config = _CONFIG
    parameters: Annotated[list[str], Field(min_length=1)]
    covariance: list[list[float]]


class CurveEntry(BaseModel):
    """Curve of one drive."""

    model_config = _CONFIG
    model: Literal["coulomb-viscous", "stribeck", "table"]
    coulomb: float | None = None
    viscous: float | None = None
    offset: float | None = None
    forward: SideEntry | None = None
    backward: SideEntry | None = None
    speed: list[float] | None = None
    torque: list[float] | None = None
    temperature: TemperatureEntry | None = None
    load: float | LoadEntry | None = None
    uncertainty: UncertaintyEntry | None = None


class FrictionFile(BaseModel):
    """Complete friction file."""

    model_config = _CONFIG
    schema_: Literal["excite.friction/1"] = Field(alias="schema")
    drives: dict[str, CurveEntry]
