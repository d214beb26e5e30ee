"""Processor time, peak memory and answers of ``excite identify --repeat 1000`` on logs of 20,000 rows.

``python benchmarks/repetitions/repetitions.py`` runs every case as a command of its own with one BLAS thread, and
records after each. Numbers of cases, such as ``0 3``, measure these alone and keep the other results.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
import record  # noqa: E402

ROWS, RATE, COUNT, SEED = 20_000, 1000.0, 1000, 0
BASE_FREQUENCY, SINES = 0.1, 5
TORQUE_NOISE, POSITION_NOISE = 0.3, 1e-5  # Nm, rad
CPU, MEMORY = 60.0, 1.5  # [s], [GB]
CASES = (
    ("panda", ("--offset",)),
    ("panda", ("--offset", "--signals", "fourier")),
    ("panda", ("--model", "energy")),
    ("irp6", ()),
    ("irp6", ("--model", "energy")),
    ("panda", ("--offset", "--signals", "savitzky-golay")),
    ("panda", ("--offset", "--low-pass", "10")),
    ("panda", ("--offset", "--signals", "spline")),
    ("panda", ("--offset", "--signals", "differences")),
    ("panda", ("--offset", "--no-friction")),
    ("ur10e", ("--offset",)),
)
HEAD = (
    "robot and options",
    "CPU [s]",
    "memory [GB]",
    "wall [s]",
    "load",
    "exit",
    "spread / stated",
    "in 99 % intervals",
)
LIMITATIONS = (
    f"a random sum of {SINES} sines about the middle of the joints' ranges, {ROWS:,} rows at {RATE:g} Hz, white noise "
    f"of {TORQUE_NOISE} Nm and {POSITION_NOISE} rad, true friction and offsets, time stamps uniform",
    "a machine of 2 cores that many processes use at the same time (`load`): processor times differ by a third or more",
    "times and memory are of the whole command, with the identification, which chooses its settings, and figures",
    "no GPU: JAX on one takes part in no number here",
    "exit 1: the command ends, but doubts its result",
)


def write_log(robot_name: str, path: Path) -> None:
    """Write a log of a random motion with noise.

    Parameters
    ----------
    robot_name : str
    path : Path
    """
    from excite.information.target import target_of
    from excite.logs.log import Log
    from excite.logs.log_reading import write_log
    from excite.tasks.task import Task
    from regressors.models.nominal import parameter_values, standard_values
    from regressors.readers.library import load_robot
    from regressors.samples import Samples

    robot, rng = load_robot(robot_name), np.random.default_rng(SEED)
    target = target_of(robot, Task(robot_name, offset=True), 0.0)
    moving = [robot.joint_names.index(name) for name in target.robot.joint_names]
    t, k = np.arange(ROWS) / RATE, len(moving)
    w = 2 * np.pi * BASE_FREQUENCY * np.arange(1, SINES + 1)[:, None]
    amplitude, phase = rng.uniform(0.05, 0.25, (SINES, 1, k)), rng.uniform(0, 2 * np.pi, (SINES, 1, k))
    angle = (w * t)[:, :, None] + phase
    middle = (np.maximum(robot.limits.lower, -np.pi) + np.minimum(robot.limits.upper, np.pi))[moving] / 2
    q = middle + np.sum(amplitude * np.sin(angle), axis=0)
    dq = np.sum(amplitude * w[:, :, None] * np.cos(angle), axis=0)
    ddq = -np.sum(amplitude * w[:, :, None] ** 2 * np.sin(angle), axis=0)
    friction = {f"F{j + 1}{kind}": x for j in moving for kind, x in (("c", 0.5), ("v", 0.3), ("o", 0.1))}
    beta = parameter_values(target.model, target.base, {**standard_values(robot), **friction})
    W = target.model.selected(Samples(t, q, dq, ddq, ddq), target.base.index)
    whole, effort = np.zeros((ROWS, robot.n)), np.zeros((ROWS, robot.n))
    whole[:, moving], effort[:, moving] = q, (W @ beta).reshape(ROWS, k)
    whole += POSITION_NOISE * rng.standard_normal(whole.shape)
    effort += TORQUE_NOISE * rng.standard_normal(whole.shape)
    write_log(Log("random", "", robot.joint_names, t, whole, effort=effort), str(path))


def measured(arguments: list[str], out: Path) -> dict[str, Any]:
    """What one command takes, and the repetitions in its result.

    Parameters
    ----------
    arguments : list of str
        Of ``excite identify``.
    out : Path
    """
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    command = [sys.executable, "-m", "excite", "identify", *arguments, "--force", "--out", str(out)]
    began = time.monotonic()
    process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    code = os.waitstatus_to_exitcode(status)
    if code not in (0, 1):
        raise SystemExit(f"excite identify {' '.join(arguments)} ended with status {code}")
    return {
        "exit": code,
        "cpu": usage.ru_utime + usage.ru_stime,
        "wall": time.monotonic() - began,
        "memory": usage.ru_maxrss * 1024 / 1e9,
        "repetitions": json.loads((out / "result.json").read_text(encoding="utf-8")).get("repetitions"),
    }


def _line(case: dict[str, Any]) -> list[object]:
    parameters = case["repetitions"]["parameters"]
    ratio = [p["deviation"] / p["predicted_deviation"] for p in parameters]
    coverage = [p["coverage"] for p in parameters]
    return [
        f"`{case['case']}`",
        f"{case['cpu']:.0f}" + " (over)" * (case["cpu"] > CPU),
        f"{case['memory']:.2f}" + " (over)" * (case["memory"] > MEMORY),
        f"{case['wall']:.0f}",
        case["load"],
        case["exit"],
        f"{min(ratio):.2f} to {max(ratio):.2f}",
        f"{100 * np.mean(coverage):.1f} %, least {100 * min(coverage):.1f} %",
    ]


def save(found: dict[str, dict[str, Any]], before: float) -> None:
    """Record what was measured so far.

    Parameters
    ----------
    found : dict
        Measurements by the robot and options of their cases.
    before : float
        Load of the machine before the first one.
    """
    cases = [found[name] for case in CASES if (name := _name(case)) in found]
    text = (
        f"`excite identify ROBOT LOG ... --repeat {COUNT}`, {ROWS:,} rows. Limits: {CPU:g} s and {MEMORY:g} GB for the "
        "whole command. The spread of the estimates over their stated deviation, and the share of the 99 % intervals "
        "that hold the truth, of all parameters.\n\n" + record.table(HEAD, [_line(case) for case in cases])
    )
    record.save("repetitions", before, {"cases": cases}, text, LIMITATIONS, HERE)


def _name(case: tuple[str, tuple[str, ...]]) -> str:
    return " ".join([case[0], *case[1]])


def main() -> None:
    """Measure, and record after every case."""
    before, results = record.load(), HERE / "results" / "repetitions.json"
    earlier = json.loads(results.read_text(encoding="utf-8"))["cases"] if results.exists() else []
    found = {case["case"]: case for case in earlier}
    numbers = [int(number) for number in sys.argv[1:]] or range(len(CASES))
    with tempfile.TemporaryDirectory() as folder:
        for robot, options in (CASES[number] for number in numbers):
            if not (log := Path(folder, f"{robot}.csv")).exists():
                write_log(robot, log)
            arguments = [robot, str(log), *options, "--repeat", str(COUNT), "--seed", str(SEED)]
            name, load = _name((robot, options)), record.load()
            found[name] = {"case": name, "load": load, **measured(arguments, Path(folder, "out"))}
            save(found, before)


if __name__ == "__main__":
    main()
