"""Rotations of a URDF, from roll, pitch and yaw as they are printed."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Iterator

import numpy as np

from regressors.readers.snapped_angles import SINGLE, cosine_and_sine, in_words, multiple_of, nearly
from regressors.readers.urdf_elements import XmlElement
from regressors.robot.finding import Finding
from regressors.robot.inertia import Array

_UNSEEN = 1e-8  # rad; smaller changes of an angle show nowhere
_TURN = 2.001 * math.pi
_TOOK, _CLOSE = "took", "close to a right angle, but read as printed:"
_LARGE = "angles of more than a full turn:"
_ADVICE = {
    _TOOK: "`snap_angles=False` keeps the printed digits",
    _CLOSE: "an angle that is off by its rounding shows parameters that are none",
    _LARGE: "rpy is in radians, not in degrees",
}


class AngleReader:
    """Reads angles and keeps in mind which it took for another.

    Parameters
    ----------
    snap : bool
        Take rounded multiples for the multiples, see `multiple_of`; else every angle is read as it is printed.
    """

    def __init__(self, snap: bool) -> None:
        self._snap = snap
        self._noticed: dict[str, list[tuple[str, str]]] = defaultdict(list)

    def rotation(self, origin: XmlElement) -> Array:
        """``R = Rz(yaw) Ry(pitch) Rx(roll)`` of an ``<origin>``, shape (3, 3).

        Parameters
        ----------
        origin : XmlElement
        """
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
            self._noticed[_CLOSE].append((where, f"{text} (if {meant} is meant, write {_digits(value)})"))
        return count

    def axis(self, direction: Array, stated: XmlElement) -> Array:
        """Unit vector of an ``<axis>``, without components that are rounding errors of single precision, shape (3,).

        Parameters
        ----------
        direction : ndarray, shape (3,)
            Of length 1.
        stated : XmlElement
        """
        noise = np.abs(direction) <= SINGLE
        if not self._snap or not np.any(noise & (direction != 0.0)):
            return direction
        if np.any(np.abs(direction[noise]) > _UNSEEN):
            self._noticed[_TOOK].append((stated.label, f"the axis {stated.attributes['xyz']!r} without its noise"))
        exact = np.where(noise, 0.0, direction)
        return np.asarray(exact / np.linalg.norm(exact))

    def findings(self, labels: Collection[str]) -> Iterator[Finding]:
        """What was taken for another angle, and what may be meant for another.

        Parameters
        ----------
        labels : collection of str
            Joints and links that count, as ``joint 'elbow'``.
        """
        for what, noticed in self._noticed.items():
            told = [(where, angle) for where, angle in noticed if where in labels]
            if told:
                angles = ", ".join(dict.fromkeys(angle for _, angle in told))
                where = _in_short(list(dict.fromkeys(where for where, _ in told)))
                yield Finding("snapped" if what == _TOOK else "suspicious", where, f"{what} {angles}", _ADVICE[what])


def _digits(value: float) -> str:
    return repr(round(value / (math.pi / 2)) * math.pi / 2)


def _in_short(places: list[str]) -> str:
    return places[0] if len(places) == 1 else f"{places[0]} and {len(places) - 1} more"
