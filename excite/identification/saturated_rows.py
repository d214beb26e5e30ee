"""Rows of a log that make no equations: a torque was at its limit, and what was recorded may not be what acted."""

from __future__ import annotations

import numpy as np

from excite.identification.recipe import AUTO, Recipe
from excite.information.target import IdentificationTarget
from excite.logs.event import SATURATION, Event
from excite.logs.event_notes import LEFT_OUT
from excite.logs.log import Log
from excite.logs.saturation import Saturation, Spans, measured_saturation, spans_of, within
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
