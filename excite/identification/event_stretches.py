"""Stretches of a log that make no equations, because of what happened while it was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from excite.identification.recipe import ALL, Recipe
from excite.logs.event import Event
from excite.logs.gaps import LEAST
from excite.logs.impacts import impact_events
from excite.logs.log import Log
from excite.logs.missing_rows import missing_rows
from excite.logs.saturation import Spans, joined_spans
from excite.signals.method import FilteredMotion
from regressors.robot.robot import Robot

_SMEAR = 0.25  # of what a filter cuts at each end: half a period of its cutoff
_LEAST_SMEAR = 0.03  # [s]
_SETTLING = 0.1  # [s] in which the controller answers an impact


def stretches_left_out(
    used: Log, uniform: Log, motion: FilteredMotion, events: Sequence[Event], robot: Robot, recipe: Recipe
) -> tuple[Event, ...]:
    """All events of the rows that are used, with the stretches over which filters spread them.

    Where nothing was recorded for longer than 20 ms, and about impacts, what the filter of the positions spreads is
    left out too: half a period of its cutoff on either side. Impacts are kept where all rows are asked for.

    Parameters
    ----------
    used : Log
        The rows that are used.
    uniform : Log
        The same, resampled.
    motion : FilteredMotion
        Its motion.
    events : sequence of Event
        Of the whole log.
    robot : Robot
        With these joints.
    recipe : Recipe
    """
    units = [robot.joints[robot.joint_index(name)].unit for name in used.joints]
    smear = max(_LEAST_SMEAR, _SMEAR * _cut(uniform, motion))
    lost = [_widened(event, smear) if event.seconds > LEAST else event for event in missing_rows(used)]
    hits = () if recipe.average else impact_events(uniform, used, units, smear, max(smear, _SETTLING))
    if recipe.rows == ALL:
        hits = tuple(replace(event, left_out=False) for event in hits)
    return (*events, *lost, *hits)


def _cut(uniform: Log, motion: FilteredMotion) -> float:
    """Seconds that the filter cuts at the start [s]."""
    return float(motion.samples.time[0] - uniform.time[0])


def _widened(event: Event, smear: float) -> Event:
    return replace(event, begin=event.begin - smear, end=event.end + smear)


def spans_left_out(events: Sequence[Event]) -> Spans:
    """Spans of time of the events that make no equations, joined where they overlap [s].

    Parameters
    ----------
    events : sequence of Event
    """
    return joined_spans((event.begin, event.end) for event in events if event.left_out)
