"""Angles that were printed with too few digits: which multiple of a right angle, of pi/4 or of pi/6 they stand for.

A joint that is turned by 1.5708 instead of pi/2 is 4e-6 rad off parallel to its neighbour, and what only this error
shows counts as parameters of its own.
"""

from __future__ import annotations

import math
from decimal import ROUND_DOWN, ROUND_HALF_EVEN, Decimal

_PI = Decimal("3.14159265358979323846264338327950288419716939937510582")
_STEPS = 12  # multiples of pi/12, of which those of pi/4 and pi/6 count
_RIGHT, _FEWEST, _MOST = 2, 3, 16  # decimals of a number that can only be meant so; more are as good as exact
_TWICE_ROUNDED = 5  # decimals from which multiples of a rounded right angle differ from rounded multiples
SINGLE = 2e-7  # rad; what is left of pi in single precision
_LARGEST = 2  # full turns


def multiple_of(text: str) -> int | None:
    """How many twelfths of pi a printed angle stands for; None where it is no multiple of pi/4 or pi/6.

    An angle stands for a multiple that it equals, rounded or cut off to its own decimals, if it has three of them or
    more, as 0.785 has; for a multiple of a right angle two suffice, as in 3.14. With five or more, it stands also for
    two or three times a right angle that was rounded before (3.14158 is twice 1.57079). One that differs by 2e-7 rad or
    less, as after single precision, does too. So no angle changes by more than its last printed digit leaves open.

    Of the angles of the 69 robots of example-robot-data, those of two or three decimals that are so near to a multiple
    are 1.57, 1.571, 3.14 and 3.142; the nearest calibrated one is 1.1e-4 rad off, with eight decimals.
    """
    value = float(text)
    count = round(value * _STEPS / math.pi) if abs(value) <= _LARGEST * 2 * math.pi + 1 else 0
    if count % 3 and count % 2:
        return None
    exact = float(count * _PI / _STEPS)
    near = abs(value - exact) <= SINGLE
    return count if near or Decimal(text) in _printed(count, decimals(text)) else None


def decimals(text: str) -> int:
    """Digits behind the point that a printed number has, without zeros at its end."""
    exponent = Decimal(text).normalize().as_tuple().exponent
    return max(0, -exponent) if isinstance(exponent, int) else 0


def nearly(text: str) -> str | None:
    """Multiple of pi/2 that an angle of two decimals or more is within two of its last digits of, as text."""
    quarters = round(float(text) / (math.pi / 2)) if abs(float(text)) < 100 else 0
    digits = decimals(text)
    close = abs(float(text) - quarters * math.pi / 2) <= 2 * 10.0**-digits
    return in_words(6 * quarters) if quarters and digits >= 2 and close else None


def in_words(count: int) -> str:
    """Twelfths of pi as a fraction, such as ``-3 pi/2``."""
    divisor = math.gcd(count, _STEPS)
    times, part = abs(count) // divisor, _STEPS // divisor
    sign = "-" if count < 0 else ""
    return "0" if count == 0 else f"{sign}{'' if times == 1 else f'{times} '}pi{'' if part == 1 else f'/{part}'}"


def cosine_and_sine(count: int) -> tuple[float, float]:
    """Cosine and sine of so many twelfths of pi, exact where they are 0, 1/2 or 1."""
    return _cosine(count), _cosine(count - 6)


def _cosine(count: int) -> float:
    folded = abs(count) % 24
    folded = min(folded, 24 - folded)
    exact = {0: 1.0, 4: 0.5, 6: 0.0, 8: -0.5, 12: -1.0}
    return exact.get(folded, math.cos(folded * math.pi / _STEPS))


def _printed(count: int, digits: int) -> set[Decimal]:
    """All that a multiple may have been printed as with so many digits behind the point."""
    if count == 0 or not (_FEWEST if count % 6 else _RIGHT) <= digits <= _MOST:
        return set()
    printed = {_to(count * _PI / _STEPS, digits, how) for how in (ROUND_HALF_EVEN, ROUND_DOWN)}
    if digits >= _TWICE_ROUNDED and count in (12, -12, 18, -18):
        printed |= {count // 6 * _to(_PI / 2, digits, how) for how in (ROUND_HALF_EVEN, ROUND_DOWN)}
    return printed


def _to(value: Decimal, digits: int, how: str) -> Decimal:
    return value.quantize(Decimal(1).scaleb(-digits), rounding=how)
