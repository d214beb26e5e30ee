"""Processor time and memory of the largest tasks: logs of up to 2 million rows, and 1000 repetitions of 20,000.

``python benchmarks/scale/scale.py`` measures each in a process of its own with one BLAS thread, and writes
``results.json`` and ``results.md`` beside this file. Names of tasks, such as ``memory``, measure these alone and keep
the other results.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent
ROBOT, SEED = "ur10e", 0
LONG, LONG_RATE = 2_000_000, 1000.0
SHORT, SHORT_RATE, REPETITIONS = 20_000, 2000.0, 1000
TORQUE_NOISE, POSITION_NOISE = 0.3, 1e-5  # Nm, rad
LIMITS = {  # CPU [s], memory [GB]; 0.3 GB and 100 bytes for each row and equation
    "memory": (60.0, 2.0),
    "command": (60.0, 2.0),
    "repetitions": (60.0, 1.5),
    "100,000": (60.0, 0.36),
    "1,000,000": (60.0, 0.9),
}
LIMITATIONS = (
    f"robot {ROBOT}, base parameters with friction and offsets, a random sum of sines; white noise of "
    f"{TORQUE_NOISE} Nm and {POSITION_NOISE} rad, time stamps uniform, no faulty rows: irregular stamps are resampled, "
    "which takes more",
    "a machine of 2 cores that others use at the same time, so that processor times differ by some",
    "exit status 1: the command ends, but doubts its result, here by a mass matrix that 10 s of a random motion leave "
    "uncertain",
)
LOGS = {
    "memory": ("long.npz", LONG, LONG_RATE),
    "command": ("long.csv", LONG, LONG_RATE),
    "repetitions": ("short.csv", SHORT, SHORT_RATE),
    "100,000": ("plain.csv", 100_000, LONG_RATE),
    "1,000,000": ("plain.csv", 1_000_000, LONG_RATE),
}
_BLOCK = 8192


def random_log(rows: int, rate: float) -> Any:
    """Log of a random sum of sines over half of the joints' ranges, with noise.

    Parameters
    ----------
    rows : int
    rate : float
        [Hz]
    """
    from excite.information.target import target_of
    from excite.logs.log import Log
    from excite.tasks.task import Task
    from regressors.models.nominal import parameter_values, standard_values
    from regressors.readers.library import load_robot
    from regressors.samples import Samples

    robot, rng = load_robot(ROBOT), np.random.default_rng(SEED)
    t, n = np.arange(rows) / rate, robot.n
    amplitude, phase = rng.uniform(0.05, 0.25, (5, n)), rng.uniform(0, 2 * np.pi, (5, n))
    q, dq, ddq = (np.zeros((rows, n)) for _ in range(3))
    for k, w in enumerate(2 * np.pi * 0.1 * np.arange(1, 6)):
        for j in range(n):
            angle = w * t + phase[k, j]
            q[:, j] += amplitude[k, j] * np.sin(angle)
            dq[:, j] += amplitude[k, j] * w * np.cos(angle)
            ddq[:, j] -= amplitude[k, j] * w**2 * np.sin(angle)
    target = target_of(robot, Task(ROBOT, offset=True), 0.0)
    friction = {f"F{k}{kind}": x for k in range(1, n + 1) for kind, x in (("c", 0.5), ("v", 0.3), ("o", 0.1))}
    beta = parameter_values(target.model, target.base, {**standard_values(robot), **friction})
    effort = np.empty((rows, n))
    for first in range(0, rows, _BLOCK):
        part = slice(first, first + _BLOCK)
        W = target.model.selected(Samples(t[part], q[part], dq[part], ddq[part], ddq[part]), target.base.index)
        effort[part] = (W @ beta).reshape(-1, n)
    q += POSITION_NOISE * rng.standard_normal(q.shape)
    effort += TORQUE_NOISE * rng.standard_normal(q.shape)
    return Log("random", "", robot.joint_names, t, q, effort=effort)


def write(path: str, rows: int, rate: float) -> None:
    """Write such a log, as CSV, or as arrays by the suffix ``npz``."""
    from excite.logs.log_reading import write_log

    log = random_log(rows, rate)
    if path.endswith("npz"):
        np.savez(path, time=log.time, q=log.q, effort=log.effort)
    else:
        write_log(log, path)


def in_memory(path: str) -> None:
    """`excite.identify` of a log in memory, with its error on it."""
    import excite
    from excite.logs.log import Log
    from regressors.readers.library import load_robot

    robot = load_robot(ROBOT)
    with np.load(path) as arrays:
        log = Log("random", "", robot.joint_names, arrays["time"], arrays["q"], effort=arrays["effort"])
    began = time.process_time()
    result = excite.identify(robot, log, offset=True)
    assert result.training_error is not None
    print(json.dumps({"identify": time.process_time() - began, "parameters": len(result.names)}))


def measured(arguments: list[str]) -> dict[str, float]:
    """Processor time [s], wall time [s] and peak memory [GB] of a Python command, and its exit status.

    Status 1 is that of a command that ended, but doubts its result.
    """
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    began = time.monotonic()
    process = subprocess.Popen([sys.executable, *arguments], env=environment, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    code = os.waitstatus_to_exitcode(status)
    if code not in (0, 1):
        raise SystemExit(f"{' '.join(arguments)} ended with status {code}")
    return {
        "exit": code,
        "cpu": usage.ru_utime + usage.ru_stime,
        "wall": time.monotonic() - began,
        "memory": usage.ru_maxrss * 1024 / 1e9,
    }


def study(tasks: Collection[str]) -> dict[str, dict[str, float]]:
    """Measurements of some tasks."""
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        identify = ["-m", "excite", "identify", ROBOT]
        for task in tasks:
            name, rows, rate = LOGS[task]
            log, out = str(Path(folder, name)), str(Path(folder, "out"))
            measured([__file__, "write", log, str(rows), str(rate)])
            plain = [*identify, log, "--figures", "none", "--out", out]
            arguments = {
                "100,000": plain,
                "1,000,000": plain,
                "memory": [__file__, "in-memory", log],
                "command": [*identify, log, "--offset", "--out", out],
                "repetitions": [*identify, log, "--offset", "--repeat", str(REPETITIONS), "--out", out],
            }
            before = os.getloadavg()[0]
            found[task] = {**measured(arguments[task]), "load_before": before}
            Path(log).unlink()
            shutil.rmtree(out, ignore_errors=True)
    return found


def page(found: dict[str, dict[str, float]]) -> str:
    """Results as text."""
    names = {
        "memory": f"`excite.identify` of a log in memory, {LONG:,} rows x 6 joints, and its training error",
        "command": "`excite identify` of the same log as CSV, with reading, figures and `result.json`",
        **{rows: f"`excite identify --figures none` of {rows} rows as CSV" for rows in ("100,000", "1,000,000")},
        "repetitions": f"`excite identify --repeat {REPETITIONS}` of {SHORT:,} rows at {SHORT_RATE:g} Hz, in all",
    }
    lines = ["# Scale", "", "Written by `python benchmarks/scale/scale.py`; one process each, one BLAS thread.", ""]
    lines += [
        "| task | CPU [s] | limit | memory [GB] | limit | wall [s] | load | exit status |",
        "|" + "---|" * 8,
    ]
    for key, text in ((key, text) for key, text in names.items() if key in found):
        m, (cpu, memory) = found[key], LIMITS[key]
        lines.append(
            f"| {text} | {m['cpu']:.1f} | {cpu:g} | {m['memory']:.2f} | {memory:g} "
            f"| {m['wall']:.0f} | {m['load_before']:.1f} | {m['exit']:g} |"
        )
    return "\n".join([*lines, "", "Limitations:", "", *(f"- {text}" for text in LIMITATIONS)]) + "\n"


def main() -> None:
    """Measure everything, or do one of the parts in this process."""
    match sys.argv[1:]:
        case ["write", path, rows, rate]:
            write(path, int(rows), float(rate))
        case ["in-memory", path]:
            in_memory(path)
        case tasks:
            results = HERE / "results.json"
            found = json.loads(results.read_text(encoding="utf-8")) if results.exists() and tasks else {}
            found |= study(tasks or list(LIMITS))
            results.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
            (HERE / "results.md").write_text(page(found), encoding="utf-8")
            print(page(found))


if __name__ == "__main__":
    main()
