"""Drives of a robot that measures torques, identified as servos: gains, and the motion that they make of a design.

``python benchmarks/servo/drives.py [--seeds 0-2]``: each seed is a Panda in MuJoCo with drives of random gains, a
delay, friction and fine encoders, told a design of 40 s at 250 Hz. Its drives are identified from that log three times:
with the masses of its description, with masses that are 20 % too large, and with those that `excite identify` finds
from the log's torques, given the description that is wrong. A second design is simulated before it is played.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import tempfile
import time
from dataclasses import replace
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

os.environ |= {"OPENBLAS_NUM_THREADS": "1"}
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import record
import scipy
from plant import Truth, plant, play

import excite
from excite.export.models.exported_model import model_of_result
from excite.identification.servo_result import ServoResult
from excite.identification.servos import identify_servos
from excite.logs.log import Log
from excite.simulation.servo_motion import criteria_of
from excite.tasks.reference import SampledMotion
from regressors.models.servo_response import QUANTITIES, SYMBOLS, arm_torques
from regressors.robot.robot import Robot
from regressors.samples import Samples

URDF = "cmeel.prefix/share/example-robot-data/robots/panda_description/urdf/panda.urdf"
RATE, ENCODER = 250.0, 2 * np.pi / 2**18
WRONG = 1.2  # masses of the wrong description over the true ones
CUTOFF = 20.0  # of the measured positions [Hz]
UNKNOWN = ("K", "D", "J", "Fc", "b", "d")  # what the plant has


def panda(folder: Path) -> tuple[Path, Robot]:
    """URDF with the gripper held, and the robot that it describes."""
    text = Path(str(distribution("example-robot-data").locate_file(URDF))).read_text()
    (path := folder / "panda.urdf").write_text(re.sub(r"<mimic[^>]*/>", "", text).replace('"prismatic"', '"fixed"'))
    return path, excite.load_robot(str(path), tip="panda_hand")


def random_truth(rng: np.random.Generator, robot: Robot) -> Truth:
    """Drives of 4 to 8 Hz, damped by 0.5 to 0.9 of what is critical, 4 to 20 ms late."""
    n, q = robot.n, rng.uniform(-1.0, 1.0, (200, robot.n))
    J = np.array([0.6, 0.6, 0.5, 0.5, 0.2, 0.2, 0.1]) * np.exp(rng.uniform(-0.3, 0.3, n))
    Fc = np.array([1.0, 1.0, 1.0, 1.0, 0.5, 0.5, 0.5]) * np.exp(rng.uniform(-0.4, 0.4, n))
    inertia, w = np.median(arm_torques(robot)(q, 0 * q, 0 * q)[1], axis=0) + J, 2 * np.pi * rng.uniform(4.0, 8.0, n)
    D = 2.0 * rng.uniform(0.5, 0.9, n) * w * inertia
    return Truth(
        inertia * w**2, D, J, Fc, np.full(n, 1e3), rng.uniform(-2e-3, 2e-3, n), float(rng.uniform(0.004, 0.02))
    )


def measured_criteria(simulation: excite.Simulation, log: Log) -> dict[str, float]:
    """Metrics of a measured motion, through a zero-phase low-pass filter."""
    step = 1.0 / RATE
    q = scipy.signal.filtfilt(*scipy.signal.butter(4, 2.0 * CUTOFF * step), log.q, axis=0)
    dq = np.gradient(q, step, axis=0)
    motion = Samples(log.time, q, dq, np.gradient(dq, step, axis=0), np.full_like(q, np.nan))
    assert simulation.source is not None
    return criteria_of(simulation.source, SampledMotion(motion))


def gains(result: ServoResult, truth: Truth) -> dict[str, Any]:
    """Errors and intervals of what the plant has, shape (n, 6)."""
    true = np.column_stack([truth.K, truth.D, truth.J, truth.Fc, -truth.b, np.full(len(truth.K), truth.d)])
    columns = [SYMBOLS.index(symbol) for symbol in UNKNOWN]
    error, half = result.values[:, columns] - true, result.half_width[:, columns]
    return {"error": (error / np.abs(true)).tolist(), "half_width": (half / np.abs(true)).tolist()}


def run(seed: int, path: Path, robot: Robot) -> dict[str, Any]:
    """Gains by three descriptions, and how far a simulated design is from the played one."""
    rng = np.random.default_rng(seed)
    truth = random_truth(rng, robot)
    arm = plant(path, robot.joint_names, truth)

    def played(period: float, harmonics: int, start: int) -> tuple[excite.Design, Log]:
        design = excite.design_trajectory(
            excite.DifferentialModel(robot),
            excite.Fourier(period=period, harmonics=harmonics),
            search=excite.Search(starts=2, seed=start),
        )
        command = design.trajectory.samples(np.arange(round(period * RATE) + 1) / RATE).q
        return design, play(arm, robot.joint_names, truth, command, f"{seed} {period:g} s", RATE, ENCODER)

    (_, log), (design, other) = played(40.0, 12, seed), played(10.0, 5, seed + 1000)
    wrong = robot.replace(links=tuple(replace(link, theta=WRONG * link.theta) for link in robot.links))
    identified = model_of_result(excite.identify(wrong, log, joint_rotors=True))
    own: dict[str, Any] = {}
    for name, described in (("true", robot), ("wrong", wrong), ("identified", identified.robot)):
        cpu = time.process_time()
        result = identify_servos(described, log)
        own[name] = {**gains(result, truth), "cpu": time.process_time() - cpu}
    simulation = excite.simulate(design, servos=result, rate=RATE)
    assert simulation.tracked is not None
    measured = measured_criteria(simulation, other)
    return {
        "seed": seed,
        "gains": own,
        "lag": np.abs(other.q - design.trajectory.samples(other.time).q).max(axis=0).tolist(),
        "motion_error": np.sqrt(np.mean((simulation.run.samples.q - other.q) ** 2, axis=0)).tolist(),
        "condition": [each["condition_number"] for each in (*simulation.tracked.values(), measured)],
        "log_det": [each["log_det"] for each in (*simulation.tracked.values(), measured)],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="0-2", metavar="FIRST-LAST")
    first, last = map(int, parser.parse_args().seeds.split("-"))
    before = record.load()
    with tempfile.TemporaryDirectory() as folder:
        path, robot = panda(Path(folder))
        runs = [run(seed, path, robot) for seed in range(first, last + 1)]
    names = {q.symbol: q.name for q in QUANTITIES}
    rows = []
    for name in ("true", "wrong", "identified"):
        error, half = (np.array([each["gains"][name][what] for each in runs]) for what in ("error", "half_width"))
        known = np.isfinite(half)
        inside = f"{100 * np.mean((np.abs(error) <= half)[known]):.0f} of {known.sum()}"
        off = (f"{100 * np.median(np.abs(error[..., k])[known[..., k]]):.2g}" for k in range(len(UNKNOWN)))
        rows.append([name, inside, *off])
    head = ["masses", "inside [%]", *(f"{names[symbol]} [%]" for symbol in UNKNOWN)]
    motions = [
        [each["seed"], *(f"{1e3 * max(each[what]):.2g}" for what in ("lag", "motion_error"))]
        + [f"{value:.2f}" for value in each["condition"]]
        for each in runs
    ]
    tracked = ["seed", "lag [mrad]", "simulated less measured, rms [mrad]", "commanded", "simulated", "measured"]
    text = (
        "Intervals of 99 % that hold the truth, and median errors of those that have one:\n\n"
        f"{record.table(head, rows)}\n\nAnother design, simulated with the drives by identified masses, and played: "
        "the largest lag and error among the joints, and condition numbers of the commanded, the simulated and the "
        f"measured motion:\n\n{record.table(tracked, motions)}"
    )
    record.save("servo_drives", before, {"runs": runs}, text, LIMITATIONS)


LIMITATIONS = (
    "A simulated arm, whose drives are position actuators of MuJoCo; a few seeds.",
    "Where the arm hardly loads a joint, as the last of the Panda, only ratios of gains are known, not their scale.",
)


if __name__ == "__main__":
    main()
