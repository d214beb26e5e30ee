"""Memory that a friction plan takes, predicted before poses are looked for."""

from __future__ import annotations

import math

from excite.estimates.work_prediction import FLOAT, MemoryPart, WorkPrediction
from excite.friction.plan.schedule import Schedule
from regressors.robot.robot import Robot

_OF_ANY, _OF_JOINT = 10.0, 7.0  # numbers of each sample, and of each of its joints
_RUN = 6000.0  # bytes of a run, there or back
_RAMPS = 0.5  # seconds of speeding up and braking in a run


def plan_prediction(robot: Robot, schedule: Schedule, coordinates: int) -> WorkPrediction:
    """Memory of the runs of all coordinates and of the samples of one; the factors are measured."""
    window = math.sqrt(schedule.shortest * min(schedule.longest, 10.0 * schedule.shortest))
    run = window + _RAMPS
    runs = 2.0 * schedule.repeats * len(schedule.percent)
    tests = 2.0 * schedule.breakaways
    seconds = {
        "warm_up": schedule.warm_up,
        "repeats": runs * (run + schedule.pause) + runs / 2.0 * run,
        "creeping": tests * schedule.creeping,
        "pause": (runs + tests) * schedule.pause,
        "ramping": tests * schedule.ramping,
    }
    samples = schedule.rate * sum(seconds.values())
    numbers = _OF_ANY + _OF_JOINT * robot.n
    option = max(seconds, key=lambda name: seconds[name])
    if schedule.rate / 500.0 > seconds[option] / 100.0:
        option = "rate"
    count = schedule.warm_up / run + 1.5 * runs + tests
    held = FLOAT * samples * numbers + coordinates * count * _RUN
    return WorkPrediction(
        "the plan", (MemoryPart("samples", samples, 1 + 3 * robot.n, held, option, getattr(schedule, option)),)
    )
