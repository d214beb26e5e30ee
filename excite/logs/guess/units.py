"""Which column says when a row was taken, with the rate and gaps of a recording, and the units of a motion.

Of positions in a unit ``a`` [rad], velocities in a unit ``b`` [rad/s] and times in a unit ``c`` [s], the ratio of the
velocity's numbers to the rate of change of the position's numbers is ``a / (b c)``: what is stated, this ratio, and the
ranges of numbers leave one unit or several.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np

from excite.logs.event import LEAST, STEPS
from excite.logs.log import integrate_rates
from excite.logs.mapping import SECONDS, PositionSection, VelocitySection
from excite.logs.recordings.recording import Contents, Numbers, Recording, StreamContents, is_clock, parsed_name
from excite.logs.table import in_nanoseconds
from regressors.samples import Array

_FEW = 0.01  # of the steps, that may be zero
_ALIKE = 0.01  # of the duration, between two clocks
_FIRST = ("__time", "time", "timestamp", "t")


@dataclass(frozen=True)
class Clock:
    """A clock."""

    column: str
    unit: str  # that the file states; empty if it does not
    why: str  # A sentence, empty where there was nothing to choose
    certain: bool  # whether it is by definition or by name, and not by its numbers alone
    nanoseconds: str = ""  # column of those in its whole seconds, if it has these

    @property
    def title(self) -> str:
        """What it is called in messages."""
        both = f"{self.column} with the nanoseconds of {self.nanoseconds}" if self.nanoseconds else self.column
        return f"{'column ' * self.column.isdigit()}{both}"

    def times(self, columns: Mapping[str, Numbers]) -> Numbers:
        """Its times, in its unit."""
        seconds = columns[self.column]
        return in_nanoseconds(seconds, columns[self.nanoseconds]) if self.nanoseconds else seconds


def clock_candidates(stream: StreamContents) -> tuple[str, ...]:
    """Columns that may be the clock of a stream, the likeliest first; all where no name says so."""
    if stream.clocks:
        return stream.clocks
    named = [name for name in stream.columns if is_clock(stream.title(name), stream.units.get(name, ""))]
    first = {title: k for k, title in enumerate(_FIRST)}
    named.sort(key=lambda name: first.get(stream.title(name).lower(), len(first)))
    return tuple(named) or stream.columns


def chosen_clock(contents: StreamContents, columns: Mapping[str, Numbers]) -> Clock | None:
    """Clock of a stream; None if no column increases.

    The first of its clocks that increases and agrees in duration with the last one that does, such as the stamps in the
    headers of messages with the times at which these were received.
    """
    candidates = [name for name in clock_candidates(contents) if name in columns]
    certain = bool(contents.clocks) or any(is_clock(contents.title(name)) for name in candidates)
    good = [name for name in candidates if _increases(columns[name])]
    if contents.clocks and good:
        seconds = {name: SECONDS.get(contents.units.get(name, ""), 1.0) for name in good}
        last = {name: float(columns[name][-1] - columns[name][0]) * second for name, second in seconds.items()}
        received = last[good[-1]]
        good = [name for name in good if abs(last[name] - received) <= _ALIKE * max(received, np.finfo(float).tiny)]
    if not good:
        pairs = ((a, b) for a, b in pairwise(candidates) if _are_stamps(columns[a], columns[b]))
        return next((Clock(a, "ns", "", True, b) for a, b in pairs), None)
    column, why = good[0], ""
    if not certain:
        why = f"{'column ' * column.isdigit()}{column} is taken for the time, since it increases"
    elif contents.clocks and column != candidates[0]:
        why = f"{candidates[0]} does not increase as {column} does, which is used instead"
    elif contents.clocks and len(candidates) > 1:
        why = f"{column} is used, which increases and agrees with {candidates[1]}"
    unit = contents.units.get(column) or parsed_name(contents.title(column)).unit
    return Clock(column, unit if unit in SECONDS else parsed_name(column, unit).unit, why, certain)


def _increases(values: Numbers) -> bool:
    """Whether a clock runs forwards, but for a few steps that are zero."""  # values (N,)
    there = values[~np.isnan(values)] if values.dtype.kind == "f" else values
    if there.size < 3 or not np.all(np.isfinite(there)):
        return False
    step = np.diff(there)
    return bool(np.all(step >= 0) and np.count_nonzero(step == 0) <= _FEW * step.size)


def _are_stamps(seconds: Numbers, nanoseconds: Numbers) -> bool:
    """Whether two columns are the whole seconds of a time that runs forwards, and the nanoseconds in them."""  # (N,)
    both = np.array([seconds, nanoseconds], dtype=float)
    whole = np.isfinite(both).all() and np.all(both == np.round(both)) and np.all((both[1] >= 0) & (both[1] < 1e9))
    if not whole or both.max() < 1e6:
        return False
    return _increases(in_nanoseconds(both[0] - both[0, 0], both[1]))


@dataclass(frozen=True)
class StreamSummary:
    """Columns of a stream that were sampled at the same instants."""

    stream: str
    columns: tuple[str, ...]
    rows: int
    clock: str = ""  # empty where none was found; then the figures below are zero
    rate: float = 0.0  # mean rate outside the gaps [Hz]
    duration: float = 0.0  # [s]
    gaps: int = 0  # steps longer than 3.5 times the median one and than 20 ms
    longest_gap: float = 0.0  # [s]


def summaries(
    contents: Contents, recording: Recording, clocks: Mapping[str, Clock], unit: str
) -> tuple[StreamSummary, ...]:
    """Summaries of all streams, of those that were read with their rates, one for each set of instants."""
    result: list[StreamSummary] = []
    for stream in contents.streams:
        clock, loaded = clocks.get(stream.name), recording.streams.get(stream.name)
        if clock is None or loaded is None:
            result.append(StreamSummary(stream.name, stream.columns, stream.rows or 0))
            continue
        columns = loaded.columns
        values = clock.times(columns)
        time = (values - values[0]).astype(float) * SECONDS[clock.unit or unit or "s"]
        sets: dict[bytes, list[str]] = {}
        others = columns.keys() - {clock.column, clock.nanoseconds}
        for name in (name for name in stream.columns if name in others):
            sets.setdefault(np.isnan(columns[name]).tobytes(), []).append(name)
        for absent, names in sets.items() or [(bytes(time.size), [])]:
            if not (there := time[~np.frombuffer(absent, bool)]).size:
                continue
            # one clock for all, also for those that were not read
            result.append(_summary(stream.name, tuple(names) if len(sets) > 1 else stream.columns, clock.title, there))
    return tuple(result)


def _summary(stream: str, columns: tuple[str, ...], clock: str, time: Array) -> StreamSummary:
    if time.size < 2:
        return StreamSummary(stream, columns, time.size, clock)
    step = np.diff(time)
    gap = (step > STEPS * np.median(step)) & (step > LEAST)
    long, rest = step[gap], float(step[~gap].sum())
    rate = (step.size - long.size) / rest if rest > 0 else 0.0
    longest = float(long.max()) if long.size else 0.0
    return StreamSummary(stream, columns, time.size, clock, rate, float(time[-1] - time[0]), long.size, longest)


STATED, CERTAIN, LIKELY, UNKNOWN = "stated", "certain", "likely", "unknown"
_TOLERANCE = 0.03  # of a ratio of units
FASTEST, SLOWEST = 5e-5, 1.0  # steps that a recording may have [s]
_EPOCH = (1.0e9, 2.6e9)  # seconds since 1970 of today's clocks
_TURNING = 13.0  # numbers: more than two turns of a joint in rad
_FEWEST_DEGREES = 5.0  # numbers: fewer degrees than any excitation of a robot spans
_STILL = 1e-9
_Fits = Sequence[tuple[str, str, str | None]]  # units of time, positions and velocities that explain the numbers


@dataclass(frozen=True)
class FoundUnit:
    """A unit, and how it is known."""

    unit: str
    level: str  # ``stated``, ``certain``, ``likely`` or ``unknown``
    why: str  # the end of a sentence that begins with what the unit is of


_OF_FILE = "as the file says"


def velocity_ratios(time: Array, q: Array, dq: Array) -> Array:
    """Ratio of velocities to the rate of change of positions, shape (n,); NaN of joints that do not move alike."""
    # time (N,); q, dq (N, n)
    area = integrate_rates(time, dq)
    width = max(1, min(20, time.size // 10))
    moved, integral = q[width:] - q[:-width], area[width:] - area[:-width]
    power, both, square = (np.sum(a * b, axis=0) for a, b in ((moved, moved), (moved, integral), (integral, integral)))
    with np.errstate(invalid="ignore", divide="ignore"):
        alike = both**2 / (power * square)
        return np.where((alike > 0.9) & (power > _STILL), np.sign(both) * np.sqrt(square / power), np.nan)


def time_units(time: Array, stated: str) -> list[str]:
    """Units that times may have: the stated one, else those that make a rate of 1 Hz to 20 kHz and a date of today."""
    # time (N,)
    if stated:
        return [stated]
    step = float(np.median(np.diff(time)))
    dates = [unit for unit, second in SECONDS.items() if _EPOCH[0] <= time[0] * second <= _EPOCH[1]]
    rates = [unit for unit, second in SECONDS.items() if FASTEST <= step * second <= SLOWEST]
    return [unit for unit in dates if unit in rates] or rates


def motion_units(
    time: list[str], position: str, velocity: str | None, ratio: float, q: Array, turning: Array
) -> tuple[FoundUnit, FoundUnit, FoundUnit | None]:
    """Units of time, positions and velocities."""  # q (N, n); turning (n,)
    angles = [position] if position else ["rad", "deg"]
    speeds = [None] if velocity is None else [velocity] if velocity else ["rad/s", "deg/s", "rpm"]
    measured = velocity is not None and bool(np.isfinite(ratio))
    fits = [fit for fit in product(time, angles, speeds) if not measured or _explains(ratio, *fit)]
    if not fits:
        per_second = ratio * SECONDS[time[0]]
        why = f"the velocities are {per_second:.4g} times the rate of change of the positions, which no units explain"
        units = (time[0], position or "rad", velocity or "rad/s")
        clock, angle, speed = (FoundUnit(unit, UNKNOWN, why) for unit in units)
        return clock, angle, speed
    if position:
        angle = FoundUnit(position, STATED, _OF_FILE)
    elif len({a for _, a, _ in fits}) > 1:
        by_range = _by_range(q, turning)
        angle = replace(by_range, unit=by_range.unit or "rad")
    else:
        why = f"velocities are {ratio:.4g} times the rate of change of the numbers"
        angle = FoundUnit(fits[0][1], CERTAIN, why)
    same = [fit for fit in fits if fit[1] == angle.unit]
    clock = _time_unit(time, same, measured=measured)
    return clock, angle, None if velocity is None else _speed(velocity, same, angle, measured=measured)


def _explains(ratio: float, time: str, angle: str, speed: str | None) -> bool:
    a, b, c = PositionSection.units.get(angle), VelocitySection.units.get(speed or ""), SECONDS[time]
    return a is not None and b is not None and abs(ratio * b * c / a - 1) < _TOLERANCE


def _time_unit(candidates: list[str], fits: _Fits, *, measured: bool) -> FoundUnit:
    units = sorted({fit[0] for fit in fits}, key=list(SECONDS).index)
    if len(units) > 1:
        return FoundUnit(units[0], LIKELY, f"though the rate allows {' and '.join(units)}")
    if len(candidates) == 1:
        return FoundUnit(units[0], CERTAIN, "the only unit that makes a rate of 1 Hz to 20 kHz")
    return FoundUnit(units[0], CERTAIN if measured else LIKELY, "by the rate, and by positions and velocities")


def _speed(stated: str, fits: _Fits, angle: FoundUnit, *, measured: bool) -> FoundUnit:
    unit = str(fits[0][2])
    if stated:
        return FoundUnit(stated, STATED, _OF_FILE)
    if not measured:
        return FoundUnit(f"{angle.unit}/s", LIKELY, "as the positions; no motion shows it")
    certain = unit != "rpm" and angle.level in (STATED, CERTAIN)
    why = "by their ratio to the rate of change of the positions"
    return FoundUnit(unit, CERTAIN if certain else LIKELY, why)


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
    if largest < _FEWEST_DEGREES and size < _TURNING:
        return FoundUnit("rad", LIKELY, f"they span up to {largest:.4g}, in degrees hardly a motion")
    return FoundUnit("", UNKNOWN, f"they span up to {largest:.4g}, which may be rad or deg")
