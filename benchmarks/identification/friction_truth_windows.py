"""Windows alone: runs on a course made by hand, friction with a smooth sign, windows averaged, a form given."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from friction_truth_case import ENCODER, EXPERIMENTS, FORM, NOISE, RATE, ROBOT, TRUTH, shares, true_values

from excite.friction.constant_speed_windows import WindowSearch, constant_windows
from excite.friction.curve_fit import fit
from excite.friction.points import Point, described_model, drive_log, points_of
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import simulate_motion
from excite.tasks.reference import SampledMotion
from excite.tasks.task import Task
from regressors.robot.friction.curves import FrictionCurves
from regressors.samples import Array, Samples

LINES = {"z1": (1.0, 0.0, 0.0), "z2": (0.0, 1.0, -1.0), "z3": (0.0, 0.0, 1.0)}
WINDOWS = {"z1": 0.5, "z2": 0.3, "z3": 0.3}  # [s]
PERCENT = (5, 10, 20, 30, 40, 50, 60, 70, 80, 90, 100)
PATHS = {"z1": 1.6, "z2": 0.45, "z3": 0.45}  # longest, at constant speed [rad]
RAMP = (lambda x: 10 * x**3 - 15 * x**4 + 6 * x**5)(np.linspace(0.0, 1.0, 300))


def study(drive: str, encoder: bool) -> dict[str, Any]:
    """Share of the experiments in which each parameter is within its interval; bias without noise."""
    motion, windows, taken, effort = runs(drive, encoder)
    truth = true_values(drive)

    def points(noise: Array) -> list[Point]:
        noisy = replace(motion, log=replace(motion.log, effort=effort + noise))
        raw = points_of(noisy, drive, windows, None)
        return [replace(p, torque=p.torque - g) for p, g in zip(raw, taken, strict=True)]

    quiet = [replace(p, deviation=1.0) for p in points(np.zeros_like(effort))]
    bias = fit(quiet, FORM).values - truth
    halves, errors = [], []
    for seed in range(EXPERIMENTS):
        one = fit(points(np.random.default_rng(seed).normal(0.0, NOISE, effort.shape)), FORM)
        errors.append(one.values - truth)
        halves.append(one.halfwidth)
    return {
        "drive": drive,
        "encoder": encoder,
        "experiments": EXPERIMENTS,
        "windows": len(windows),
        "parameters": list(FORM.parameters),
        "truth": truth.tolist(),
        **shares(np.array(errors), np.array(halves), bias),
    }


def runs(drive: str, encoder: bool) -> tuple[Any, Any, Array, Array]:
    """Simulated log without torque noise, its windows, the torque without friction in each, and the torques."""
    line = np.array(LINES[drive])
    limit = float(ROBOT.transmission.limits.velocity[[d.name for d in ROBOT.transmission.drives].index(drive)])
    settings = SimulationSettings(
        rate=RATE,
        torque_limits=False,
        sign_width=0.01,
        encoder=(ENCODER,) if encoder else None,
    )
    reference = SampledMotion(course(limit, WINDOWS[drive], PATHS[drive], line))
    log = simulate_motion(ROBOT, Task("irp6"), reference, settings, friction=FrictionCurves(TRUTH)).log
    motion = drive_log(log, ROBOT)
    k, search = motion.names.index(drive), WindowSearch(WINDOWS[drive], 0.02, 0.02 * limit)
    found = constant_windows(log.time, motion.z[:, k], np.delete(motion.z, k, axis=1), search).windows
    rigid = described_model(motion.robot)
    pairs = zip(
        points_of(motion, drive, found, None), points_of(motion, drive, found, rigid, settling=True), strict=True
    )
    return motion, found, np.array([raw.torque - left.torque for raw, left in pairs]), log.effort


def course(limit: float, window: float, path: float, line: Array) -> Samples:
    """Runs there and back at every speed, smooth ramps of 0.3 s in between."""
    rows, s, step = [], -0.3, 1e-3
    for percent in PERCENT:
        v = limit * percent / 100
        steady = min(4.5 * window, path / v)
        for sign in (1.0, -1.0):
            speeds = np.concatenate([sign * v * RAMP, np.full(round(steady / step), sign * v), sign * v * RAMP[::-1]])
            speeds = np.concatenate([speeds, np.zeros(200)])
            rows.append(speeds)
    dz = np.concatenate([np.zeros(100), *rows])
    z = s + np.concatenate([[0.0], np.cumsum(0.5 * (dz[1:] + dz[:-1]) * step)])
    ddz = np.gradient(dz, step)
    q, dq, ddq = (np.outer(x, line) for x in (z, dz, ddz))
    return Samples(step * np.arange(z.size), q, dq, ddq, np.full_like(q, np.nan))
