"""Units of positions, velocities and time, from what is stated, from their consistency, and from their ranges.

Of positions in a unit ``a`` [rad], velocities in a unit ``b`` [rad/s] and times in a unit ``c`` [s], the ratio of the
velocity's numbers to the rate of change of the position's numbers is ``a / (b c)``.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from excite.logs.mapping import SECONDS
from excite.logs.mapping_sections import PositionSection, VelocitySection
from regressors.samples import Array

STATED, CERTAIN, LIKELY, UNKNOWN = "stated", "certain", "likely", "unknown"
_TOLERANCE = 0.03  # of a ratio of units
_FASTEST, _SLOWEST = 5e-5, 1.0  # steps that a recording may have [s]
_EPOCH = (1.0e9, 2.6e9)  # seconds since 1970 of today's clocks
_TURNING = 13.0  # numbers: more than two turns of a joint in rad
_FEW = 5.0  # numbers: fewer degrees than any excitation of a robot spans
_STILL = 1e-9


@dataclass(frozen=True)
class FoundUnit:
    """A unit, and how it is known."""

    unit: str
    level: str  # ``stated``, ``certain``, ``likely`` or ``unknown``
    why: str  # the end of a sentence that begins with what the unit is of


@dataclass(frozen=True)
class Consistency:
    """How velocities agree with the rate of change of positions."""

    ratio: float  # of their numbers, in the median over the joints that move; NaN if none does
    ratios: Array  # (n,) of each joint; NaN where it does not move


def consistency(time: Array, q: Array, dq: Array) -> Consistency:
    """Ratio of velocities to the rate of change of positions, by their integrals over short windows."""
    # time (N,); q, dq (N, n)
    step = np.diff(time)
    area = np.vstack([np.zeros(q.shape[1]), np.cumsum(0.5 * (dq[1:] + dq[:-1]) * step[:, None], axis=0)])
    width = max(1, min(20, time.size // 10))
    moved, integral = q[width:] - q[:-width], area[width:] - area[:-width]
    power = np.sum(moved**2, axis=0)
    both = np.sum(moved * integral, axis=0)
    square = np.sum(integral**2, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        alike = both**2 / (power * square)
        ratios = np.where((alike > 0.9) & (power > _STILL), np.sign(both) * np.sqrt(square / power), np.nan)
    there = ratios[np.isfinite(ratios)]
    return Consistency(float(np.median(np.abs(there))) if there.size else float("nan"), ratios)


def time_unit(time: Array, stated: str) -> list[str]:
    """Units that times may have: the stated one, else those that make a rate of 1 Hz to 20 kHz and a date of today."""
    # time (N,)
    if stated:
        return [stated]
    step = float(np.median(np.diff(time)))
    dates = [unit for unit, second in SECONDS.items() if _EPOCH[0] <= time[0] * second <= _EPOCH[1]]
    rates = [unit for unit, second in SECONDS.items() if _FASTEST <= step * second <= _SLOWEST]
    return [unit for unit in dates if unit in rates] or rates


def motion_units(
    time: list[str], position: str, velocity: str | None, ratio: float, q: Array, turning: Array
) -> tuple[FoundUnit, FoundUnit, FoundUnit | None]:
    """Units of time, positions and velocities."""  # q (N, n); turning (n,)
    angles = [position] if position else ["rad", "deg"]
    speeds = [None] if velocity is None else [velocity] if velocity else ["rad/s", "deg/s", "rpm"]
    fits = [
        (t, a, s)
        for t, a, s in product(time, angles, speeds)
        if s is None or not np.isfinite(ratio) or _explains(ratio, t, a, s)
    ]
    measured = velocity is not None and bool(np.isfinite(ratio))
    if not fits:
        return _contradicted(time, position, velocity, ratio)
    by_range = _by_range(q, turning)
    if not position and len({a for _, a, _ in fits}) > 1:
        wanted = by_range.unit or "rad"
        fits = [fit for fit in fits if fit[1] == wanted] or fits
        angle = FoundUnit(fits[0][1], by_range.level, by_range.why)
    else:
        why = f"velocities are {ratio:.4g} times the rate of change of the numbers" if measured else ""
        angle = _settled(position, fits[0][1], why)
    if not position and not measured:
        angle = FoundUnit(by_range.unit or "rad", by_range.level, by_range.why)
    same = [fit for fit in fits if fit[1] == angle.unit] or fits
    clock = _clock(time, same, measured=measured)
    speed = None if velocity is None else _speed(velocity, same, angle, measured=measured)
    return clock, angle, speed


def _explains(ratio: float, time: str, angle: str, speed: str) -> bool:
    a, b, c = PositionSection.units.get(angle), VelocitySection.units.get(speed), SECONDS[time]
    return a is not None and b is not None and abs(ratio * b * c / a - 1) < _TOLERANCE


def _settled(stated: str, unit: str, why: str) -> FoundUnit:
    return FoundUnit(stated, STATED, "as the file says") if stated else FoundUnit(unit, CERTAIN, why)


def _clock(candidates: list[str], fits: list[tuple[str, str, str | None]], *, measured: bool) -> FoundUnit:
    units = sorted({fit[0] for fit in fits}, key=list(SECONDS).index)
    if len(units) > 1:
        return FoundUnit(units[0], LIKELY, f"though the rate allows {' and '.join(units)}")
    if len(candidates) == 1:
        return FoundUnit(units[0], CERTAIN, "the only unit that makes a rate of 1 Hz to 20 kHz")
    return FoundUnit(units[0], CERTAIN if measured else LIKELY, "by the rate, and by positions and velocities")


def _speed(stated: str, fits: list[tuple[str, str, str | None]], angle: FoundUnit, *, measured: bool) -> FoundUnit:
    unit = str(fits[0][2])
    if stated:
        return FoundUnit(stated, STATED, "as the file says")
    if not measured:
        return FoundUnit(f"{angle.unit}/s", LIKELY, "as the positions; no motion shows it")
    if unit == "rpm":
        return FoundUnit(unit, LIKELY, "by their ratio to the rate of change of the positions")
    level = CERTAIN if angle.level in (STATED, CERTAIN) else LIKELY
    return FoundUnit(unit, level, "by their ratio to the rate of change of the positions")


def _contradicted(
    time: list[str], position: str, velocity: str | None, ratio: float
) -> tuple[FoundUnit, FoundUnit, FoundUnit | None]:
    second = SECONDS[time[0]] if time else 1.0
    why = f"the velocities are {ratio * second:.4g} times the rate of change of the positions, which no units explain"
    angle, unit = position or "rad", time[0] if time else "s"
    return FoundUnit(unit, UNKNOWN, why), FoundUnit(angle, UNKNOWN, why), FoundUnit(velocity or "rad/s", UNKNOWN, why)


def _by_range(q: Array, turning: Array) -> FoundUnit:
    """Unit of angles by their reach: a joint in rad does not turn twice, and one in deg moves by more than 5 deg."""
    span = np.ptp(q, axis=0)
    largest, size = float(span.max()), float(np.abs(q).max())
    if np.any(span > 1.05 * turning):
        joint = int(np.argmax(span / turning))
        why = f"one joint spans {span[joint]:.4g}, more than the {turning[joint]:.3g} rad that the robot can move"
        return FoundUnit("deg", LIKELY, why)
    if largest > _TURNING:
        return FoundUnit("deg", LIKELY, f"they span up to {largest:.4g}, in rad more than two turns")
    if largest < _FEW and size < _TURNING:
        return FoundUnit("rad", LIKELY, f"they span up to {largest:.4g}, in degrees hardly a motion")
    return FoundUnit("", UNKNOWN, f"they span up to {largest:.4g}, which may be rad or deg")
