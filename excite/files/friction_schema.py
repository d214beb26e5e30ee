"""Fields of friction files, schema ``excite.friction/1``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from regressors.readers.sized_numbers import Celsius, Exponent, Friction

_CONFIG = ConfigDict(extra="forbid", allow_inf_nan=False)


class SideEntry(BaseModel):
    """Friction in one direction."""

    model_config = _CONFIG
    coulomb: Friction
    viscous: Friction = 0.0
    stiction: Friction | None = None
    stribeck: Friction = 0.05
    exponent: Exponent = 2.0


class SlopeEntry(BaseModel):
    """Temperature dependence of friction in one direction."""

    model_config = _CONFIG
    coulomb: Friction = 0.0
    viscous: Friction = 0.0


class TemperatureEntry(BaseModel):
    """Temperature dependence of friction."""

    model_config = _CONFIG
    reference: Celsius
    coulomb: Friction | None = None
    viscous: Friction | None = None
    forward: SlopeEntry | None = None
    backward: SlopeEntry | None = None
    range: Annotated[list[Celsius], Field(min_length=2, max_length=2)] | None = None


class LoadEntry(BaseModel):
    """Share of the carried torque in each direction."""

    model_config = _CONFIG
    forward: Friction
    backward: Friction


class UncertaintyEntry(BaseModel):
    """Covariance of a curve's parameters."""

    model_config = _CONFIG
    parameters: Annotated[list[str], Field(min_length=1)]
    covariance: list[list[Friction]]


class CurveEntry(BaseModel):
    """Curve of one drive."""

    model_config = _CONFIG
    model: Literal["coulomb-viscous", "stribeck", "table"]
    coulomb: Friction | None = None
    viscous: Friction | None = None
    offset: Friction | None = None
    forward: SideEntry | None = None
    backward: SideEntry | None = None
    speed: list[Friction] | None = None
    torque: list[Friction] | None = None
    temperature: TemperatureEntry | None = None
    load: Friction | LoadEntry | None = None
    uncertainty: UncertaintyEntry | None = None


class FrictionFile(BaseModel):
    """Complete friction file."""

    model_config = _CONFIG
    schema_: Literal["excite.friction/1"] = Field(alias="schema")
    drives: dict[str, CurveEntry]
