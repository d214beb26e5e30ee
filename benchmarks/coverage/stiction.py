"""Bias by sticking friction of what plain defaults identify, at noise so small that it hides none.

``python benchmarks/coverage/stiction.py`` simulates controlled robots whose drives stick, and identifies each log by
``identify`` with nothing but the robot and the log. The bias of a parameter is relative to its true value, or to a
tenth of the root mean square of the true values in its unit where that is larger. Each line is stored when it is there.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

os.environ |= {"OPENBLAS_NUM_THREADS": "1"}
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import record
from experiments import Experiment
from repetition import Case, repeat
from threadpoolctl import threadpool_limits

HERE = Path(__file__).resolve().parent
LEVEL, SEED = 0.003, 0
SMALL = 0.1  # of the root mean square in a unit: what smaller parameters are compared with
MOST = 3.0  # per cent that the project allows
ROBOTS = {"irp6": (6.0, 200.0, 3), "panda": (8.0, 125.0, 1)}  # duration [s], rate [Hz], logs
STRENGTHS = {
    "sticking Coulomb friction": (1.0, 1e-5),
    "presliding over 1e-3 rad": (1.0, 1e-3),
    "break-away 1.3 times": (1.3, 1e-5),
    "break-away 1.3 times, presliding over 1e-3 rad": (1.3, 1e-3),
    "break-away 2 times": (2.0, 1e-5),
    "break-away 2 times, presliding over 1e-3 rad": (2.0, 1e-3),
}
LARGER = 2.0  # distances below 1e-4 rad for the panda, whose light links need that
FEWER = ("sticking Coulomb friction", *(name for name in STRENGTHS if "times, presliding" in name))  # of the panda


def main() -> None:
    """Run what is not stored, and write the table."""
    load_before = record.load()
    file = HERE / "results" / "stiction_lines.json"
    lines: dict[str, Any] = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    with threadpool_limits(1):
        for robot in ROBOTS:
            for name in STRENGTHS if robot == "irp6" else FEWER:
                if (key := f"{robot}, {name}") not in lines:
                    lines[key] = line(robot, *STRENGTHS[name])
                    file.with_suffix(".part").write_text(json.dumps(lines, indent=1) + "\n", encoding="utf-8")
                    file.with_suffix(".part").replace(file)
                    print(key, lines[key]["cpu"], flush=True)
    record.save("stiction", load_before, {"seed": SEED, "lines": lines}, table(lines), LIMITATIONS, folder=HERE)


def line(robot: str, stiction: float, breakaway: float) -> dict[str, Any]:
    """Bias and coverage of every parameter of one robot's log."""
    duration, rate, count = ROBOTS[robot]
    breakaway *= LARGER if robot == "panda" and breakaway < 1e-4 else 1.0
    experiment = Experiment(robot, duration=duration, rate=rate, stiction=stiction, breakaway=breakaway)
    o = repeat(Case("", experiment, level=LEVEL, plain=True), count, SEED)
    units = np.array([experiment.target.model.columns[k].unit for k in experiment.target.base.index])
    scale = np.array([SMALL * np.sqrt(np.mean(o.truth[units == unit] ** 2)) for unit in units])
    error = o.values - o.truth
    bias = 100 * np.nanmean(error, axis=0) / np.maximum(np.abs(o.truth), scale)
    return {
        "names": list(o.names),
        "bias": [round(float(x), 3) if np.isfinite(x) else None for x in bias],
        "inside": float(np.mean((np.abs(error) <= o.half_widths)[np.isfinite(error)])),
        "cpu": round(o.cpu, 1),
    }


def table(lines: dict[str, Any]) -> str:
    """One line per robot and strength."""
    rows = []
    for key, found in lines.items():
        bias = np.array(found["bias"], dtype=float)
        worst = int(np.nanargmax(np.abs(bias)))
        rows.append(
            [
                key,
                f"**{bias[worst]:.1f} %** {found['names'][worst]}",
                f"{np.nanmedian(np.abs(bias)):.2f} %",
                f"{int(np.sum(np.abs(bias) > MOST))} of {bias.size}",
                f"{100 * found['inside']:.0f} %",
                f"{found['cpu']:.0f}",
            ]
        )
    head = ["log", "largest bias", "median", f"above {MOST:g} %", "within their intervals", "CPU s"]
    return record.table(head, rows)


LIMITATIONS = (
    f"Bias is relative to a parameter's value, or to {100 * SMALL:g} % of the root mean square of those in its unit "
    "where that is larger; a parameter whose place an added term takes is left out.",
    f"One motion per robot; noise is {100 * LEVEL:g} % of each channel's rms; the bias is the mean of 3 logs of the "
    "irp6, and the error of one log of the panda.",
    "Drives stick and slide by one friction law, Stribeck's with presliding, and the robot is rigid.",
    "The friction of the panda is assumed, since it is not published.",
)

if __name__ == "__main__":
    main()
