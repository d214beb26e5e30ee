"""Something that happened while a log was recorded, and that its equations should not be made of."""

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
