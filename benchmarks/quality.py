"""How good the designs are: P1 and P2 under every convention, the default search and 20 single starts each.

Everything is judged by `judge`, which shares no code with what made the designs.
"""

from __future__ import annotations

from typing import Any

import record
from judge import base_columns, judgement
from measure import script
from problems import CONVENTIONS, PROBLEMS, known

SINGLES, SEED = 20, 0
#: Where our pivoted columns are those of the others, as far as the values tell.
SAME_PIVOTS = (("P1", "pivoted-lapack"), ("P1", "friction-lapack"))


def case(problem: str, convention: str) -> dict[str, Any]:
    """One problem under one convention: the search, then the single starts."""
    wanted: dict[str, Any] = {"problem": problem, "convention": convention, "seed": SEED}
    if convention.endswith("lapack"):
        wanted["columns"] = base_columns(problem)["pivoted-lapack"]
    run = script("ours.py", {**wanted, "mode": "search", "starts": None})
    found = run.result
    judged = judgement(problem, found["trajectory"])
    single = script("ours.py", {**wanted, "mode": "starts", "starts": SINGLES}, threads=1).result
    verdicts = [judgement(problem, start["trajectory"], dense=False) for start in single]
    values = [verdict["condition_numbers"][convention] for verdict in verdicts]
    return {
        "problem": problem,
        "convention": convention,
        "condition_number": judged["condition_numbers"][convention],
        "known": known(PROBLEMS[problem], convention),
        "cpu_seconds": run.cpu,
        "wall_seconds": run.wall,
        "starts": len(found["values"]),
        "certified": found["certified"],
        "judgement": judged,
        "trajectory": found["trajectory"],
        "single_starts": {
            "condition_numbers": values,
            "cpu_seconds": [start["cpu"] for start in single],
            "worst_over_best": max(values) / min(*values, judged["condition_numbers"][convention]),
            "feasible": sum(verdict["feasible"] for verdict in verdicts),
        },
    }


def row(found: dict[str, Any]) -> list[object]:
    """One line of the table."""
    single, judged = found["single_starts"], found["judgement"]
    values = single["condition_numbers"]
    use = max(judged["limit_use"].values())
    where = found["problem"], found["convention"]
    same = where[1] in ("gautier", "orthonormal") or where in SAME_PIVOTS
    texts = [f"{value:.2f}" for value in found["known"].values()]
    ours = f"{found['condition_number']:.2f}"
    lowest = same and float(ours) < min(map(float, texts))
    return [
        *where,
        f"**{ours}**" if lowest else ours,
        *(text if same else f"({text})" for text in texts),
        found["starts"],
        f"{found['cpu_seconds']:.1f}",
        f"{found['wall_seconds']:.1f}",
        f"{'yes' if judged['feasible'] and found['certified'] else 'NO'} ({100 * use:.2f} %)",
        f"{min(values):.2f}-{max(values):.2f}",
        f"{single['worst_over_best']:.2f}",
        f"{single['feasible']}/{len(values)}",
        f"{sum(single['cpu_seconds']) / len(values):.2f}",
    ]


HEAD = (
    "problem",
    "convention",
    "cond(W)",
    "other systems",
    "prototype",
    "starts",
    "CPU s",
    "wall s",
    "feasible (of the limits)",
    f"{SINGLES} single starts",
    "worst / best",
    "feasible",
    "CPU s a start",
)

LIMITATIONS = (
    "CPU and wall time of a row are those of the whole process with its workers: start, imports, set-up, search, "
    "certificate and files, without figures; time on a shared machine varies by some ten per cent",
    "`other systems` and `prototype` were measured on another day on a machine of the same class: the lowest value "
    "that any of four systems (SLSQP, figaroh, FloBaRoID, robot_payload_id) reached, whatever it minimised and some of "
    "them 1 % beyond a limit, and the best of 40 starts of this project's prototype",
    "values in parentheses are in other pivoted columns than ours, and cannot be compared: theirs are those that "
    "LAPACK found for them, and ties make that set differ between orders of drawing (see pivots.md)",
    "`worst / best` is the worst of the single starts over the best of all, those of the search included",
    "a feasible motion uses no limit by more than 100 % over continuous time (roots of the derivative, by NumPy) and "
    "at 100 kHz, is certified by this project too, and rests at both ends to 1e-9; single starts are not sampled at "
    "100 kHz",
)


def main() -> None:
    """All cases."""
    before = record.load()
    cases = []
    for problem in PROBLEMS:
        for convention in CONVENTIONS:
            cases.append(case(problem, convention))
            print(record.table(HEAD, [row(cases[-1])]), flush=True)
    columns = {problem: base_columns(problem) for problem in PROBLEMS}
    content = {"seed": SEED, "cases": cases, "base_columns": columns}
    record.save("quality", before, content, record.table(HEAD, [row(found) for found in cases]), LIMITATIONS)


if __name__ == "__main__":
    main()
