"""Coefficients written as products of powers of named constants, such as ``-2*l2*n1^2``."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from regressors.errors import InputError, UnknownName

_NUMBER = re.compile(r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_POWER = re.compile(r"([A-Za-z][A-Za-z0-9_]*)(?:\^(-?[0-9]{1,2}))?")


@dataclass(frozen=True)
class Coefficient:
    """A number times powers of named constants."""

    number: float
    powers: tuple[tuple[str, int], ...] = ()  # name and exponent of each constant

    @classmethod
    def parse(cls, text: str) -> Coefficient:
        """Coefficient from its text: ``[+-] factor * factor * ...`` with factors ``2.5``, ``l2`` or ``n1^2``."""
        unsigned = text.strip()
        number = -1.0 if unsigned.startswith("-") else 1.0
        powers = []
        for factor in unsigned.removeprefix("-" if number < 0 else "+").split("*"):
            if _NUMBER.fullmatch(factor.strip()):
                number *= float(factor)
            elif power := _POWER.fullmatch(factor.strip()):
                powers.append((power[1], int(power[2] or 1)))
            else:
                raise InputError(f"expected a number or a product such as '-2*l2*n1^2', given {text!r}")
        if not math.isfinite(number):
            raise InputError(f"coefficient must be finite, given {text!r}")
        return cls(number, tuple(powers))

    def value(self, constants: Mapping[str, float]) -> float:
        """Value of the product for given values of the constants."""
        value = self.number
        for name, exponent in self.powers:
            if name not in constants:
                raise UnknownName("constant", name, constants)
            try:
                value *= constants[name] ** exponent
            except (OverflowError, ZeroDivisionError):
                value = math.nan
        if not math.isfinite(value):
            raise InputError(f"coefficient is not a finite number with {dict(constants)}")
        return value
