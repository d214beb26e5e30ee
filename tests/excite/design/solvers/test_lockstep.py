"""Descents in lockstep: each takes the same steps as by itself, whatever runs beside it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from excite.design.formulation import formulate
from excite.design.initial_guesses import candidates, combinations
from excite.design.problem import Problem
from excite.design.solvers.descent import SqpOptions
from excite.design.solvers.slsqp import Slsqp
from excite.design.solvers.solver import Attempt, Solver, SolverResult
from excite.design.solvers.sqp import SequentialQuadratic
from excite.tasks.task import Task
from regressors.readers.library import built_in

QUICK = SequentialQuadratic(SqpOptions(iterations=5))
OPTIONS: dict[str, dict[str, object]] = {
    "differential": {},
    "energy": {"model": "energy", "window": "long"},
    "orthonormal, torques": {"base": "orthonormal", "torque_margin": 0.3},
    "weighted": {"noise": (1.0, 2.0, 3.0), "weighted": True},
    "nonlinear family": {"trajectory": "sines", "harmonics": 2},
    "other criterion": {"criterion": "max-deviation"},
}

LONG = {"nonlinear family", "other criterion"}


def attempts(problem: Problem, watch: object = None) -> list[Attempt]:
    rng = np.random.default_rng(0)
    guesses = [candidates(problem, k, np.random.default_rng(k)) for k in range(2)]
    known = [guesses[0][0], guesses[1][0]]
    return [
        Attempt("solve", guesses[0][:3]),
        Attempt("combine", combinations(problem, known, rng, 3), known),
        Attempt("solve", guesses[1][:1]),
        Attempt("refine", [guesses[1][0]]),
    ]


def in_order(method: Solver, problem: Problem, some: Sequence[Attempt]) -> list[SolverResult]:
    results = dict(method.attempt(problem, some))
    return [results[k] for k in range(len(some))]


@pytest.mark.parametrize(
    "case", [pytest.param(case, marks=pytest.mark.slow) if case in LONG else case for case in OPTIONS]
)
def test_what_runs_beside_a_descent_changes_no_bit(case: str) -> None:
    problem = formulate(built_in("irp6"), Task("irp6", **OPTIONS[case])).problem
    together = in_order(QUICK, problem, attempts(problem))
    for beside, one in zip(together, attempts(problem), strict=True):
        (alone,) = in_order(QUICK, problem, [one])
        np.testing.assert_array_equal(beside.x, alone.x)
        assert (beside.value, beside.status, beside.history) == (alone.value, alone.status, alone.history)
        assert beside.evaluations == alone.evaluations


def test_points_and_gradients_together_are_those_one_by_one() -> None:
    problem = formulate(built_in("irp6"), Task("irp6")).problem
    rng = np.random.default_rng(1)
    xs = [problem.rest + 0.1 * rng.normal(size=problem.shape) for _ in range(40)]
    sharpness = [1.0, 4.0, 16.0, 64.0] * 10
    points = problem.points(xs, sharpness)
    gradients = problem.gradients(points[::3])
    for x, p, point in zip(xs, sharpness, points, strict=True):
        assert point.value == problem.point(x, p).value
    for point, g in zip(points[::3], gradients, strict=True):
        np.testing.assert_array_equal(g, problem.gradient(point))


def test_other_solvers_make_attempts_one_after_the_other() -> None:
    problem = formulate(built_in("irp6"), Task("irp6", harmonics=3)).problem
    some = [attempts(problem)[k] for k in (2, 1, 3)]
    results = list(Slsqp(iterations=3).attempt(problem, some))
    assert [k for k, _ in results] == [0, 1, 2]
    assert all(np.isfinite(result.value) for _, result in results)
