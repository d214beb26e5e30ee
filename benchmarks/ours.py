"""This project at work in a process of its own: a specification in JSON comes in as argument, a result goes out.

``{"mode": "search" | "starts" | "target" | "setup", "problem": "P1", "convention": "gautier", ...}``; ``task`` in it
holds further options of the task. Used by the other scripts, which measure this process from outside.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from problems import CONVENTIONS, FREE_SPACE, HARMONICS, PERIOD, PROBLEMS, RATE

if TYPE_CHECKING:
    from excite.design.formulation import Formulation
    from excite.design.problem import Problem
    from excite.design.solvers.solver import Attempt, SolverResult
    from regressors.samples import Array

Specification = Mapping[str, Any]
_BASE = {"gautier": "gautier", "pivoted": "pivoted", "orthonormal": "orthonormal", "friction": "pivoted"}


def formulation(wanted: Specification) -> Formulation:
    """The design problem; with ``columns`` (names) given, cond(W) is that in these inertial columns."""
    from excite.design.formulation import formulate
    from excite.tasks.task import Task

    convention = str(wanted["convention"])
    task = Task(
        robot=wanted["problem"],
        base=_BASE.get(convention, "gautier"),
        friction=CONVENTIONS[convention],
        rotor=False,
        period=PERIOD,
        harmonics=HARMONICS,
        rate=RATE,
        starts=wanted.get("starts", 12),
        seed=wanted.get("seed", 0),
        executor=wanted.get("executor", "process"),
        **(FREE_SPACE | {name: _tuples(value) for name, value in wanted.get("task", {}).items()}),
    )
    made = formulate(PROBLEMS[wanted["problem"]].robot(), task)
    names = wanted.get("columns")
    if names is None:
        return made
    model = made.target.model
    friction = [column.name for column in model.columns if column.group == "friction"]
    chosen = [model.names.index(name) for name in (*names, *friction)]
    return replace(made, blueprint=replace(made.blueprint, transform=made.target.base.D[:, chosen]))


def _tuples(value: Any) -> Any:
    """Lists of JSON as tuples."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def search(wanted: Specification) -> dict[str, Any]:
    """The whole search on a pool of processes, and its files without figures, as ``excite design`` does it."""
    from excite.design.optimisation import solve

    made = formulation(wanted)
    with tempfile.TemporaryDirectory() as folder:
        starts = Path(folder) / "starts"
        starts.mkdir()
        design = solve(PROBLEMS[wanted["problem"]].robot(), made, starts)
        design.save(Path(folder) / "design")
    return {
        "trajectory": made.problem.family.to_dict(design.trajectory.x),
        "certified": design.feasible,
        "values": [start.value for start in design.starts],
        "cpu_of_starts": sum(start.cpu for start in design.starts),
        "search": asdict(design.search) if design.search is not None else None,
    }


def starts(wanted: Specification) -> list[dict[str, Any]]:
    """Single starts, each on its own, one after the other in this process."""
    from excite.design.starts import optimise_starts
    from excite.registry import instance

    made = formulation(wanted)
    problem, method = made.problem, instance("solver", "sqp")
    results = (optimise_starts(problem, method, made.task.search.seed, [k], None)[0] for k in range(wanted["starts"]))
    return [
        {"index": r.index, "value": r.value, "cpu": r.cpu, "trajectory": _plain(made, r.coefficients)} for r in results
    ]


class _Reached(Exception):
    def __init__(self, x: Array) -> None:
        super().__init__()
        self.x = x


def target(wanted: Specification) -> dict[str, Any]:
    """The search that is the default, in this process, until an iterate, judged at 100 Hz, is as good as the target."""
    made = formulation({**wanted, "starts": None})
    from excite.design.search_rounds import Rounds
    from excite.design.solvers.sqp import SequentialQuadratic
    from excite.design.starts import optimise_starts

    problem = made.problem
    ready = time.process_time()

    class Watched(SequentialQuadratic):
        def attempt(self, problem: Problem, attempts: Sequence[Attempt]) -> Iterator[tuple[int, SolverResult]]:
            return super().attempt(problem, [replace(one, watch=accepted) for one in attempts])

    def accepted(x: Array, value: float) -> None:
        if value <= 1.01 * wanted["target"] and problem.exact_value(x) <= 0.9995 * wanted["target"]:
            raise _Reached(x)

    method, rounds, results, ended = Watched(), Rounds(replace(made.task.search, rounds=10**6)), [], 0
    while time.process_time() < wanted["patience"]:
        starts = rounds.following(results)
        try:
            results = optimise_starts(problem, method, made.task.search.seed, starts, None)
        except _Reached as reached:
            end = time.process_time()
            return {"cpu": end, "cpu_set_up": ready, "starts": ended + 1, "trajectory": _plain(made, reached.x)}
        ended += len(starts)
    return {"cpu": None, "cpu_set_up": ready, "starts": ended, "trajectory": None}


def setup(wanted: Specification) -> dict[str, float]:
    """Processor time of the symbolic set-up of a built-in robot, imports (and the interpreter's start) apart."""
    import_module("excite.design.design")
    import_module("excite.design.solvers.sqp")
    from excite.design.formulation import formulate
    from excite.tasks.task import Task
    from regressors.readers.library import load_robot

    marks = [0.0, time.process_time()]
    robot = load_robot(wanted["robot"])
    marks.append(time.process_time())
    made = formulate(robot, Task(wanted["robot"]))
    marks.append(time.process_time())
    problem = made.problem
    x = problem.rest + 0.1 * np.random.default_rng(0).normal(size=problem.shape)
    problem.gradient(problem.point(x, 1.0))
    marks.append(time.process_time())
    steps = ("imports", "robot", "model, base parameters, value", "gradient")
    return dict(zip(steps, np.diff(marks).tolist(), strict=True))


def _plain(made: Formulation, x: Array) -> dict[str, Any]:
    problem = made.problem
    return problem.family.to_dict(problem.information.trajectory(x).x)


MODES = {"search": search, "starts": starts, "target": target, "setup": setup}

if __name__ == "__main__":
    asked = json.loads(sys.argv[1])
    print(json.dumps(MODES[asked["mode"]](asked)))
