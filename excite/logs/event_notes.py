"""Notes on the events of a log, one per kind, with the rows."""

from __future__ import annotations

from collections.abc import Sequence

from excite.logs.event import HELD, IMPACT, KINDS, MISSING, SPIKE, Event, row_ranges

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
