"""This project: the search that ``excite design`` makes by default, in one process."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from baseline_slsqp import SPACING, SpentError, spent
from cases import case
from judge import Array
from problems import HARMONICS, PERIOD, PROBLEMS, RATE

if TYPE_CHECKING:
    from excite.design.formulation import Formulation
    from excite.design.problem import Problem
    from excite.design.solvers.solver import Attempt, SolverResult
    from regressors.robot.robot import Robot

_COMMON = {"period": PERIOD, "harmonics": HARMONICS, "rate": RATE, "executor": "serial"}
_LIMITS = {"torque_margin": "none", "self_collision": False, "floor": "none"}
_ARM = {"base": "gautier", "friction": False, "rotor": False}
_BUILT_IN = {"IRp-6": "irp6", "ur10e": "ur10e"}


def formulated(wanted: Mapping[str, Any]) -> tuple[Robot, Formulation]:
    """The robot of a case, and the case as ``excite design`` states it."""
    from excite.design.formulation import formulate
    from excite.tasks.task import Task
    from regressors.readers.library import load_robot

    name = wanted["case"]
    if name in PROBLEMS:
        robot = PROBLEMS[name].robot()
        return robot, formulate(robot, Task(name, seed=wanted["seed"], **_COMMON, **_LIMITS, **_ARM))
    robot = load_robot(_BUILT_IN[name])
    if name == "ur10e":  # whose maker states no accelerations
        robot = robot.replace(limits=replace(robot.limits, acceleration=case(name).limits[2][2]))
    return robot, formulate(robot, Task(_BUILT_IN[name], seed=wanted["seed"], **_COMMON, **_LIMITS))


def motion(wanted: Mapping[str, Any]) -> dict[str, Any]:
    """The best motion of the search; it ends by itself, and ``cpu`` is only compared with what it took."""
    from excite.design.optimisation import solve

    robot, formulation = formulated(wanted)
    with tempfile.TemporaryDirectory() as folder:
        design = solve(robot, formulation, Path(folder))
    found = design.trajectory
    return {"trajectory": found.family.to_dict(found.x), "starts": len(design.starts)}


def course(wanted: Mapping[str, Any]) -> dict[str, Any]:
    """Time and motion of every iterate of that search, which goes on until the time is spent, and values of starts."""
    from excite.design.search_rounds import Rounds
    from excite.design.solvers.sqp import SequentialQuadratic
    from excite.design.starts import optimise_starts

    (_, formulation), kept = formulated(wanted), list[tuple[float, Any]]()
    problem, search = formulation.problem, formulation.task.search
    information, family = problem.information, problem.family

    def watch(x: Array, value: float) -> None:
        now = spent()
        if now > wanted["cpu"]:
            raise SpentError
        if not kept or now - kept[-1][0] > SPACING:
            kept.append((now, x.copy()))

    class Watched(SequentialQuadratic):
        def attempt(self, problem: Problem, attempts: Sequence[Attempt]) -> Iterator[tuple[int, SolverResult]]:
            return super().attempt(problem, [replace(one, watch=watch) for one in attempts])

    rounds, results, values = Rounds(replace(search, rounds=10**6)), [], list[float]()
    with suppress(SpentError):
        while True:
            starts = rounds.following(results)
            results = optimise_starts(problem, Watched(), search.seed, starts, None)
            kept += [(spent(), np.array(result.coefficients)) for result in results]
            values += [result.value for result in results if not result.parents]
    motions = [(cpu, family.to_dict(information.trajectory(x).x)) for cpu, x in kept]
    return {"motions": motions, "values": values}
