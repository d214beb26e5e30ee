"""Angles of descriptions: expressions of pi, and multiples of right angles that were rounded.

A joint that is turned by 1.5708 instead of pi/2 is 4e-6 rad off parallel to its neighbour, and what only this error
shows counts as parameters of its own.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Iterator
from decimal import ROUND_DOWN, ROUND_HALF_EVEN, Decimal

import numpy as np

from regressors.errors import Finding
from regressors.readers.urdf_elements import XmlElement
from regressors.robot.inertia import Array

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


_UNSEEN = 1e-8  # rad; smaller changes of an angle show nowhere
_TURN = 2.001 * math.pi
QUATERNION = 1.2e-5  # rad; what six digits of a quaternion leave open, or three turns by 1.5708 about one axis
_RIGHT_ANGLES = np.abs(np.outer(range(5), [0.0, *(round(np.pi / 2, k) - np.pi / 2 for k in (2, 3))])).ravel()
_LIKE_A_RIGHT_ANGLE = 5e-3  # rad; about three times what 3.14 for pi leaves
_TOOK, _CLOSE = "took", "close to a right angle, but read as printed:"
_LARGE = "angles of more than a full turn:"
_ADVICE = {
    _TOOK: "`snap_angles=False` keeps the printed digits",
    _CLOSE: "an angle that is off by its rounding shows parameters that are none",
    _LARGE: "rpy is in radians, not in degrees",
}


class AngleReader:
    """Reads angles and keeps in mind which it took for another."""

    def __init__(self, snap: bool) -> None:
        self._snap = snap
        self._noticed: dict[str, list[tuple[str, str]]] = defaultdict(list)

    def rotation(self, origin: XmlElement) -> Array:
        """``R = Rz(yaw) Ry(pitch) Rx(roll)`` of an ``<origin>``, shape (3, 3)."""
        values = origin.numbers("rpy", (0.0, 0.0, 0.0))
        texts = origin.attributes.get("rpy", "0 0 0").split()
        cosines, sines = np.cos(values), np.sin(values)
        for k, (text, value) in enumerate(zip(texts, values, strict=True)):
            count = self._multiple(text, float(value), origin.label)
            if count is not None:
                cosines[k], sines[k] = cosine_and_sine(count)
        (cr, cp, cy), (sr, sp, sy) = cosines, sines
        return np.array(
            [
                [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                [-sp, cp * sr, cp * cr],
            ]
        )

    def _multiple(self, text: str, value: float, where: str) -> int | None:
        """Twelfths of pi that an angle stands for, kept in mind."""
        count = multiple_of(text) if self._snap else None
        if count is not None and abs(value - count * math.pi / 12) > _UNSEEN:
            self._noticed[_TOOK].append((where, f"{text} for {in_words(count)}"))
        elif abs(value) > _TURN:
            self._noticed[_LARGE].append((where, text))
        elif self._snap and count is None and (meant := nearly(text)) is not None:
            exact = round(value / (math.pi / 2)) * math.pi / 2
            self._noticed[_CLOSE].append((where, f"{text} (if {meant} is meant, write {exact!r})"))
        return count

    def turned(self, R: Array, where: str) -> Array:
        """A rotation matrix whose digits are lost, as of a quaternion, shape (3, 3): turns by right angles are exact.

        A turn about one axis counts as an angle that was printed, see `multiple_of`; one about several as right angles
        if it is as far off them as six digits of a quaternion leave open, or as right angles of two or three decimals.
        """  # R (3, 3)
        if not self._snap:
            return R
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            angle = math.atan2(R[j, i], R[i, i])
            if R[k, k] > 1.0 - 0.5 * QUATERNION**2 and (count := _printed_angle(angle)) is not None:
                exact = np.zeros((3, 3))
                c, s = cosine_and_sine(count)
                exact[k, k], exact[i, i], exact[j, j], exact[i, j], exact[j, i] = 1.0, c, c, -s, s
                if np.abs(exact - R).max() > _UNSEEN:
                    self._noticed[_TOOK].append((where, f"{angle:.7g} for {in_words(count)}"))
                return exact
        exact = np.round(R)
        off = exact.T @ R
        residual = 0.5 * np.array([off[2, 1] - off[1, 2], off[0, 2] - off[2, 0], off[1, 0] - off[0, 1]])
        size = float(np.linalg.norm(residual))
        if not np.array_equal(exact.T @ exact, np.eye(3)) or size > _LIKE_A_RIGHT_ANGLE:
            return R
        if np.abs(np.abs(residual)[:, None] - _RIGHT_ANGLES).min(axis=1).max() > QUATERNION:
            self._noticed[_CLOSE].append((where, f"axes that are {size:.2g} rad off"))
            return R
        if size > _UNSEEN:
            self._noticed[_TOOK].append((where, f"axes that are {size:.2g} rad off right angles for right angles"))
        return exact

    def axis(self, direction: Array, where: str, text: str, noise_size: float = SINGLE) -> Array:
        """Unit vector of an ``<axis>``, without components that are rounding errors, shape (3,)."""  # direction (3,)
        noise = np.abs(direction) <= noise_size
        if not self._snap or not np.any(noise & (direction != 0.0)):
            return direction
        if np.any(np.abs(direction[noise]) > _UNSEEN):
            self._noticed[_TOOK].append((where, f"the axis {text!r} without its noise"))
        exact = np.where(noise, 0.0, direction)
        return np.asarray(exact / np.linalg.norm(exact))

    def findings(self, labels: Collection[str]) -> Iterator[Finding]:
        """What was taken for another angle, and what may be meant for another."""
        for what, noticed in self._noticed.items():
            told = [(where, angle) for where, angle in noticed if where in labels]
            if told:
                angles = ", ".join(dict.fromkeys(angle for _, angle in told))
                first, *others = dict.fromkeys(where for where, _ in told)
                where = f"{first} and {len(others)} more" if others else first
                yield Finding("snapped" if what == _TOOK else "suspicious", where, f"{what} {angles}", _ADVICE[what])


def _printed_angle(angle: float) -> int | None:
    """Twelfths of pi that an angle stands for in one of its roundings, as far as a quaternion shows it."""
    count = round(angle * 12 / math.pi)
    if (count % 3 == 0 or count % 2 == 0) and abs(angle - count * math.pi / 12) <= QUATERNION:
        return count
    texts = (f"{angle:.{digits}f}" for digits in (2, 3, 4))
    return next((n for text in texts if abs(float(text) - angle) <= QUATERNION and (n := multiple_of(text))), None)
