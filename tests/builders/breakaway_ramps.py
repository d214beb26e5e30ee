"""Ramps of torque until a drive breaks away, and logs of them, for the tests of break-away torques."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from played import irp6

from excite.friction.breakaway_torque import BreakAway
from excite.friction.plan_match import PlannedRuns, PlannedWindow
from excite.logs.log import Log
from regressors.robot.friction.curve import Stribeck
from regressors.robot.friction.curves import FrictionCurves, Side
from regressors.samples import Array

COUNT = 2 * np.pi / 4000 / 158  # of the motor's encoder, on the drive's side [rad]
INERTIA, VISCOUS, STRIBECK = 8.0, 25.0, 0.12
REST, RAMP, RATE = 0.8, 2.8, 8.4  # s, s, Nm/s
CREEP, STIFFNESS, DAMPING = 2e-3, 7900.0, 500.0  # rad/s, Nm/rad, Nm s/rad

STICKING = FrictionCurves(
    {
        "z1": Stribeck(Side(9.0, 25.0, 14.1, 0.12, 1.0)),
        "z2": Stribeck(Side(11.0, 26.0, 16.8, 0.12, 1.0), Side(7.0, 26.0, 10.6, 0.12, 1.0)),
        "z3": Stribeck(Side(12.0, 26.0, 18.0, 0.12, 1.0), Side(9.4, 26.0, 14.1, 0.12, 1.0)),
    }
)


@cache
def ramps(stiction: float, coulomb: float, distance: float, controlled: bool) -> tuple[Array, Array, Array]:
    """Time, path and torque of a drive that sticks as in Dahl's model: a ramp up, then one down, at 500 Hz.

    Its torque rises by itself and a controller catches it after 2 mrad; or a controller moves slowly.
    """
    step, period = 1e-4, REST + RAMP
    z = v = s = since = 0.0
    caught, rows = True, []
    lead = np.sqrt(distance * INERTIA / stiction)
    for k in range(int((2 * period + 0.6) / step)):
        number, within = divmod(k * step, period)
        way, rising = (1.0 if number == 0 else -1.0), within >= REST and number < 2
        if within < REST:
            caught, since = False, z
        caught = caught or abs(z - since) > 2e-3
        if controlled:
            wanted = CREEP * (max(within - REST, 0.0) if number == 0 else RAMP - max(within - REST, 0.0))
            tau = STIFFNESS * ((wanted if number < 2 else 0.0) - z) + DAMPING * ((way * CREEP if rising else 0.0) - v)
        else:
            tau = way * RATE * (within - REST) if rising and not caught else -STIFFNESS * z - DAMPING * v
        turning = min(max(s + lead * (1 - s * np.sign(v)) * v / distance, -1.0), 1.0)
        friction = (coulomb + (stiction - coulomb) * np.exp(-abs(v) / STRIBECK)) * turning + VISCOUS * v
        v += step * (tau - friction) / INERTIA
        z += step * v
        s = np.sign(v) + (s - np.sign(v)) * np.exp(-abs(step * v) / distance)
        if k % 20 == 0:
            rows.append((k * step, z, tau))
    t, z, tau = np.array(rows).T
    return t, z, tau


def recorded(t: Array, z: Array, tau: Array, noise: float, seed: int = 0) -> Log:
    """Log of the first joint, in counts of its encoder."""
    q, effort = np.zeros((2, t.size, 5))
    q[:, 0] = np.round(z / COUNT) * COUNT
    effort[:, 0] = tau + np.random.default_rng(seed).normal(0.0, noise, t.size)
    return Log("ramps.csv", "", irp6().joint_names, t, q, effort=effort)


def without(log: Log, begin: float, end: float) -> Log:
    """The log with a gap."""
    kept = (log.time < begin) | (log.time > end)
    return replace(log, time=log.time[kept], q=log.q[kept], effort=None if log.effort is None else log.effort[kept])


def away(torque: float, deviation: float = 0.1) -> BreakAway:
    return BreakAway(1 if torque > 0 else -1, torque, deviation, 5.0, 1.0, 0)


STILL = dict.fromkeys(irp6().joint_names, 0.0)


def planned(drive: str, begin: float = 51.0, **more: object) -> PlannedRuns:
    """A plan of one window, without gravity."""
    line, window = {**STILL, f"q{drive[1]}": 1.0}, PlannedWindow(begin, begin + 1.0, -0.5, 0.5)
    return PlannedRuns("plan", drive, STILL, line, "none", (window,), (), **more)  # type: ignore[arg-type]
