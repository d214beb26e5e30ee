"""The planned experiment: runs and torque ramps of a plan, simulated with friction that sticks, fitted from the logs.

Per experiment the noise of the torques differs; then everything that `excite friction fit` does is done: the plan's
runs are found in the log, its whole windows averaged, gravity subtracted, break-away torques read off the ramps and
taken as points at rest, the forms fitted, and one chosen.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from friction_truth_case import ENCODER, FORM, RATE, ROBOT, TRUTH, noise, shares, true_values

from excite.design.friction_runs.friction_plan import load_friction_plan
from excite.design.friction_runs.plan_friction import plan_friction
from excite.design.friction_runs.schedule import Schedule
from excite.friction.breakaway_torque import mean_break_aways, rest_points
from excite.friction.constant_speed_windows import FitSettings
from excite.friction.curve_fit import CurveFit, fit
from excite.friction.friction_fit import Characteristic, characteristics
from excite.friction.plan_match import PlannedRuns, planned_runs
from excite.friction.points import RigidModel, described_model
from excite.logs.log import Log
from excite.simulation.sensors import joint_log
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import simulate_motion
from excite.simulation.simulation_files import read_source
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.robot import Robot

SCHEDULE = Schedule(longest=1.0, warm_up=0.0, creeping=0.5)
SETTINGS = SimulationSettings(rate=RATE, controller="pd", breakaway="auto")
GIVEN, CHOSEN = FitSettings(model="stribeck", exponent=1.0), FitSettings()
JOINTS = ROBOT.joint_names[:4]  # that are recorded; the fifth never moves
ALL_FORMS = 100  # experiments in which every form is fitted
TRUE_FORM = {"z1": "stribeck (exponent 1)"}  # the same in both directions
ASYMMETRIC = "asymmetric stribeck (exponent 1)"
TOLD = (0.05, 0.15, 0.35, 0.65, 1.0)  # of the largest speed: where what is told of the chosen curve is looked at


@dataclass(frozen=True, eq=False)
class Measured:
    """Logs of a drive's runs and ramps without noise of torques: with exact positions, and as encoders count them."""

    drive: str
    runs: PlannedRuns
    exact: tuple[Log, Log]
    counted: tuple[Log, Log]
    fastest: float

    def logs(self, encoder: bool) -> tuple[Log, Log]:
        return self.counted if encoder else self.exact


def measured(drive: str) -> Measured:
    """What a drive's plan says, written, read, and played."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plan_friction(ROBOT, SCHEDULE, drives=[drive]).save(folder)
        runs = planned_runs(load_friction_plan(folder), "the plan")[drive]
        files = [folder / f"{drive}.csv", folder / f"{drive}.stiction.csv"]
        plays = [read_source(file) for file in files]
    friction, counts = FrictionCurves(TRUTH), replace(SETTINGS, encoder=(ENCODER,))
    found = [
        simulate_motion(play.robot, play.task, play.motion, SETTINGS, friction=friction, ramps=play.ramps)
        for play in plays
    ]
    exact, counted = (
        [
            replace(joint_log(one.robot, one.run, how, np.random.default_rng(0)), source=said).of(JOINTS)
            for one, said in zip(found, ("runs", "ramps"), strict=True)
        ]
        for how in (SETTINGS, counts)
    )
    fastest = max(abs(window.speed) for window in runs.windows)
    return Measured(drive, runs, (exact[0], exact[1]), (counted[0], counted[1]), fastest)


def experiments(of: Measured, encoder: bool, seeds: Sequence[int]) -> list[dict[str, Any]]:
    """What each experiment tells."""
    return [_experiment(of, encoder, seed) for seed in seeds]


def _experiment(of: Measured, encoder: bool, seed: int) -> dict[str, Any]:
    logs = [
        replace(log, effort=log.effort + noise(seed, log.effort.shape, number))
        for number, log in enumerate(of.logs(encoder))
        if log.effort is not None
    ]
    every = encoder and seed < ALL_FORMS
    found = fitted(of, logs, CHOSEN if every else GIVEN)
    given = asymmetric(found)
    told = {
        "values": given.values.tolist(),
        "halves": given.halfwidth.tolist(),
        "scatter": given.scatter,
        "break_aways": [[one.torque, one.interval99] for one in mean_break_aways(found.stiction)],
    }
    if every:
        assert found.fit is not None
        v = of.fastest * np.concatenate([-np.array(TOLD)[::-1], TOLD])
        torque, half = found.fit.band(v)
        told["chosen"] = found.fit.form.name
        told["inside"] = (np.abs(torque - TRUTH[of.drive].torque(v)) <= half).tolist()
    return told


def fitted(of: Measured, logs: Sequence[Log], settings: FitSettings) -> Characteristic:
    """The drive's characteristic, as the command finds it."""
    return characteristics(ROBOT, logs, settings, _rigid, (of.drive,), {of.drive: of.runs})[0]


def asymmetric(found: Characteristic) -> CurveFit:
    """The fit whose form is given."""
    return next(one for one in found.others if one.form.name == ASYMMETRIC)


def _rigid(robot: Robot) -> RigidModel:
    """The described model, made once."""
    if robot.joint_names not in _MODELS:
        _MODELS[robot.joint_names] = described_model(robot)
    return _MODELS[robot.joint_names]


_MODELS: dict[tuple[str, ...], RigidModel] = {}


def summary(of: Measured, encoder: bool, told: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Shares and biases of one drive's experiments."""
    logs = of.logs(encoder)
    truth = true_values(of.drive)
    rest = np.array([truth[2], -truth[6]])
    quiet = fitted(of, logs, FitSettings(model="table"))
    noisy = fitted(of, [replace(log, effort=log.effort + noise(0, log.effort.shape, k)) for k, log in enumerate(logs)],
                   GIVEN)  # fmt: skip
    ramps = [one for one in quiet.stiction if one.log == 1]  # without noise slow starts show break-aways, too
    pairs = zip((*quiet.points, *rest_points(ramps)), (*noisy.points, *noisy.rests), strict=True)
    bias = fit([replace(p, deviation=other.deviation) for p, other in pairs], FORM).values - truth
    errors = np.array([one["values"] for one in told]) - truth
    torque, half = np.moveaxis(np.array([one["break_aways"] for one in told]), 2, 0)
    apart = np.array([one.torque for one in mean_break_aways(ramps)]) - rest
    chosen = [one for one in told if "chosen" in one]
    inside = [100 * float(np.mean(at)) for at in zip(*(one["inside"] for one in chosen), strict=True)]
    forms = [one["chosen"] for one in chosen]
    return {
        "drive": of.drive,
        "encoder": encoder,
        "experiments": len(told),
        "windows": len(quiet.points),
        "durations": [min(p.duration for p in quiet.points), max(p.duration for p in quiet.points)],
        "ramps": len(ramps),
        "parameters": list(FORM.parameters),
        "truth": truth.tolist(),
        **shares(errors, np.array([one["halves"] for one in told]), bias),
        "deviation": errors.std(axis=0, ddof=1).tolist(),
        "mean_error": errors.mean(axis=0).tolist(),
        "scatter": float(np.median([one["scatter"] for one in told])),
        "break_away": {
            "truth": rest.tolist(),
            "mean": torque.mean(axis=0).tolist(),
            "deviation": torque.std(axis=0, ddof=1).tolist(),
            **shares(torque - rest, half, apart),
        },
        "chosen": {name: forms.count(name) for name in sorted(set(forms), key=forms.count, reverse=True)},
        "true_form": TRUE_FORM.get(of.drive, ASYMMETRIC),
        "told_at": [round(100 * x) for x in (*[-y for y in TOLD[::-1]], *TOLD)],
        "inside_band_percent": inside,
    }
