"""How close each seed comes to the best known motion, and how much processor time the whole command takes.

Five cases of the IRp-6 through the command line, P1 and P2 under every convention in processes of `ours`; P1 and P2 are
judged from what was written by `judge`. Runs that an earlier call with ``--resume`` has finished are not made again.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import record
from judge import base_columns, judgement
from measure import HERE, measured, script

SEEDS = tuple(range(10))
KNOWN = HERE / "best_known.json"
WITHIN = 1.02
#: budgets [s] with which the whole command takes about 6 s on the IRp-6, and 12 s on P1 and P2
SHORT = {"IRp-6": 4.5, "P1": 9.5, "P2": 9.5}
FREE_SPACE = ("--floor", "none", "--no-self-collision")
LOAD = ("--period", "6.4")
IRP6 = {
    "differential": (),
    "energy short": ("--model", "energy"),
    "energy long": ("--model", "energy", "--window", "long"),
    "load": ("--model", "load", *LOAD),
    "load integral long": ("--model", "load-integral", "--window", "long", *LOAD),
}
CONVENTIONS = ("gautier", "pivoted-lapack", "orthonormal", "friction")
CASES = (*(f"IRp-6 {name}" for name in IRP6), *(f"{p} {name}" for p in ("P1", "P2") for name in CONVENTIONS))


def run(case: str, seed: int, *, short: bool = False) -> dict[str, Any]:
    """One search with the options that a user has by default, without figures; or with a budget besides."""
    problem, name = case.split(" ", 1)
    budget = SHORT[problem] if short else None
    found = _irp6(name, seed, budget) if problem == "IRp-6" else _arm(problem, name, seed, budget)
    return found | {"case": case, "seed": seed}


def _irp6(name: str, seed: int, budget: float | None) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "design"
        options = ["--seed", str(seed), "--figures", "none", "--quiet", "--out", str(out), *FREE_SPACE, *IRP6[name]]
        options += [] if budget is None else ["--budget", str(budget)]
        took = measured([sys.executable, "-m", "excite", "design", "irp6", *options])
        content = json.loads((out / "design.json").read_text(encoding="utf-8"))
    return {
        "value": content["criteria"]["condition_number"],
        "feasible": content["feasible"],
        "starts": len(content["solver"]["starts"]),
        "search": content["solver"]["search"],
        "cpu_of_starts": sum(start["cpu_seconds"] for start in content["solver"]["starts"]),
        "cpu": took.cpu,
        "wall": took.wall,
    }


def _arm(problem: str, convention: str, seed: int, budget: float | None) -> dict[str, Any]:
    task = {"torque_margin": "none"} | ({} if budget is None else {"budget": budget})
    wanted: dict[str, Any] = {"problem": problem, "convention": convention, "seed": seed, "starts": None, "task": task}
    if convention.endswith("lapack"):
        wanted["columns"] = base_columns(problem)["pivoted-lapack"]
    took = script("ours.py", {**wanted, "mode": "search"})
    found = took.result
    judged = judgement(problem, found["trajectory"])
    return {
        "value": judged["condition_numbers"][convention],
        "feasible": judged["feasible"] and found["certified"],
        "starts": len(found["values"]),
        "search": found["search"],
        "cpu_of_starts": found["cpu_of_starts"],
        "cpu": took.cpu,
        "wall": took.wall,
        "trajectory": found["trajectory"],
    }


def improve(known: dict[str, Any], runs: list[dict[str, Any]]) -> dict[str, Any]:
    """The table of best known values, which only improves."""
    for found in runs:
        case = found["case"]
        if found["feasible"] and found["value"] < known.get(case, {"value": float("inf")})["value"]:
            found_by = {"value": found["value"], "by": f"benchmarks/search.py, seed {found['seed']}"}
            known[case] = {**known.get(case, {}), **found_by}
    return known


HEAD = (
    "case", "best known", "above the floor", "best", "median", "worst", "worst / best known", "seeds within 2 %",
    "CPU s, median", "largest", "of which starts", "starts", "limits kept",
)  # fmt: skip


def above_floor(entry: Mapping[str, Any]) -> str:
    """Best known value 2 cm above the floor; of the IRp-6, which cannot reach it, that of any motion."""
    known = entry if entry.get("out of reach") else entry.get("above the floor")
    return "-" if known is None else f"{known['value']:.4g}"


def row(case: str, runs: list[dict[str, Any]], known: Mapping[str, Any]) -> list[object]:
    """One line of the table."""
    values, best = [found["value"] for found in runs], known[case]["value"]

    def median(of: Callable[[dict[str, Any]], float]) -> float:
        return statistics.median(of(found) for found in runs)

    return [
        case,
        f"{best:.4g}",
        above_floor(known[case]),
        f"{min(values):.4g}",
        f"{statistics.median(values):.4g}",
        f"{max(values):.4g}",
        f"{max(values) / best:.3f}",
        f"{sum(value <= WITHIN * best for value in values)} of {len(values)}",
        f"**{median(lambda found: found['cpu']):.1f}**",
        f"{max(found['cpu'] for found in runs):.1f}",
        f"{median(lambda found: found['cpu_of_starts']):.1f}",
        f"{median(lambda found: found['starts']):.0f}",
        "yes" if all(found["feasible"] for found in runs) else "NO",
    ]


LIMITATIONS = (
    "wanted: every seed within 2 % of the best known value, in at most 6 s of processor time on the IRp-6 and 12 s on "
    "P1 and P2, imports, workers and files included, without figures",
    "best known: the least value that any committed run has found, of any length; the table `best_known.json` only "
    "improves, so that later runs may be farther from it",
    "P1 and P2 are judged by `judge`, which shares no code with the search; the condition numbers of the IRp-6 are the "
    "program's own",
    "processor time of a machine that is shared by other work, whose caches and hyperthreads slow each other down: "
    "compare it within one run only; values depend on the processor and its BLAS, by rounding that a search amplifies",
)


def save(name: str, runs: list[dict[str, Any]], before: float) -> None:
    """Results and the table of best known values."""
    known = improve(json.loads(KNOWN.read_text(encoding="utf-8")), runs)
    KNOWN.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
    rows = [row(case, some, known) for case in CASES if (some := [found for found in runs if found["case"] == case])]
    record.save(name, before, {"runs": runs, "best_known": known}, record.table(HEAD, rows), LIMITATIONS)


def main() -> None:
    """Every case with every seed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", nargs="*", default=CASES, choices=CASES, metavar="CASE")
    parser.add_argument("--seeds", nargs="*", type=int, default=SEEDS)
    parser.add_argument("--resume", action="store_true")
    parser.add_argument("--short", action="store_true", help="with a budget of processor time, see SHORT")
    asked = parser.parse_args()
    name = "search_short" if asked.short else "search"
    before, results = record.load(), HERE / "results" / f"{name}.json"
    runs = json.loads(results.read_text(encoding="utf-8"))["runs"] if asked.resume and results.exists() else []
    there = {(found["case"], found["seed"]) for found in runs}
    for case in asked.cases:
        runs += [run(case, seed, short=asked.short) for seed in asked.seeds if (case, seed) not in there]
        save(name, runs, before)


if __name__ == "__main__":
    main()
