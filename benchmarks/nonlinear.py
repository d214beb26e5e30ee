"""What limits of torques and of the tool cost: P1 with linear limits only, and with more and more of the others."""

from __future__ import annotations

from typing import Any

import numpy as np
import record
from judge import Motion, judgement, torque_limits, torques_and_tool
from measure import script
from problems import PROBLEMS

PROBLEM, STARTS, SEED, DENSE = "P1", 12, 0, 10_000.0
WIDE = {"tool_box": [[-0.6, 0.6], [-0.6, 0.6], [0.1, None]], "tool_speed": 1.5}
NARROW = {"tool_box": [[-0.3, 0.5], [-0.4, 0.4], [0.3, 0.9]], "tool_speed": 0.8}
CASES: dict[str, dict[str, Any]] = {
    "linear only": {},
    "torques to 70 %": {"torque_margin": 0.3},
    "and a wide box, 1.5 m/s": {"torque_margin": 0.3, **WIDE},
    "torques to 40 %, a narrow box, 0.8 m/s": {"torque_margin": 0.6, **NARROW},
}


def uses(trajectory: dict[str, Any], task: dict[str, Any]) -> dict[str, float]:
    """How much of each limit a motion uses at 10 kHz: of the bound of torques and speed, of half the box's side."""
    problem, motion = PROBLEMS[PROBLEM], Motion.of(trajectory)
    time = np.linspace(0.0, motion.period, round(motion.period * DENSE) + 1)
    torque, place, speed = torques_and_tool(problem, *(motion.values(time, derivative) for derivative in range(3)))
    found = {}
    if "torque_margin" in task:
        limit = (1 - task["torque_margin"]) * torque_limits(problem)
        found["torque"] = float((np.abs(torque) / limit).max())
    if "tool_speed" in task:
        found["speed"] = float(speed.max()) / task["tool_speed"]
    for axis, (lower, upper) in zip("xyz", task.get("tool_box", ()), strict=False):
        values = place[:, "xyz".index(axis)]
        half = 0.5 * (upper - lower) if upper is not None else lower
        low = 1.0 - (values.min() - lower) / half
        found[axis] = float(max(low, 1.0 - (upper - values.max()) / half) if upper is not None else low)
    return found


def case(name: str) -> dict[str, Any]:
    """One multi-start, judged."""
    wanted = {"mode": "search", "problem": PROBLEM, "convention": "gautier", "starts": STARTS, "seed": SEED}
    run = script("ours.py", {**wanted, "task": CASES[name]})
    judged, found = judgement(PROBLEM, run.result["trajectory"]), uses(run.result["trajectory"], CASES[name])
    return {
        "case": name,
        "task": CASES[name],
        "condition_number": judged["condition_numbers"]["gautier"],
        "values": run.result["values"],
        "cpu_seconds": run.cpu,
        "wall_seconds": run.wall,
        "certified": run.result["certified"],
        "linear_limits_kept": judged["feasible"],
        "uses": found,
        "kept": judged["feasible"] and all(use <= 1.0 for use in found.values()),
        "trajectory": run.result["trajectory"],
    }


def row(found: dict[str, Any], plain: dict[str, Any]) -> list[object]:
    """One line of the table."""
    return [
        found["case"],
        f"**{found['condition_number']:.2f}**",
        f"{np.median(found['values']):.2f}",
        f"{max(found['values']):.2f}",
        f"{found['cpu_seconds']:.1f}",
        f"{found['cpu_seconds'] / plain['cpu_seconds']:.1f}",
        f"{found['wall_seconds']:.1f}",
        "yes" if found["certified"] and found["kept"] else "NO",
        ", ".join(f"{name} {100 * use:.1f}" for name, use in found["uses"].items()) or "-",
    ]


HEAD = (
    "limits",
    "cond(W)",
    "median start",
    "worst start",
    "CPU s",
    "times linear",
    "wall s",
    "kept",
    "% of each, judged by Pinocchio",
)

LIMITATIONS = (
    "torque limits of the URDF, 87 Nm (joints 1-4) and 12 Nm; the tool is the frame of link 7; boxes: x and y +-0.6 m, "
    "z 0.1 m or more; narrow: x -0.3 to 0.5, y +-0.4, z 0.3 to 0.9 m",
    "one seed; CPU and wall time are those of the whole process with its workers, set-up and certificate included, on "
    "a shared machine where they vary by some ten per cent",
    "kept: the project's certificate over continuous time, the judge's exact extrema of linear limits, and the other "
    "limits at 10 kHz by Pinocchio; the last column is the latter (of half a box's side, of the bound where it has one "
    "side)",
)


def main() -> None:
    """All cases."""
    before = record.load()
    cases = []
    for name in CASES:
        cases.append(case(name))
        print(record.table(HEAD, [row(cases[-1], cases[0])]), flush=True)
    content = {"problem": PROBLEM, "starts": STARTS, "seed": SEED, "cases": cases}
    record.save(
        "nonlinear", before, content, record.table(HEAD, [row(found, cases[0]) for found in cases]), LIMITATIONS
    )


if __name__ == "__main__":
    main()
