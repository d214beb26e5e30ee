"""Stretches of a log that make no equations, because of what happened while it was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from excite.identification.recipe import ALL, Recipe
from excite.logs.event import IMPACT, Event
from excite.logs.gaps import LEAST
from excite.logs.impacts import impact_events
from excite.logs.log import Log
from excite.logs.missing_rows import missing_rows
from excite.logs.saturation import Spans, joined_spans, within
from excite.signals.resampling import resample
from regressors.robot.robot import Robot

_SMEAR = 0.25  # of what a filter cuts at each end: half a period of its cutoff
_LEAST_SMEAR = 0.03  # [s]


def without_impacts(used: Log, robot: Robot, recipe: Recipe) -> tuple[Log, tuple[Event, ...]]:
    """The log without the rows about impacts, which would spread over the filtered motion, and these impacts.

    Where all rows are asked for, the rows stay.
    """
    units = [robot.joints[robot.joint_index(name)].unit for name in used.joints]
    hits = impact_events(resample(used).log, used, units)
    if recipe.rows == ALL:
        return used, tuple(replace(event, left_out=False) for event in hits)
    about = within(used.time, tuple((event.begin, event.end) for event in hits))
    return (used.without(IMPACT, about) if hits else used), hits


def stretches_left_out(smooth: Log, cut: float, hits: Sequence[Event]) -> tuple[Event, ...]:
    """Where rows are missing, and impacts, with the stretches over which filters spread them.

    Where there are no rows for longer than 20 ms, what the filter of the positions makes of it is left out too: half a
    period of its cutoff on either side.
    """
    smear = max(_LEAST_SMEAR, _SMEAR * cut)
    lost = [event for event in missing_rows(smooth) if event.kind != IMPACT]
    spread = [_widened(event, smear) if event.left_out and event.seconds > LEAST else event for event in (*lost, *hits)]
    return tuple(spread)


def _widened(event: Event, smear: float) -> Event:
    return replace(event, begin=event.begin - smear, end=event.end + smear)


def spans_left_out(events: Sequence[Event]) -> Spans:
    """Spans of time of the events that make no equations, joined where they overlap [s]."""
    return joined_spans((event.begin, event.end) for event in events if event.left_out)
