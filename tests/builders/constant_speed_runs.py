"""Logs of runs at constant speed along a line, with friction in one drive, for the tests of friction from logs."""

from __future__ import annotations

import numpy as np
from played import irp6, torques

from excite.logs.log import Log
from regressors.friction.curves import FrictionCurve, Side, Stribeck
from regressors.samples import Array, Samples

TRUTH = Stribeck(Side(20.0, 26.0, 28.0, 0.08, 1.0), Side(17.0, 22.0, 24.0, 0.1, 1.0))
SPEEDS = (0.05, 0.1, 0.15, 0.2, 0.3, 0.45, 0.6, 0.8)
ALONG_Q2 = np.array([0.0, 1.0, -1.0, 0.0, 0.0])  # drive 2 alone: z3 = q2 + q3 rests


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
