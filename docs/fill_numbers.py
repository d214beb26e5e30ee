"""Fill the tables of measured numbers in the pages, from results of the benchmarks: ``python docs/fill_numbers.py``.

A table stands between ``<!-- numbers: NAME -->`` and ``<!-- end of NAME -->``, and is made by the function NAME in
`TABLES`. ``--check`` only tells which pages are not current, and ends with status 1 if there are any.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import statistics
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
BENCHMARKS = DOCS.parent / "benchmarks"
sys.path.append(str(BENCHMARKS))
import claims  # noqa: E402

_PLACE = re.compile(r"(<!-- numbers: (?P<name>\S+) -->\n).*?(?=<!-- end of (?P=name) -->)", re.DOTALL)
Cells = Sequence[object]


def result(name: str) -> dict[str, Any]:
    """Content of one file of results, below the folder of the benchmarks."""
    content: dict[str, Any] = json.loads((BENCHMARKS / f"{name}.json").read_text(encoding="utf-8"))
    return content


def table(head: Cells, rows: Sequence[Cells], of: str) -> str:
    """Markdown table, with the file that its numbers come from."""
    lines = ["| " + " | ".join(map(str, row)) + " |" for row in (head, ["---"] * len(head), *rows)]
    content = json.loads((DOCS.parent / of).read_text(encoding="utf-8")) if of.endswith(".json") else {}
    made = (content, content.get("environment", {}), content.get("machine", {}))
    dated = [each["date"] for each in made if "date" in each]
    return "\n".join([*lines, "", f"Numbers from `{', '.join([f'{of}`', *dated])}.", ""])


def percent(value: float) -> str:
    """Fraction as a percentage with two digits."""
    return f"{100 * value:.2g} %"


def geometric_mean(values: Sequence[float]) -> float:
    """Geometric mean."""
    return math.exp(sum(map(math.log, values)) / len(values))


# As printed, before and after its optimisation [KD96] section 5.4: for our cases that have a counterpart.
PRINTED_CONDITIONS = {
    "differential, axes 1-3, 13 parameters, 10 s": ("1e14", "1e13"),
    "differential, row of joint 1 only, 10 s": ("1.9e5", "88, beyond the robot's limits"),
    "energy short (5 ms), axes 1-3, 13 parameters, 10 s": ("-", "not satisfactory"),
    "energy long, axes 1-3, 13 parameters, 10 s": ("-", "not satisfactory"),
    "energy, drive 2 alone, 10 s": ("3000", "500"),
    "load, differential, axes 1-5, 6.4 s": ("90830", "3000"),
    "load, integral short (5 ms), axes 1-5, 6.4 s": ("-", "worse than differential"),
    "load, integral long, axes 1-5, 6.4 s": ("-", "worse than differential"),
}
# [KD96] section 5.1, estimates for joint 2 alone
PRINTED_ESTIMATES = {"X7": "8.125 kg m", "X3": "5.5 kg m²", "F2v": "26 Nm s", "F2c": "28.75 Nm"}
# [KD96] section 5.2, break-away torques
PRINTED_BREAK_AWAY = {"z1": (14.1, -14.1), "z2": (16.8, -10.6), "z3": (18.0, -14.1)}


def paper_conditions() -> str:
    """Condition numbers of section 5.4."""
    runs = {run["case"]: run for run in result("results/paper")["runs"]}

    def row(case: str) -> Cells:
        run = runs[case]
        holds = "yes" if run["feasible"] else "no"
        return (
            case,
            *PRINTED_CONDITIONS[case],
            f"**{run['condition_number']:.4g}**",
            holds,
            f"{run['cpu_seconds']:.0f}",
        )

    head = ("case", "paper, before", "paper, after", "ours", "limits hold", "CPU s")
    return table(head, [row(case) for case in PRINTED_CONDITIONS], "benchmarks/results/paper.json")


def paper_estimates() -> str:
    """Parameters that section 5.1 prints."""
    study = result("identification/results/paper_figures/drive-2")
    rows = []
    for k, name in enumerate(study["names"]):
        true = study["true"][k]
        cells = (percent(study[of][k] / true) for of in ("rms_error", "stated_deviation"))
        rows.append((name, PRINTED_ESTIMATES[name], f"{true:.5g}", *cells, f"{study['settled'][k]:.2g} s"))
    errors = "rms error of ours", "stated deviation of ours"
    head = ("parameter", "paper's estimate", "value in `irp6`", *errors, "ours stays within 2 % from")
    return table(head, rows, "benchmarks/identification/results/paper_figures/drive-2.json")


def paper_models() -> str:
    """Differential and integral models, section 5.1, as identified from one simulated motion."""
    (data, *_) = result("identification/results/models_compared")["data"]

    def row(way: dict[str, Any]) -> Cells:
        errors = [error / abs(true) for error, true in zip(way["rms_error"], way["true"], strict=True)]
        worst = max(range(len(errors)), key=errors.__getitem__)
        inside = f"{100 * way['inside_99']:.0f} %"
        largest = f"{percent(errors[worst])} ({way['names'][worst]})"
        return (way["way"], f"{way['condition_number']:.4g}", percent(geometric_mean(errors)), largest, inside)

    head = (
        "equations; motion from positions by",
        "cond(W)",
        "rms error, geometric mean",
        "largest",
        "in 99 % intervals",
    )
    return table(head, [row(way) for way in data["ways"]], "benchmarks/identification/results/models_compared.json")


def paper_break_away() -> str:
    """Break-away torques of section 5.2, found again from simulated ramps."""
    rows = []
    for case in result("identification/results/friction_truth")["planned"]:
        if not case["encoder"]:
            continue
        for k, printed in enumerate(PRINTED_BREAK_AWAY[case["drive"]]):
            found = {key: case["break_away"][key][k] for key in ("truth", "mean", "deviation", "interval99")}
            if found["truth"] != printed:
                raise ValueError(f"{case['drive']}: {found['truth']} is simulated, {printed} is printed")
            cells = (f"{found['mean']:.2f}", f"{found['deviation']:.2g}", f"+- {found['interval99']:.2g}")
            rows.append((case["drive"], f"{printed:g}", *cells))
    head = ("drive", "paper [Nm]", "ours, mean [Nm]", "scatter", "99 % interval")
    return table(head, rows, "benchmarks/identification/results/friction_truth.json")


def paper_figure_5() -> str:
    """Time after which the first joint's mass parameter has settled."""
    settling = result("identification/results/friction_separate")["settling_s"]
    rows = [(model, way, f"{time:.2g} s") for _, model, way, time in settling]
    head = ("model", "friction", "X1 stays within 2 % of the truth from")
    return table(head, rows, "benchmarks/identification/results/friction_separate.json")


def paper_table_1() -> str:
    """Table I: a load at the force/torque sensor."""
    study = result("identification/results/load_table1")
    truth, motions = study["truth"], study["accuracy"]["motions"]
    rows: list[Cells] = []
    for k, name in enumerate(study["names"]):
        printed = [f"{truth[of][k - 1]:g}" if k else "-" for of in ("printed_estimates", "printed_deviations")]
        computed = f"{truth['printed'][k]:g}" if k else "-"
        ours = [f"{motions[motion]['weighted'][k]:.2g}" for motion in ("paper's", "designed")]
        rows.append((name, computed, *printed, f"{truth['parameters'][k]:.5g}", *ours))
    conditions = [f"{motions[motion]['condition_number']:.3g}" for motion in ("paper's", "designed")]
    rows.append(("cond(W)", "-", "-", "-", "-", *conditions))
    head = (
        "parameter",
        "paper, computed",
        "paper, estimated",
        "paper, deviation",
        "simulated body",
        "ours, deviation, the paper's motion",
        "ours, deviation, designed motion",
    )
    return table(head, rows, "benchmarks/identification/results/load_table1.json")


def paper_figure_15() -> str:
    """Estimates over time, joint 1 alone."""
    study = result("identification/results/figure_15")
    return table(study["head"], study["rows"], "benchmarks/identification/results/figure_15.json")


def paper_motions() -> str:
    """Designed and intuitive motions, section 6."""
    study = result("identification/results/optimal_motion")
    motions = {name: study["motions"][name] for name in ("designed (default)", "paper's quintic, to and fro")}
    rows = []
    for name, motion in motions.items():
        relative = [d / abs(true) for d, true in zip(motion["deviation"], study["true"], strict=True)]
        rows.append(
            (name, f"{motion['condition_number']:.4g}", percent(max(relative)), percent(geometric_mean(relative)))
        )
    head = ("motion", "cond(W)", "largest predicted relative deviation", "geometric mean of all")
    return table(head, rows, "benchmarks/identification/results/optimal_motion.json")


def paper_verification() -> str:
    """Predicted torques and simulated motion, Figs. 16 and 17, on a real robot."""
    study = result("identification/results/real_ur10e")["verification"][0]
    rows = [
        (joint["name"], percent(joint["relative"]), f"{joint['motion_error']:.2g} rad", f"{joint['travel']:.2g} rad")
        for joint in study["joints"]
    ]
    head = ("joint", "relative error of the torque", "rms error of the simulated position", "travel in a horizon")
    return table(head, rows, "benchmarks/identification/results/real_ur10e.json")


def paper_screws() -> str:
    """Gear ratios of the ball screws of drives 2 and 3 over the drives' range, section 5.1."""
    import casadi as ca
    import numpy as np

    import excite

    robot = excite.load_robot("irp6-full")
    z = ca.SX.sym("z")
    rows = []
    joints, drives = robot.limits, robot.transmission.limits
    ranges = {1: (joints.lower[1], joints.upper[1]), 2: (drives.lower[2], drives.upper[2])}
    for k, moves in ((1, "q2"), (2, "q2 + q3")):
        drive = robot.transmission.drives[k]
        ratio = ca.Function("ratio", [z], [drive.ratio.ratio(z)])
        values = np.abs([float(ratio(at)) for at in np.linspace(*ranges[k], 1001)])
        rows.append((drive.name, moves, "165 to 170", f"{values.min():.0f} to {values.max():.0f}"))
    head = ("drive", "moves", "paper", "ours over the range of `irp6-full`")
    return table(head, rows, "regressors/robots/irp6-full.yaml")


def choose_model() -> str:
    """Errors of the models on the motion that was designed for each."""
    rows = []
    for data in result("identification/results/models_compared")["data"]:
        for way in data["ways"]:
            model, _, signals = way["way"].partition("; ")
            if "default" not in signals or "low-pass" in model:
                continue
            errors = [error / abs(true) for error, true in zip(way["rms_error"], way["true"], strict=True)]
            rows.append((data["data"], model, f"{way['condition_number']:.4g}", percent(geometric_mean(errors))))
    head = ("motion", "model", "cond(W)", "rms error, geometric mean")
    return table(head, rows, "benchmarks/identification/results/models_compared.json")


def bounds() -> str:
    """What each condition adds to the bound on the IRp-6's condition number."""
    study = result("results/bound")
    rows = []
    for each in study["bounds"]:
        value = each.get("proven", each["estimate"])
        of_design = percent(value / study["condition_number"])
        known = "all of these, proven" if "proven" in each else f"{each['known']}, estimated"
        rows.append((known, f"{value:.2f}", of_design, f"{each['cpu_seconds']:.0f}"))
    bound = f"bound; the design has {study['condition_number']:.2f}"
    head = ("what the relaxation knows", bound, "efficiency", "CPU s")
    return table(head, rows, "benchmarks/results/bound.json")


def sensitivities() -> str:
    """What changes of the IRp-6's and the Panda's problems bring, found beside the design and from scratch."""
    rows = []
    for study in result("results/sensitivity")["robots"]:
        name = {"irp6": "IRp-6", "panda": "Panda"}[study["robot"]]
        for row in study["rows"]:
            if row["from_scratch"] is None and row["gain"] < 0.01:
                continue
            searched = "" if row["from_scratch"] is None else percent(1 - row["from_scratch"] / study["reference"])
            rows.append((name, row["change"].replace("panda_joint", ""), percent(row["gain"]), searched))
    head = ("robot", "change", "gain, improving the motion", "gain, searching from scratch")
    return table(head, rows, "benchmarks/results/sensitivity.json")


def choose_criterion() -> str:
    """What designing for one criterion costs in the others, in two robots."""
    studies = result("results/criteria")["studies"]
    cells: dict[str, list[str]] = {}
    for study in studies.values():
        values = study["values"]
        best = {goal: min(row[goal] for row in values.values()) for goal in values}
        for goal, row in values.items():
            lost = [row[other] / best[other] for other in values]
            cells.setdefault(goal, []).extend([f"{geometric_mean(lost):.2f}", f"{max(lost):.2f}"])
    head = ["designed for"]
    for name in studies:
        robot = {"irp6": "IRp-6", "P1": "Panda"}[name]
        head += [f"{robot}: mean", f"{robot}: most"]
    return table(head, [(goal, *row) for goal, row in cells.items()], "benchmarks/results/criteria.json")


def choose_interest() -> str:
    """What designs for some parameters or for torques gain over plain ones, in two robots."""
    rows = []
    for name, study in result("results/chosen_parameters")["studies"].items():
        values = study["values"]
        robot = {"irp6": "IRp-6", "P1": "Panda"}[name]
        for goal in [goal for goal in values if goal not in ("condition", "logdet", "trace")]:
            reached = [values[other][goal] / values["condition"][goal] for other in (goal, "trace", "logdet")]
            rows.append((robot, goal, *(f"{value:.2f}" for value in reached)))
    head = ("robot", "deviation, over that of `condition`", "designed for it", "`trace`", "`logdet`")
    return table(head, rows, "benchmarks/results/chosen_parameters.json")


def choose_torque_limit() -> str:
    """Robots of a box that break a torque limit, for designs with several reserves."""
    rows = [
        (row["limit"], f"{row['condition_number']:.3g}", *row["broken"].values())
        for row in result("results/chosen_parameters")["limits"]
    ]
    head = ("torque limits", "cond(W)", "of 200 robots off by 10 %, break one", "off by 20 %")
    return table(head, rows, "benchmarks/results/chosen_parameters.json")


def interval_coverage() -> str:
    """How often intervals hold the truth with plain defaults."""
    cases = [case for case in result("coverage/results/coverage")["cases"] if case["name"].startswith("plain defaults")]
    rows = []
    for case in cases:
        worst = min(case["coverage"])
        mean = sum(case["coverage"]) / len(case["coverage"])
        rows.append((case["name"], case["repetitions"], f"{100 * mean:.1f} %", f"{100 * worst:.1f} %"))
    head = ("simulated experiment", "repetitions", "in the 99 % interval, mean", "worst parameter")
    return table(head, rows, "benchmarks/coverage/results/coverage.json")


def public() -> str:
    """All systems with the same limits and processor time, judged by one program."""
    head, _, *rows = (line.strip("| ").split(" | ") for line in claims.public().splitlines())
    return table(head, rows, "benchmarks/results/public.json")


def which_designs() -> str:
    """Designs of the public benchmark by this program and others that were measured so, medians of the seeds."""
    runs = result("results/public")["runs"]
    said = {"excite": "this program", "figaroh": "figaroh", "slsqp": "SLSQP, finite differences"}
    problems = {"IRp-6": "IRp-6, 3 axes", "P1": "P1: Panda", "P2": "P2: UR10"}
    rows = [
        (
            problems[case],
            words,
            f"{statistics.median(each['condition_number'] for each in verdicts):.1f}",
            f"{statistics.median(each['robot_seconds'] for each in verdicts):.0f}",
            "yes"
            if all(each["limits_kept"] for each in verdicts)
            else f"exceeded by {percent(max(each['limit_use_as_delivered'] for each in verdicts) - 1)}",
        )
        for case in problems
        for system, words in said.items()
        for verdicts in ([r["verdict"] for r in runs if (r["case"], r["system"]) == (case, system)],)
    ]
    head = ("problem", "system", "cond(W)", "robot time to 5 % [s]", "limits kept")
    return table(head, rows, "benchmarks/results/public.json")


def which_servos() -> str:
    """Errors of predicted motion of unseen logs, mean over the five joints of the arm."""
    runs = result("results/servo_rivals")["runs"]
    systems = ("excite", "mujoco.sysid, 3 rounds", "mujoco.sysid, 20 rounds")
    found = {(run["unseen"], run["by"]): 1e3 * statistics.mean(run["error"][:5]) for run in runs}
    logs = list(dict.fromkeys(run["unseen"] for run in runs))
    rows = [(log, *(f"{found[log, system]:.1f}" for system in systems)) for log in logs]
    seconds = [f"{statistics.median(run['cpu'] for run in runs if run['by'] == each):.0f}" for each in systems]
    head = ("unseen log, error [mrad]", "this program", *systems[1:])
    return table(head, [*rows, ("CPU s, median", *seconds)], "benchmarks/results/servo_rivals.json")


def sooner() -> str:
    """How much sooner than an afternoon's rivals their own best values are reached, median and least."""
    comparisons = {(each["rival"], each["case"]): each for each in result("results/afternoon")["comparisons"]}
    rivals = {
        "ipopt": "CasADi and IPOPT, exact gradients",
        "slsqp-exact": "SLSQP, the same gradients",
        "slsqp": "SLSQP, finite differences",
    }
    cases = {"IRp-6": "IRp-6", "P1": "Panda (P1)", "P2": "UR10 (P2)", "ur10e": "UR10e"}
    rows = []
    for rival, name in rivals.items():
        ratios = [comparisons[rival, case]["ratios_to_best"] for case in cases]
        rows.append((name, *(f"{statistics.median(each):.1f} ({min(each):.1f})" for each in ratios)))
    head = ("times sooner at the best that the rival reaches in 30 s: median (least)", *cases.values())
    return table(head, rows, "benchmarks/results/afternoon.json")


TABLES: dict[str, Callable[[], str]] = {
    "public": public,
    "sooner": sooner,
    "which-designs": which_designs,
    "which-servos": which_servos,
    "paper-conditions": paper_conditions,
    "paper-estimates": paper_estimates,
    "paper-screws": paper_screws,
    "paper-models": paper_models,
    "paper-break-away": paper_break_away,
    "paper-figure-5": paper_figure_5,
    "paper-table-1": paper_table_1,
    "paper-figure-15": paper_figure_15,
    "paper-motions": paper_motions,
    "paper-verification": paper_verification,
    "bound": bounds,
    "sensitivity": sensitivities,
    "choose-model": choose_model,
    "choose-criterion": choose_criterion,
    "choose-interest": choose_interest,
    "choose-torque-limit": choose_torque_limit,
    "interval-coverage": interval_coverage,
}


def filled(text: str) -> str:
    """Text of a page with all its tables made anew."""
    return _PLACE.sub(lambda place: f"{place[1]}{TABLES[place['name']]()}\n", text)


def pages() -> list[Path]:
    """Pages that have tables."""
    every = (DOCS.parent / "README.md", *sorted(DOCS.rglob("*.md")))
    return [page for page in every if _PLACE.search(page.read_text(encoding="utf-8"))]


def outdated() -> list[Path]:
    """Pages whose tables differ from the results."""
    return [page for page in pages() if filled(page.read_text(encoding="utf-8")) != page.read_text(encoding="utf-8")]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="tell which pages are not current, and write nothing")
    stale = outdated()
    if parser.parse_args().check:
        print("\n".join(f"not current: {page}" for page in stale))
        sys.exit(1 if stale else 0)
    for page in stale:
        text = filled(page.read_text(encoding="utf-8"))
        beside = page.with_suffix(".tmp")
        beside.write_text(text, encoding="utf-8")
        beside.replace(page)
