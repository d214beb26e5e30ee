"""How much sooner this project reaches what the do-it-yourself baseline reaches, both in one run on one machine.

The baseline (`baseline_slsqp`) runs for a given processor time. Then this project runs in a fresh, single-threaded
process, start after start, until one of its motions is as good by the same criterion at 1001 instants.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import record
from baseline_slsqp import baseline
from judge import base_columns, judgement
from measure import script
from problems import PROBLEMS

CONVENTION, BUDGET, SEEDS = "pivoted-lapack", 100.0, (0, 1, 2)
#: (instants of the baseline's objective, its seeds)
BASELINES = ((100, (0, 1, 2)), (1001, (0,)))
WANTED = 100.0


def ours(problem: str, target: float, seed: int) -> dict[str, Any]:
    """Time to a target, with set-up and imports and without; the motion is judged again afterwards."""
    wanted = {"mode": "target", "problem": problem, "convention": CONVENTION, "seed": seed, "target": target}
    columns = base_columns(problem)[CONVENTION]
    run = script("ours.py", {**wanted, "columns": columns, "patience": BUDGET, "executor": "serial"}, threads=1)
    found: dict[str, Any] = run.result
    if found["cpu"] is None:
        return {"seed": seed, **found}
    judged = judgement(problem, found["trajectory"], dense=False)
    value = judged["condition_numbers"][CONVENTION]
    if value > target or not judged["feasible"]:
        raise RuntimeError(f"{problem}, seed {seed}: said to have reached {target}, judged {value}, {judged}")
    return {"seed": seed, **found, "condition_number": value}


def comparison(problem: str, instants: int, seed: int) -> dict[str, Any]:
    """One baseline, and this project against it with several seeds."""
    theirs = baseline(problem, CONVENTION, seed, BUDGET, instants)
    reached_at, value = theirs["improvements"][-1]
    runs = [ours(problem, value, s) for s in SEEDS]
    total = [run["cpu"] if run["cpu"] is not None else np.inf for run in runs]
    solving = [run["cpu"] - run["cpu_set_up"] if run["cpu"] is not None else np.inf for run in runs]
    return {
        "problem": problem,
        "instants": instants,
        "baseline_seed": seed,
        "target": value,
        "baseline_reached_at": reached_at,
        "baseline": theirs,
        "ours": runs,
        "total": total,
        "solving": solving,
    }


def row(found: dict[str, Any]) -> list[object]:
    """One line of the table."""
    total, solving = np.array(found["total"]), np.array(found["solving"])
    return [
        found["problem"],
        found["instants"],
        found["baseline_seed"],
        f"{found['target']:.2f}",
        f"{found['baseline_reached_at']:.0f}",
        ", ".join(f"{t:.1f}" for t in total),
        ", ".join(f"{t:.1f}" for t in solving),
        ", ".join(f"{BUDGET / t:.0f}" for t in total),
        ", ".join(f"{found['baseline_reached_at'] / t:.0f}" for t in total),
        ", ".join(f"{BUDGET / t:.0f}" for t in solving),
    ]


HEAD = (
    "problem",
    "instants of the baseline",
    "its seed",
    f"its value after {BUDGET:.0f} s",
    "reached at s",
    "ours: CPU s, all",
    "CPU s without set-up",
    f"{BUDGET:.0f} s / all",
    "reached at / all",
    f"{BUDGET:.0f} s / without set-up",
)

LIMITATIONS = (
    f"columns of ours have one value for each of the seeds {', '.join(map(str, SEEDS))}; `all` is the processor time "
    "of a fresh process from its start, with imports and symbolic set-up; `inf`: not reached within "
    f"{BUDGET:.0f} s, which makes the ratio less than 1",
    "the baseline starts again from another random motion where SLSQP converges before its time is over; its value is "
    "the best of all, and `reached at` is when that came",
    "motions of the baseline that exceed a limit between its 100 grid instants (by up to 1.2 %) are shrunk into the "
    "limits before they are judged",
    "a baseline with 100 instants in its objective is the fastest that we know to write with finite differences "
    "(exact gradients make it much faster, see afternoon.md); one with 1001 optimises what "
    "is reported and is nearer to the one measured with the other systems (see baseline_slsqp.md)",
    "the two problems run at the same time, one core each: baseline and ours of a problem never run together, but "
    "beside those of the other problem",
    "processor times on a shared machine vary by some ten per cent; with few seeds a lucky baseline weighs much",
)


def comparisons(problem: str) -> list[dict[str, Any]]:
    """All baselines of one problem, one after the other."""
    found = []
    for instants, seeds in BASELINES:
        for seed in seeds:
            found.append(comparison(problem, instants, seed))
            print(record.table(HEAD, [row(found[-1])]), flush=True)
    return found


def main() -> None:
    """Both problems at the same time, each on one core."""
    before = record.load()
    with ThreadPoolExecutor(len(PROBLEMS)) as pool:
        found = [one for several in pool.map(comparisons, PROBLEMS) for one in several]
    lines = [record.table(HEAD, [row(one) for one in found]), ""]
    for label, pick in (
        ("100 s / all", lambda one: BUDGET),
        ("reached at / all", lambda one: one["baseline_reached_at"]),
    ):
        ratios = [pick(one) / t for one in found for t in one["total"]]
        held = sum(ratio >= WANTED for ratio in ratios)
        lines.append(
            f"{label}: median {np.median(ratios):.0f}, lowest {min(ratios):.0f}; "
            f"{WANTED:.0f} or more in {held} of {len(ratios)}.  "
        )
    record.save("time_to_target", before, {"comparisons": found}, "\n".join(lines), LIMITATIONS)


if __name__ == "__main__":
    main()
