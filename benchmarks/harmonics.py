"""Processor time of a start against the number of harmonics, and the exponent of its growth."""

from __future__ import annotations

import json
import statistics
import sys
from typing import Any

import numpy as np
import record
from measure import script
from problems import FREE_SPACE, PERIOD, PROBLEMS, RATE

from excite.design.formulation import formulate
from excite.design.starts import optimise_starts
from excite.registry import instance
from excite.tasks.task import Task
from regressors.readers.library import load_robot

ROBOTS = {"irp6": "IRp-6, 3 axes, 13 parameters", "P1": "Panda, 7 axes, 43 base parameters"}
HARMONICS, STARTS, FITTED_FROM = (5, 10, 15, 20, 30), 2, 10


def measured(robot: str, harmonics: int) -> dict[str, list[float]]:
    """Starts one after the other in this process, compiled before."""
    if robot in PROBLEMS:
        arm = PROBLEMS[robot].robot()
        task = Task(robot, friction=False, rotor=False, period=PERIOD, rate=RATE, harmonics=harmonics, **FREE_SPACE)
    else:
        arm, task = load_robot(robot), Task(robot, harmonics=harmonics, **FREE_SPACE)
    problem, method = formulate(arm, task).problem, instance("solver", "sqp")
    problem.gradient(problem.point(problem.rest, 1.0))
    results = [optimise_starts(problem, method, 0, [k], None)[0] for k in range(STARTS)]
    return {
        "cpu": [r.cpu for r in results],
        "evaluations": [float(r.evaluations) for r in results],
        "values": [r.value for r in results],
    }


def exponent(found: dict[int, dict[str, Any]], key: str) -> float:
    """Slope of the logarithm of the mean over that of the harmonics, by least squares."""
    some = [H for H in found if H >= FITTED_FROM]
    means = [statistics.mean(found[H][key]) for H in some]
    return float(np.polyfit(np.log(some), np.log(means), 1)[0])


LIMITATIONS = (
    f"mean of {STARTS} starts with seed 0, one thread; compilation is not counted",
    f"exponent: slope of log CPU over log harmonics from {FITTED_FROM} to {HARMONICS[-1]} by least squares",
    "a machine that others use at the same time: with many harmonics, a start waits for memory, and its processor time "
    "then depends on what else runs",
)


def main() -> None:
    """Every number of harmonics of both robots."""
    before, results, rows = record.load(), {}, []
    for robot, title in ROBOTS.items():
        found = {H: script("harmonics.py", {"robot": robot, "harmonics": H}, 1).result for H in HARMONICS}
        results[robot] = {
            "harmonics": found,
            "exponent": exponent(found, "cpu"),
            "of_evaluations": exponent(found, "evaluations"),
        }
        for key, name, form in (("cpu", "CPU s", ".2f"), ("evaluations", "evaluations", ".0f")):
            means = [format(statistics.mean(found[H][key]), form) for H in HARMONICS]
            rows.append([f"{title}: {name}", *means, f"**{exponent(found, key):.2f}**"])
    head = ["mean of a start; harmonics:", *map(str, HARMONICS), "exponent"]
    record.save("harmonics", before, results, record.table(head, rows), LIMITATIONS)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        print(json.dumps(measured(**json.loads(sys.argv[1]))))
    else:
        main()
