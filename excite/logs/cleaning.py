"""A log without the rows that were not measured when their stamps say, and with the times at which the others were."""

from __future__ import annotations

from dataclasses import dataclass

from excite.logs.clock import with_true_time
from excite.logs.event import Event
from excite.logs.held_rows import without_held_rows
from excite.logs.impacts import without_spikes
from excite.logs.log import Log
from regressors.robot.robot import Robot

_FEWEST = 3


@dataclass(frozen=True, eq=False)
class CleanLog:
    """A log that is fit to be differentiated."""

    log: Log  # what was left out is in its `removed`
    events: tuple[Event, ...] = ()  # what was found of the whole log: a rate, an uneven clock


def cleaned(log: Log, robot: Robot) -> CleanLog:
    """Leave out held rows and wrong readings of positions, and rebuild the time where its stamps jitter."""
    if log.count <= _FEWEST:
        return CleanLog(log)
    fresh = without_held_rows(log)
    clocked = with_true_time(fresh.log)
    return CleanLog(without_spikes(clocked.log, robot), (*fresh.events, *clocked.events))
