"""What happened while a log was recorded: events and notes on them, gaps and lost rows, torques at their limits."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from excite.logs.excitation import moves, quantum, runs
from excite.logs.log import Log, counted
from excite.storage.codec import named
from regressors.errors import InputError, listed_names
from regressors.robot.robot import Robot
from regressors.samples import Array

GARBAGE, HELD, SPIKE, MISSING, DROPPED = "garbage", "held rows", "spike", "missing rows", "dropped rows"
CLOCK, RATE, IMPACT, SATURATION, FORCE = "clock", "rate", "impact", "saturation", "external force"
KINDS = (GARBAGE, HELD, SPIKE, MISSING, DROPPED, CLOCK, RATE, IMPACT, SATURATION, FORCE)
_SHOWN = 5


@dataclass(frozen=True)
class Event:
    """One event of a log."""

    beside: ClassVar[Mapping[str, Callable[[Any], Any]]] = {
        "from": lambda event: event.begin,
        "to": lambda event: event.end,
        "seconds": lambda event: event.seconds,
    }

    kind: str  # one of `KINDS`
    begin: float  # first and last instant that it concerns [s]
    end: float
    rows: tuple[int, int]  # first and last row of what was recorded that it concerns, 1 for the first
    text: str  # what happened, such as ``joint q2 changed its velocity by 0.3 rad/s``
    left_out: bool = True  # whether its instants make no equations

    @property
    def seconds(self) -> float:
        """How long it lasts [s]."""
        return self.end - self.begin


def row_ranges(ranges: Sequence[tuple[int, int]]) -> str:
    """Ranges of rows in words, the last of many left out, such as ``4, 7 to 9 and 3 more``."""
    return listed_names((f"{a}" if a == b else f"{a} to {b}" for a, b in ranges), _SHOWN)


def ranges_of(numbers: Sequence[int]) -> list[tuple[int, int]]:
    """Increasing numbers as ranges of successive ones, first and last of each."""
    parts = np.split(np.asarray(numbers, dtype=int), np.flatnonzero(np.diff(numbers) != 1) + 1)
    return [(int(part[0]), int(part[-1])) for part in parts if part.size]


LEFT_OUT = "left out:"  # begins the notes on what makes no equations
_WHAT = {
    HELD: "{rows} that repeat the row before under a new time stamp while the robot moves",
    SPIKE: "{rows} in which a position jumps away and back, more than a velocity limit allows",
    FORCE: "{rows} whose torques no parameters explain, as where something else pushes the robot",
}


def event_notes(events: Sequence[Event], step: float) -> list[str]:
    """Notes on events, except those noted where they are found (a file that is read, torques at limits)."""
    grouped = ((kind, [event for event in events if event.kind == kind]) for kind in KINDS)
    return [note for kind, those in grouped if those for note in _notes(kind, those, step)]


def _notes(kind: str, those: Sequence[Event], step: float) -> list[str]:
    where, seconds = row_ranges([event.rows for event in those]), sum(event.seconds for event in those)
    if kind in _WHAT:
        count = sum(last - first + 1 for first, last in (event.rows for event in those))
        rows = f"{counted(count, 'row')} ({count * step:.3g} s)"
        return [f"{LEFT_OUT} {_WHAT[kind].format(rows=rows)}: rows {where}"]
    if kind == MISSING:
        where = where.replace(" to ", " and ")
        return [f"{LEFT_OUT} {seconds:.3g} s about {counted(len(those), 'gap')} between rows {where}"]
    if kind == IMPACT:
        how = LEFT_OUT if those[0].left_out else "used, since all rows were asked for:"
        return [f"{how} {seconds:.3g} s about {counted(len(those), 'impact')}: rows {where}; {those[0].text}"]
    return [event.text for event in those if not event.left_out]


STEPS = 3.5  # three samples missing or more
LEAST = 0.02  # [s]; less is bridged well by interpolation
SHORTEST = 1.0
LONGEST = 1.0  # [s]; what is left out of a motion, but does not end it


@dataclass(frozen=True)
class Gap:
    """A time step that is too long."""

    row: int  # row after which it is, 0 for the first
    number: int  # its number in what was recorded
    time: float  # where it begins, and how long it is [s]
    length: float

    def __str__(self) -> str:
        return f"{self.length:.3g} s after t = {self.time:.6g} s (row {self.number})"


def gaps(log: Log) -> tuple[Gap, ...]:
    """Time steps longer than 3.5 times the median one and than 20 ms."""
    step = np.diff(log.time)
    if not step.size:
        return ()
    long = np.flatnonzero((step > STEPS * np.median(step)) & (step > LEAST))
    return tuple(Gap(int(k), int(log.row_numbers[k]), float(log.time[k]), float(step[k])) for k in long)


def segments(log: Log, shortest: float = SHORTEST) -> tuple[Log, ...]:
    """Parts of a log between its gaps."""
    if not (intervals := gaps(log)):
        return (log,)
    ends = [0, *(gap.row + 1 for gap in intervals), log.count]
    parts = [log.rows(slice(a, b)) for a, b in pairwise(ends)]
    kept = [part for part in parts if part.count > 1 and part.duration >= shortest]
    if not kept:
        raise InputError(
            f"{log.source}: gaps leave no part of {shortest:g} s or more: {'; '.join(map(str, intervals))}"
        )
    lost = log.count - sum(part.count for part in kept)
    note = (f"{lost} rows in parts shorter than {shortest:g} s between gaps",) * bool(lost)
    return tuple(replace(part, left_out=(*log.left_out, *note)) for part in kept)


_TEXT = {
    MISSING: "{ms} without a row",
    GARBAGE: "lines that hold no row of numbers",
    DROPPED: "rows dropped as asked",
    HELD: "rows that repeat the row before",
    SPIKE: "a wrong reading of a position",
    IMPACT: "rows about an impact",
}
_TWO = 1.75  # steps: a row is missing
_EVEN, _MOSTLY = 0.25, 0.9  # most steps are within a quarter of the median one, if time is regular
_INSIDE = 0.01  # of a step: an instant so near a row is measured


def missing_rows(log: Log) -> tuple[Event, ...]:
    """Where rows are missing: numbers of rows that jump, and time steps of 1.75 times the median one or more.

    Where time steps are irregular, only those longer than 3.5 times the median one count.
    """
    if log.count < 3:
        return ()
    step, jump = np.diff(log.time), np.diff(log.row_numbers)
    usual = float(np.median(step / jump))
    regular = np.mean(np.abs(step / jump - usual) < _EVEN * usual) >= _MOSTLY
    long = (jump > 1) | (step > (_TWO if regular else max(STEPS, LEAST / usual)) * usual)
    kinds = {int(number): part.kind for part in log.removed for number in part.numbers}
    events = []
    for k in np.flatnonzero(long):
        first, last = int(log.row_numbers[k]), int(log.row_numbers[k + 1])
        kind = kinds.get(first + 1, MISSING)
        if kind == RATE:
            continue
        rows = (first + 1, last - 1) if last > first + 1 else (first, last)
        begin, end = float(log.time[k]) + _INSIDE * usual, float(log.time[k + 1]) - _INSIDE * usual
        events.append(Event(kind, begin, end, rows, _TEXT[kind].format(ms=f"{1e3 * step[k]:.3g} ms")))
    return tuple(events)


def events_in(log: Log, kind: str, spans: Spans, text: str) -> Iterator[Event]:
    """An event in each span that has rows of a log."""
    for begin, end in spans:
        about = log.row_numbers[within(log.time, ((begin, end),))]
        if about.size:
            yield Event(kind, begin, end, (int(about[0]), int(about[-1])), text)


Spans = tuple[tuple[float, float], ...]  # first and last instant of each [s]
_HELD = 5  # samples at an extreme
_AT_LIMIT = 0.999  # of the limit: rounding, and the tolerance of a drive's own limiter


@dataclass(frozen=True)
class Saturation:
    """One limited torque, and when it was at its limit."""

    label: str = field(metadata=named("torque"))  # such as ``joint q2`` or ``drive z2``
    limit: float  # [unit]
    unit: str
    rows: int  # number of samples at the limit
    spans: Spans = field(repr=False)  # first and last instant of each stretch of them [s]


def saturation_of(label: str, limit: float, unit: str, time: Array, at_limit: NDArray[np.bool_]) -> Saturation:
    """Saturation at flagged instants."""  # time (N,); at_limit (N,)
    spans = tuple((float(time[a]), float(time[b - 1])) for a, b in runs(at_limit))
    return Saturation(label, float(limit), unit, int(np.count_nonzero(at_limit)), spans)


def within(time: Array, spans: Spans, begin: Array | None = None) -> NDArray[np.bool_]:
    """Which instants lie in one of the spans, or which time windows meet one."""  # time (N,); begin (N,)
    if not spans:
        return np.zeros(time.size, dtype=bool)
    first, last = np.array(joined_spans(spans)).T
    begun = np.searchsorted(first, time, side="right")  # spans that have begun by then
    start = time if begin is None else begin
    return np.asarray((begun > 0) & (start <= last[np.maximum(begun - 1, 0)]))


def measured_saturation(log: Log, robot: Robot) -> tuple[Saturation, ...]:
    """Torques of a log that are held at the limits of their joints.

    A torque counts where it keeps its extreme value for five samples or more while the robot moves, has come there at
    speed, and that value is 0.999 of the joint's limit or more. Extremes below are never taken for the limit, whatever
    they look like, and with noise on the torque no value is kept.
    """
    if log.effort is None:
        return ()
    saturated = []
    moving = np.any(moves(log), axis=1)
    for k, name in enumerate(log.joints):
        j = robot.joint_index(name)
        limit, tau = float(robot.limits.torque[j]), log.effort[:, k]
        at_limit = np.zeros(tau.size, dtype=bool)
        for extreme in (tau.min(), tau.max()):
            if abs(extreme) >= _AT_LIMIT * limit:
                for a, b in plateaus(tau, extreme, moving):
                    at_limit[a:b] = True
        if at_limit.any():
            unit = "Nm" if robot.joints[j].kind == "revolute" else "N"
            saturated.append(saturation_of(f"joint {name}", limit, unit, log.time, at_limit))
    return tuple(saturated)


def plateaus(tau: Array, extreme: float, moving: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """First row, and row after, of each stretch in which a torque keeps an extreme that it reached at speed."""
    # tau (N,); moving (N,)
    least = 4 * float(quantum(tau[:, None])[0])
    for a, b in runs((tau == extreme) & moving):
        beside = [tau[k] for k in (a - 2, b + 1) if 0 <= k < tau.size]  # away by more than rounding, if at speed
        if b - a >= _HELD and any(abs(value - tau[a]) > least for value in beside):
            yield a, b


def spans_of(saturated: Sequence[Saturation]) -> Spans:
    """Spans of several torques together, joined where they overlap."""
    return joined_spans(span for one in saturated for span in one.spans)


def joined_spans(spans: Iterable[tuple[float, float]]) -> Spans:
    """Spans in the order of time, joined where they overlap."""
    joined: list[tuple[float, float]] = []
    for first, last in sorted(spans):
        if joined and first <= joined[-1][1]:
            joined[-1] = joined[-1][0], max(last, joined[-1][1])
        else:
            joined.append((first, last))
    return tuple(joined)
