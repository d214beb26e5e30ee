"""What it costs to stay above the table: the search with and without the floor, and with self-collision besides.

Whole commands without figures, one after the other in rounds, so that the ratios of a round are of the same minutes;
then the best motions of the common problems above their floor, for the table of best known values.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import tempfile
from pathlib import Path
from typing import Any

import record
from judge import base_columns, judgement
from measure import HERE, measured, script
from problems import PROBLEMS

STARTS, ROUNDS = 8, 3
XARM7 = str(PROBLEMS["P1"].path.parents[2] / "xarm_description/urdf/xarm7.urdf")
ROBOTS = {"ur10e": ("ur10e",), "panda": ("panda",), "xArm7": (XARM7, "--tip", "link7")}
FREE = ("--no-self-collision", "--floor", "none")
VARIANTS = {"neither": FREE, "floor": FREE[:1], "self-collision": FREE[1:], "both": ()}
BEST = tuple((problem, convention) for problem in PROBLEMS for convention in ("gautier", "orthonormal"))
KNOWN = HERE / "best_known.json"


def design(robot: str, variant: str, seed: int) -> dict[str, Any]:
    """One search through the command line."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "design"
        options = ["--starts", str(STARTS), "--seed", str(seed), "--figures", "none", "--quiet", "--out", str(out)]
        arguments = [*ROBOTS[robot], *options, *VARIANTS[variant]]
        run = measured([sys.executable, "-m", "excite", "design", *arguments])
        content = json.loads((out / "design.json").read_text(encoding="utf-8"))
    return {
        "robot": robot,
        "variant": variant,
        "seed": seed,
        "cpu": run.cpu,
        "value": content["criteria"]["condition_number"],
        "feasible": content["feasible"],
    }


def best(problem: str, convention: str) -> dict[str, Any]:
    """The default search of a common problem above the plane through the base's origin, judged from outside."""
    task = {"torque_margin": "none", "floor": 0.0}
    wanted: dict[str, Any] = {"problem": problem, "convention": convention, "seed": 0, "starts": None, "task": task}
    if convention.endswith("lapack"):
        wanted["columns"] = base_columns(problem)["pivoted-lapack"]
    took = script("ours.py", {**wanted, "mode": "search"})
    judged = judgement(problem, took.result["trajectory"])
    value, kept = judged["condition_numbers"][convention], judged["feasible"] and took.result["certified"]
    return {"case": f"{problem} {convention}", "value": value, "feasible": kept, "cpu": took.cpu}


def row(robot: str, runs: list[dict[str, Any]]) -> list[object]:
    """One robot: medians of CPU time and values, and of the ratios in each round."""
    by = {(run["variant"], run["seed"]): run for run in runs if run["robot"] == robot}
    seeds = sorted({seed for _, seed in by})

    def median(variant: str, key: str) -> float:
        return statistics.median(by[variant, seed][key] for seed in seeds)

    def ratio(variant: str, to: str) -> float:
        return statistics.median(by[variant, seed]["cpu"] / by[to, seed]["cpu"] for seed in seeds)

    cells: list[object] = [robot]
    for variant in VARIANTS:
        cells.append(f"{median(variant, 'cpu'):.1f} ({median(variant, 'value'):.4g})")
    ratios = (ratio("floor", "neither"), ratio("both", "self-collision"), ratio("both", "neither"))
    return [*cells, *(f"{each:.2f}" for each in ratios), "yes" if all(run["feasible"] for run in by.values()) else "NO"]


HEAD = (
    "robot", *(f"{name}: CPU s (cond)" for name in VARIANTS), "floor / neither", "both / self-collision",
    "both / neither", "limits kept",
)  # fmt: skip
LIMITATIONS = (
    "wanted: the search with the floor takes at most twice the processor time of the search without it",
    f"medians over rounds; {STARTS} starts each, no rounds of combinations; start-up is counted",
    "self-collision of built-in robots is that of their capsules, of the xArm7 that of capsules around its meshes",
    "the best motions above the floor are of one search each: capsules along the links, the plane through the origin",
)


def main() -> None:
    """All variants in turn, then the best motions."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="seeds 0 to N - 1 (%(default)s)")
    given = parser.parse_args()
    before = record.load()
    runs = [design(robot, variant, seed) for robot in ROBOTS for seed in range(given.rounds) for variant in VARIANTS]
    known, found = json.loads(KNOWN.read_text(encoding="utf-8")), [best(*case) for case in BEST]
    for each in found:
        entry = known[each["case"]].setdefault("above the floor", {"value": float("inf")})
        if each["feasible"] and each["value"] < entry["value"]:
            known[each["case"]]["above the floor"] = {"value": each["value"], "by": "benchmarks/floor.py, seed 0"}
    KNOWN.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
    text = record.table(HEAD, [row(robot, runs) for robot in ROBOTS])
    of_best = [[each["case"], f"{known[each['case']]['value']:.4g}", f"{each['value']:.4g}"] for each in found]
    text += "\n\n" + record.table(("problem", "best known", "above the floor"), of_best)
    record.save("floor", before, {"runs": runs, "best": found}, text, LIMITATIONS)


if __name__ == "__main__":
    main()
