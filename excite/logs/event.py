"""Something that happened while a log was recorded, and notes on it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

GARBAGE, HELD, SPIKE, MISSING, DROPPED = "garbage", "held rows", "spike", "missing rows", "dropped rows"
CLOCK, RATE, IMPACT, SATURATION = "clock", "rate", "impact", "saturation"
KINDS = (GARBAGE, HELD, SPIKE, MISSING, DROPPED, CLOCK, RATE, IMPACT, SATURATION)
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
    shown = [f"{a}" if a == b else f"{a} to {b}" for a, b in ranges[:_SHOWN]]
    more = len(ranges) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more else "")


def ranges_of(numbers: Sequence[int]) -> list[tuple[int, int]]:
    """Increasing numbers as ranges of successive ones, first and last of each."""
    ranges: list[tuple[int, int]] = []
    for number in numbers:
        if ranges and number == ranges[-1][1] + 1:
            ranges[-1] = ranges[-1][0], int(number)
        else:
            ranges.append((int(number), int(number)))
    return ranges


LEFT_OUT = "left out:"  # begins the notes on what makes no equations
_WHAT = {
    HELD: "{rows} that repeat the row before under a new time stamp while the robot moves",
    SPIKE: "{rows} in which a position jumps away and back, more than a velocity limit allows",
}


def event_notes(events: Sequence[Event], step: float) -> list[str]:
    """Notes on events, except those noted where they are found (a file that is read, torques at limits)."""
    notes = []
    for kind in KINDS:
        if those := [event for event in events if event.kind == kind]:
            notes += _notes(kind, those, step)
    return notes


def _notes(kind: str, those: Sequence[Event], step: float) -> list[str]:
    where = row_ranges([event.rows for event in those])
    if kind in _WHAT:
        count = sum(last - first + 1 for first, last in (event.rows for event in those))
        rows = f"{count} row{'s' * (count != 1)} ({count * step:.3g} s)"
        return [f"{LEFT_OUT} {_WHAT[kind].format(rows=rows)}: rows {where}"]
    if kind == MISSING:
        seconds = sum(event.seconds for event in those)
        where = where.replace(" to ", " and ")
        return [f"{LEFT_OUT} {seconds:.3g} s about {_counted(those, 'gap')} between rows {where}"]
    if kind == IMPACT:
        return [_impact_note(those, where)]
    return [event.text for event in those if not event.left_out]


def _impact_note(those: Sequence[Event], where: str) -> str:
    seconds = sum(event.seconds for event in those)
    what = f"{seconds:.3g} s about {_counted(those, 'impact')}: rows {where}; {those[0].text}"
    return f"{LEFT_OUT} {what}" if those[0].left_out else f"used, since all rows were asked for: {what}"


def _counted(those: Sequence[Event], what: str) -> str:
    return f"{len(those)} {what}{'s' * (len(those) != 1)}"
