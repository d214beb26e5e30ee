"""Numbers as controllers read them: plain decimals, no exponents."""

from __future__ import annotations

from collections.abc import Iterable

_DIGITS = 9


def number_text(value: float, digits: int = _DIGITS) -> str:
    """A number with a point, some digits behind it, and no exponent."""
    text = f"{value:.{digits}f}".rstrip("0")
    text = f"{text}0" if text.endswith(".") else text
    return "0.0" if text == "-0.0" else text


def list_text(values: Iterable[float], digits: int = _DIGITS) -> str:
    """Numbers separated by commas."""
    return ", ".join(number_text(value, digits) for value in values)
