"""Rows of a log that make no equations: torques at their limits, and events."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from excite.identification.recipe import ALL, AUTO, Recipe
from excite.information.target import IdentificationTarget
from excite.logs.event import IMPACT, LEFT_OUT, SATURATION, Event
from excite.logs.gaps import LEAST, missing_rows
from excite.logs.impacts import impact_events
from excite.logs.log import Log
from excite.logs.saturation import Saturation, Spans, joined_spans, measured_saturation, spans_of, within
from excite.signals.resampling import resample
from regressors.errors import InputError
from regressors.robot.robot import Robot

MOST = 0.5  # of the rows: a motion whose larger part is missing is no longer the one that was designed


def saturated_stretches(
    log: Log, robot: Robot, target: IdentificationTarget, recipe: Recipe
) -> tuple[tuple[Event, ...], list[str]]:
    """Stretches of a log that are left out, and the notes on them.

    They are those in which the log is known to have had torques at their limits, or, where nothing is known, in which
    a torque is held at the limit of its joint. Rows that are asked for by number, or all of them, are kept. A model of
    another channel than torques is not concerned.
    """
    if target.model.channel != "effort":
        return (), []
    saturated = log.saturated or measured_saturation(log.of(_known(log, robot)), robot)
    spans = spans_of(saturated)
    lost = within(log.time, spans)
    count = int(np.count_nonzero(lost))
    if not count:
        return (), []
    step = float(np.median(np.diff(log.time)))
    torques = _torques(saturated, log)
    rows = f"{count} rows ({count * step:.3g} s) in which {torques}"
    if recipe.rows != AUTO:
        return (), [f"used, since they were asked for: {rows}"]
    if count > MOST * log.count:
        raise InputError(
            f"{log.source}: in {count} of its {log.count} exciting rows {torques}, so too little is left of it; "
            "record a motion of lower torques (design it with `torque_margin`), or, if the recorded torques are those "
            "that acted, use every row (`rows='all'`)"
        )
    return _events(log, spans, torques), [f"{LEFT_OUT} {rows}"]


def _events(log: Log, spans: Spans, torques: str) -> tuple[Event, ...]:
    events = []
    for begin, end in spans:
        inside = log.row_numbers[within(log.time, ((begin, end),))]
        if inside.size:
            events.append(Event(SATURATION, begin, end, (int(inside[0]), int(inside[-1])), torques))
    return tuple(events)


def _known(log: Log, robot: Robot) -> list[str]:
    return [name for name in log.joints if name in robot.joint_names]


def _torques(saturated: tuple[Saturation, ...], log: Log) -> str:
    present = [one.label for one in saturated if np.any(within(log.time, one.spans))]
    if len(present) == 1:
        return f"the torque of {present[0]} was at its limit"
    return f"the torques of {', '.join(present)} were at their limits"


def spans_in_mean(spans: Spans, mean: Log) -> Spans:
    """The stretches of all periods within the mean of them."""
    start, step = float(mean.time[0]), mean.duration / (mean.count - 1)
    period, phases = mean.count * step, mean.time - mean.time[0]
    lost = np.zeros(mean.count, dtype=bool)
    for first, last in spans:
        begin = (first - start) % period
        end = begin + (last - first)
        for shift in (0.0, period):  # what passes the period's end goes on at its beginning
            lost |= (phases + shift >= begin - step / 2) & (phases + shift <= end + step / 2)
    return tuple((float(t) - step / 2, float(t) + step / 2) for t in mean.time[lost])


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
