"""Short tables of the page of claims, ``README.md``, from the files of results: numbers only, no prose.

A table stands between ``<!-- NAME -->`` and ``<!-- end of NAME -->``, and is made by the function NAME in `TABLES`;
``python benchmarks/record.py`` fills them in.
"""

from __future__ import annotations

import json
import math
import re
import statistics
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
_PLACE = re.compile(r"(<!-- (?P<name>\w+) -->\n).*?(?=<!-- end of (?P=name) -->)", re.DOTALL)
Cells = Sequence[object]


def result(name: str) -> dict[str, Any]:
    """Content of one file of results, below this folder."""
    content: dict[str, Any] = json.loads((HERE / f"{name}.json").read_text(encoding="utf-8"))
    return content


def table(*rows: Cells) -> str:
    """A Markdown table, whose first row is the head."""
    head, *others = rows
    lines = (head, ["---"] * len(head), *others)
    return "".join("| " + " | ".join(map(str, line)) + " |\n" for line in lines)


def yes(value: object) -> str:
    """A truth value in a table."""
    return "yes" if value else "no"


def percents(values: Sequence[float]) -> str:
    """Smallest and largest of some shares."""
    ends = [f"{100 * value:.1f}" for value in (min(values), max(values))]
    return " to ".join(dict.fromkeys(ends)) + " %"


def public() -> str:
    """All systems with the same limits and processor time, judged by one program: the medians of the seeds."""
    study = result("results/public")
    runs = [run for run in study["runs"] if "failure" not in run]
    systems, done = list(dict.fromkeys(run["system"] for run in runs)), {(run["case"], run["system"]) for run in runs}
    cases = [case for case in dict.fromkeys(run["case"] for run in runs) if all((case, s) in done for s in systems)]

    def medians(system: str, of: Callable[[dict[str, Any]], float]) -> list[float]:
        return [
            statistics.median(of(run) for run in runs if (run["case"], run["system"]) == (c, system)) for c in cases
        ]

    conditions = {system: medians(system, lambda run: float(run["verdict"]["condition_number"])) for system in systems}
    rows = []
    for system, values in conditions.items():
        others = [conditions[other] for other in systems if other != system]
        lowest = [
            round(value, 2) < min((round(each[k], 2) for each in others), default=math.inf)
            for k, value in enumerate(values)
        ]
        worst = max(run["verdict"]["limit_use_as_delivered"] for run in runs if run["system"] == system) - 1
        rows.append(
            (
                f"`{system}`",
                *(f"**{value:.2f}**" if low else f"{value:.2f}" for value, low in zip(values, lowest, strict=True)),
                " / ".join(
                    f"{each:.0f}" for each in medians(system, lambda run: float(run["verdict"]["robot_seconds"]))
                ),
                "kept" if worst < 1e-6 else f"exceeded by {100 * worst:.1f} %",
                " / ".join(f"{each:.0f}" for each in medians(system, lambda run: float(run["cpu"]))),
            )
        )
    return table(("system", *cases, "robot s to 5 %", "limits as delivered", "CPU s"), *rows)


def afternoon() -> str:
    """How much sooner than an afternoon's rivals their own best values are reached."""
    comparisons = {(each["case"], each["rival"]): each for each in result("results/afternoon")["comparisons"]}

    def sooner(case: str, rival: str) -> str:
        if (case, rival) not in comparisons:
            return "-"
        ratios = comparisons[case, rival]["ratios_to_best"]
        return f"{statistics.median(ratios):.1f} ({min(ratios):.1f})"

    rows = []
    for case, rival in comparisons:
        if rival == "ipopt":
            found = comparisons[case, rival]
            times = (f"{seconds:.1f}" if math.isfinite(seconds) else "never" for seconds in reversed(found["to_best"]))
            ratios = (sooner(case, each) for each in ("ipopt", "slsqp-exact", "slsqp"))
            rows.append((case, f"{found['best'][1]:.2f}", f"{found['best'][0]:.2f}", *times, *ratios))
    sooner_than = ("times sooner (least)", "than SLSQP, exact", "than plain SLSQP")
    head = ("problem", "IPOPT's best", "best of ours", "it takes IPOPT, CPU s", "ours", *sooner_than)
    return table(head, *rows)


def paper() -> str:
    """The main cases of the paper."""
    printed = {
        "differential, axes 1-3, 13 parameters, 10 s": "1e13",
        "energy, drive 2 alone, 10 s": "500",
        "differential, row of joint 1 only, 10 s": "88, beyond the robot's limits",
        "load, differential, axes 1-5, 6.4 s": "3000, after 60 h",
    }
    runs = {run["case"]: run for run in result("results/paper")["runs"]}
    rows = [
        (
            case,
            of,
            f"**{runs[case]['condition_number']:.3g}**",
            yes(runs[case]["feasible"]),
            f"{runs[case]['cpu_seconds']:.0f}",
        )
        for case, of in printed.items()
    ]
    return table(("case", "printed", "cond(W)", "limits kept", "CPU s"), *rows)


def limits() -> str:
    """Torques and the tool on P1, obstacles on the iiwa 7."""
    cases = result("results/nonlinear")["cases"]
    rows: list[Cells] = [
        (f"P1, {case['case']}", f"{case['condition_number']:.2f}", yes(case["kept"]), f"{case['cpu_seconds']:.0f}")
        for case in (cases[0], cases[-1])
    ]
    for run in result("results/iiwa7")["runs"]:
        least = 1000 * min(run["judged_least_distance_of_links"], run["judged_least_distance_of_world"])
        name = f"iiwa 7 among a table and walls, seed {run['seed']}"
        value = f"{run['judged_condition_number']:.2f}"
        rows.append((name, value, f"{yes(run['feasible'])}, {least:.1f} mm", f"{run['cpu_seconds']:.0f}"))
    return table(("problem", "cond(W)", "limits kept, as judged", "CPU s"), *rows)


def families() -> str:
    """Condition numbers of three families with few and with many coefficients."""
    robots = result("results/families")["robots"]
    shown = ("fourier", "cosine", "fourier-quintic")
    rows = []
    for robot, runs in robots.items():
        for wanted in sorted({run["wanted"] for run in runs}):
            of = {run["family"]: run["criteria"]["condition_number"] for run in runs if run["wanted"] == wanted}
            rows.append((robot, wanted, *(f"{of[family]:#.3g}" for family in shown)))
    return table(("problem", "coefficients a joint", *(f"`{family}`" for family in shown)), *rows)


def real() -> str:
    """Unseen error on real logs, beside ordinary least squares and the best rival in hindsight."""
    rows = []
    for name, robot in result("real/results/real")["robots"].items():
        splits = robot["splits"]
        ours = [split["ours"]["error"] for split in splits]
        usual = [split["rivals"]["OLS, + offset, 10 Hz"]["error"] for split in splits]
        best = [split["best"]["error"] for split in splits]
        better = sum(a < b for a, b in zip(ours, best, strict=True))
        rows.append((name, percents(ours), percents(usual), percents(best), f"{better} of {len(splits)}"))
    head = ("robot", "plain defaults", "least squares", "best of 48 in hindsight", "splits better than it")
    return table(head, *rows)


def degradation() -> str:
    """Plain defaults over the best fixed choice in hindsight."""
    summary = result("degradation/results/degradation")["summary"]
    shares = (f"{100 * summary[f'share_within_{bound}']:.0f} %" for bound in ("1.3", "2"))
    head = ("cases", "within 1.3 times", "within 2 times", "median ratio", "worst")
    row = (summary["cases"], *shares, f"{summary['median_ratio']:.2f}", f"{summary['worst_ratio']:.2f}")
    return table(head, row)


def coverage() -> str:
    """How often 99 % intervals hold the truth with plain defaults."""
    alike = ("bias of 0.2 N", "load, bias of 0.3 N", "'s load, bias of 0.4 N", "defaults, panda, offset of 0.18 Nm")
    cases = [case for case in result("coverage/results/coverage")["cases"] if case["name"].startswith("plain defaults")]
    cases = [case for case in cases if not case["name"].endswith(alike)]
    rows = [
        (
            case["name"].removeprefix("plain defaults").strip(" ,:") or "white noise",
            case["repetitions"],
            f"{100 * statistics.mean(case['coverage']):.1f} %",
            f"{100 * min(case['coverage']):.1f} %",
        )
        for case in cases
    ]
    return table(("simulated experiment", "repetitions", "in the interval, mean", "worst parameter"), *rows)


TABLES: dict[str, Callable[[], str]] = {
    "public": public,
    "afternoon": afternoon,
    "paper": paper,
    "limits": limits,
    "families": families,
    "real": real,
    "degradation": degradation,
    "coverage": coverage,
}


def filled(text: str) -> str:
    """Text of the page with all its tables made anew."""
    return _PLACE.sub(lambda place: f"{place[1]}{TABLES[place['name']]()}", text)
