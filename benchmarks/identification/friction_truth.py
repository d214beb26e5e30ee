"""Friction curves from simulated runs of an IRp-6: is the truth within its 99 % interval as often as it should be?

Each of the first three drives runs at 5 % and 10 ... 100 % of its largest speed in both directions [KD96] section 5.2,
under Tustin friction whose stiction is the paper's. The run is simulated once per drive; 500 times noise is put on its
torques, windows are averaged, and the curve is fitted. What the motion does (control error, encoder counts, the width
of friction's sign in the simulation) is the same every time, so it is a bias, and reported as such.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import record

from excite.friction.fits import fit
from excite.friction.forms import Form
from excite.friction.points import Point, drive_log, points_of, windows_of
from excite.friction.rigid import described_model
from excite.friction.windows import Search
from excite.simulate.reference import SampledMotion
from excite.simulate.settings import SimulationSettings
from excite.simulate.simulation import simulate
from excite.task import Task
from regressors.friction import FrictionCurves, Side, Stribeck
from regressors.library import load_robot
from regressors.samples import Array, Samples

HERE = Path(__file__).resolve().parent
ROBOT = load_robot("irp6")
TRUTH = {
    "z1": Stribeck(Side(9.0, 25.0, 14.1, 0.12, 1.0), Side(9.0, 25.0, 14.1, 0.12, 1.0)),
    "z2": Stribeck(Side(11.0, 26.0, 16.8, 0.12, 1.0), Side(7.0, 26.0, 10.6, 0.12, 1.0)),
    "z3": Stribeck(Side(12.0, 26.0, 18.0, 0.12, 1.0), Side(9.4, 26.0, 14.1, 0.12, 1.0)),
}
LINES = {"z1": (1.0, 0.0, 0.0), "z2": (0.0, 1.0, -1.0), "z3": (0.0, 0.0, 1.0)}
WINDOWS = {"z1": 0.5, "z2": 0.3, "z3": 0.3}  # [s]
PERCENT = (5, 10, 20, 30, 40, 50, 60, 70, 80, 90, 100)
PATHS = {"z1": 1.6, "z2": 0.45, "z3": 0.45}  # longest, at constant speed [rad]
RATE, NOISE, EXPERIMENTS, ENCODER = 1000.0, 1.0, 500, 4000.0
FORM = Form("asymmetric Tustin", stribeck=True, asymmetric=True, exponent=1.0)


def main() -> None:
    """Run every drive with exact positions and with encoder counts, and write the results."""
    load_before = record.load()
    found = [study(drive, encoder) for drive in TRUTH for encoder in (False, True)]
    content = {"experiments": EXPERIMENTS, "torque_noise": NOISE, "rate": RATE, "studies": found}
    record.save("friction_truth", load_before, content, text(found), LIMITATIONS, folder=HERE)


def study(drive: str, encoder: bool) -> dict[str, Any]:
    """Share of the experiments in which each parameter is within its interval; bias without noise."""
    motion, windows, taken, effort = runs(drive, encoder)
    truth = np.array([getattr(side, k) for side in (TRUTH[drive].forward, TRUTH[drive].backward) for k in NAMES])

    def points(noise: Array) -> list[Point]:
        noisy = replace(motion, log=replace(motion.log, effort=effort + noise))
        raw = points_of(noisy, drive, windows, None)
        return [replace(p, torque=p.torque - g) for p, g in zip(raw, taken, strict=True)]

    quiet = [replace(p, deviation=1.0) for p in points(np.zeros_like(effort))]
    bias = fit(quiet, FORM).values - truth
    inside, halves, errors = [], [], []
    for seed in range(EXPERIMENTS):
        one = fit(points(np.random.default_rng(seed).normal(0.0, NOISE, effort.shape)), FORM)
        errors.append(one.values - truth)
        halves.append(one.halfwidth)
        inside.append(np.abs(one.values - truth) <= one.halfwidth)
    centred = np.abs(np.array(errors) - bias) <= np.array(halves)
    return {
        "drive": drive,
        "encoder": encoder,
        "windows": len(windows),
        "parameters": list(FORM.parameters),
        "truth": truth.tolist(),
        "bias": bias.tolist(),
        "interval99": np.median(halves, axis=0).tolist(),
        "within_percent": (100 * np.mean(inside, axis=0)).tolist(),
        "within_percent_without_bias": (100 * np.mean(centred, axis=0)).tolist(),
    }


NAMES = ("coulomb", "viscous", "stiction", "stribeck")


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
    friction = FrictionCurves({name: TRUTH[name] for name in TRUTH})
    log = simulate(ROBOT, Task("irp6"), reference, settings, friction=friction).log
    motion = drive_log(log, ROBOT)
    found = windows_of(motion, drive, Search(WINDOWS[drive], 0.02, 0.02 * limit)).windows
    rigid = described_model(motion.robot)
    pairs = zip(points_of(motion, drive, found, None), points_of(motion, drive, found, rigid), strict=True)
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


RAMP = (lambda x: 10 * x**3 - 15 * x**4 + 6 * x**5)(np.linspace(0.0, 1.0, 300))


def text(found: list[dict[str, Any]]) -> str:
    """The table."""
    head = ["drive", "positions", "parameter", "truth", "bias", "99 % interval", "within", "within, bias taken off"]
    rows = [
        [
            one["drive"],
            "encoder" if one["encoder"] else "exact",
            name,
            f"{one['truth'][k]:g}",
            f"{one['bias'][k]:.2g}",
            f"+- {one['interval99'][k]:.2g}",
            f"{one['within_percent'][k]:.1f} %",
            f"{one['within_percent_without_bias'][k]:.1f} %",
        ]
        for one in found
        for k, name in enumerate(one["parameters"])
    ]
    return "\n\n".join(
        [
            f"{EXPERIMENTS} experiments each, torque noise of {NOISE:g} Nm at {RATE:g} Hz; 22 runs per drive "
            f"({', '.join(str(one['windows']) for one in found)} windows).",
            record.table(head, rows),
        ]
    )


LIMITATIONS = (
    "The paper prints stiction only; Coulomb friction below it, viscous friction and the Stribeck speed are assumed.",
    "The form of the curve is given, not chosen; gravity is subtracted with the true parameters.",
    "Noise of the torques is white.",
)


if __name__ == "__main__":
    main()
