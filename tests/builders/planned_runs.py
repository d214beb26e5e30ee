"""Runs of a friction plan and a log of them, for the tests of friction from logs of plans."""

from __future__ import annotations

from functools import cache

import numpy as np
from constant_speed_runs import log_along, pieces
from played import irp6

from excite.friction.fit.characteristics import Characteristic, characteristics
from excite.friction.fit.fit_settings import FitSettings
from excite.friction.fit.plan_match import PlannedRuns, PlannedWindow
from excite.friction.fit.rigid_torques import described_model
from excite.logs.log import Log
from regressors.friction.curves import CoulombViscous
from regressors.robot.robot import Robot
from regressors.samples import Array

CURVE = CoulombViscous(20.0, 26.0, 0.7)
SPEEDS = (0.8, 0.1, 0.4)
HALF = 0.5  # of every run, ramps and all [rad]
RATE = 250.0
LINE = {"z1": [1.0, 0.0, 0.0, 0.0, 0.0], "z2": [0.0, 1.0, -1.0, 0.0, 0.0]}
SETTLED = dict.fromkeys(irp6().joint_names, 0.0)


def course() -> tuple[Array, Array, Array, Array, tuple[PlannedWindow, ...]]:
    """Time, way, velocity, acceleration of runs there and back, ramps of constant acceleration, and the windows."""
    A, parts, windows, at, now = 4.0, [], [], 0.0, 0.0
    for speed in SPEEDS:
        ramp = speed / A
        steady = (2 * HALF - speed * ramp) / speed
        for sign in (-1.0, 1.0, -1.0):
            way = sign * HALF - at
            if abs(way) < 1.5 * HALF:  # to the beginning of the first run, at one speed for all
                seconds = 2 * np.sqrt(abs(way) / A)
                parts += [(0.3, 0.0), (seconds / 2, np.sign(way) * A), (seconds / 2, -np.sign(way) * A)]
                now += 0.3 + seconds
            else:
                begin = now + 0.3 + ramp
                half = HALF - 0.5 * speed * ramp
                windows.append(PlannedWindow(begin, begin + steady, -sign * half, sign * half))
                parts += [(0.3, 0.0), (ramp, sign * A), (steady, 0.0), (ramp, -sign * A)]
                now += 0.3 + 2 * ramp + steady
            at = sign * HALF
    parts.append((0.4, 0.0))
    return *pieces(parts, RATE), tuple(windows)


def runs(drive: str = "z2", gravity: str = "cancels") -> PlannedRuns:
    return PlannedRuns("plan", drive, SETTLED, dict(zip(SETTLED, LINE[drive], strict=True)), gravity, course()[4])


@cache
def log(drive: str = "z2", noise: float = 0.5) -> Log:
    """Log of the runs."""
    *motion, _ = course()
    return log_along(np.array(LINE[drive]), tuple(motion), CURVE, int(drive[1:]) - 1, noise, seed=4)


def fitted(
    log: Log, planned: PlannedRuns | None = None, robot: Robot | None = None, **settings: object
) -> Characteristic:
    planned = runs() if planned is None else planned
    made = FitSettings(model="coulomb-viscous", **settings)
    (one,) = characteristics(robot or irp6(), [log], made, described_model, None, {planned.drive: planned})
    return one
