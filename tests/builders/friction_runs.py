"""Runs at constant speed, free or of a plan, with friction in one drive, for the tests of friction from logs."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from played import irp6, torques

from excite.friction.constant_speed_windows import FitSettings
from excite.friction.friction_fit import Characteristic, characteristics
from excite.friction.plan_match import PlannedRuns, PlannedWindow
from excite.friction.points import described_model
from excite.logs.log import Log
from regressors.robot.friction.curve import CoulombViscous, FrictionCurve, Stribeck
from regressors.robot.friction.curves import Side
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

TRUTH = Stribeck(Side(20.0, 26.0, 28.0, 0.08, 1.0), Side(17.0, 22.0, 24.0, 0.1, 1.0))
SPEEDS = (0.05, 0.1, 0.15, 0.2, 0.3, 0.45, 0.6, 0.8)
ALONG_Q2 = np.array([0.0, 1.0, -1.0, 0.0, 0.0])  # drive 2 alone: z3 = q2 + q3 rests


def unknown() -> Robot:
    """An IRp-6 whose inertias are not known."""
    return irp6().replace(links=tuple(replace(link, theta=None) for link in irp6().links))


def pieces(parts: list[tuple[float, float]], rate: float = 250.0) -> tuple[Array, Array, Array, Array]:
    """Time, position, velocity and acceleration of stretches of constant acceleration: (seconds, acceleration)."""
    ends = np.cumsum([0.0, *(seconds for seconds, _ in parts)])
    t = np.arange(0.0, ends[-1], 1.0 / rate)
    s, v, at = 0.0, 0.0, np.zeros((t.size, 3))
    for (seconds, a), begin, end in zip(parts, ends[:-1], ends[1:], strict=True):
        rows = (t >= begin) & (t < end)
        x = t[rows] - begin
        at[rows] = np.column_stack([s + v * x + a * x**2 / 2, v + a * x, np.full(x.size, a)])
        s, v = s + v * seconds + a * seconds**2 / 2, v + a * seconds
    return t, *at.T


def there_and_back(
    speeds: tuple[float, ...], path: float = 0.4, acceleration: float = 4.0
) -> list[tuple[float, float]]:
    """Runs over a path at some speeds, back and forth, with rests in between."""
    parts = []
    for speed in speeds:
        ramp, steady = speed / acceleration, max(0.35, path / speed - speed / acceleration)
        for sign in (1.0, -1.0):
            parts += [(ramp, sign * acceleration), (steady, 0.0), (ramp, -sign * acceleration), (0.3, 0.0)]
    return parts


def log_along(
    line: Array, motion: tuple[Array, Array, Array, Array], curve: FrictionCurve, drive: int, noise: float, seed: int
) -> Log:
    """Log of an IRp-6 that moves on a line; torques by Pinocchio and, drive by drive, by hand; counts of encoders.

    The motion is time, position, velocity and acceleration on the line, each of shape (N,).
    """
    t, *derivatives = motion
    q, dq, ddq = (np.outer(x, line) for x in derivatives)
    robot = irp6()
    tau = torques(robot, Samples(t, q, dq, ddq, ddq), 0)
    for k, (motor, row) in enumerate(zip(robot.transmission.drives, robot.transmission.coupling, strict=True)):
        friction = curve.torque(dq @ row) if k == drive else 0.0
        tau += np.outer(motor.ratio.value**2 * motor.rotor_inertia * (ddq @ row) + friction, row)
    tau += np.random.default_rng(seed).normal(0.0, noise, tau.shape)
    step = 2 * np.pi / 4000 / 170
    return Log("run.csv", "", robot.joint_names, t, np.round(q / step) * step, effort=tau)


def run(
    curve: FrictionCurve = TRUTH,
    parts: list[tuple[float, float]] | None = None,
    *,
    along: Array = ALONG_Q2,
    drive: int = 1,
    noise: float = 0.5,
    start: float = -0.2,
    seed: int = 0,
) -> Log:
    """Log of an IRp-6 that runs there and back along a line, with friction in one drive."""
    t, s, v, a = pieces(parts or there_and_back(SPEEDS))
    return log_along(along, (t, s + start, v, a), curve, drive, noise, seed)


CURVE = CoulombViscous(20.0, 26.0, 0.7)
PLANNED_SPEEDS = (0.8, 0.1, 0.4)
HALF = 0.5  # of every run, ramps and all [rad]
RATE = 250.0
LINE = {"z1": [1.0, 0.0, 0.0, 0.0, 0.0], "z2": [0.0, 1.0, -1.0, 0.0, 0.0]}
SETTLED = dict.fromkeys(irp6().joint_names, 0.0)


def course() -> tuple[Array, Array, Array, Array, tuple[PlannedWindow, ...]]:
    """Time, way, velocity, acceleration of runs there and back, ramps of constant acceleration, and the windows."""
    A, parts, windows, at, now = 4.0, [], [], 0.0, 0.0
    for speed in PLANNED_SPEEDS:
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
