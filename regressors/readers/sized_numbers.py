"""Numbers of files as types of a schema: plain ones, within the range of their quantity; not true, nor text."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

from pydantic import BeforeValidator, Field

from regressors.quantities import fault


def within(quantity: str) -> Callable[[object], object]:
    """Validator of numbers, or lists of these, which leaves them as they are."""

    def validated(value: object) -> object:
        if (wrong := fault(quantity, value)) is not None:
            raise ValueError(wrong)
        return value

    return validated


def _not_text(value: object) -> object:
    if isinstance(value, str):
        raise ValueError(f"must be a number, given the text {value[:40]!r}")
    return value


def _number(quantity: str) -> tuple[object, ...]:
    return BeforeValidator(within(quantity)), BeforeValidator(_not_text)


Length = Annotated[float, *_number("length")]
Angle = Annotated[float, *_number("angle")]
Friction = Annotated[float, *_number("friction_parameter")]
Load = Annotated[float, *_number("load")]
Celsius = Annotated[float, *_number("temperature")]
Exponent = Annotated[float, *_number("exponent")]
Point = Annotated[list[Length], Field(min_length=3, max_length=3)]
Angles = Annotated[list[Angle], Field(min_length=3, max_length=3)]
