"""Design problems and their solvers: never outside the limits, always better than the start, the same every time."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.optimize import LinearConstraint, linprog, minimize

from constraints.certificate import limit_uses
from constraints.linear import LinearConstraint as Limits
from excite.design.formulation import formulate
from excite.design.initial_guesses import candidates, combinations, promising_motion, random_motion
from excite.design.problem import Problem
from excite.design.solvers.descent import SqpOptions
from excite.design.solvers.solver import Attempt, Solver, SolverResult, Status, Watcher
from excite.design.solvers.sqp import SequentialQuadratic
from excite.registry import instance
from excite.tasks.criteria import ConditionNumber
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from regressors.readers.library import built_in
from regressors.samples import Array

SEED = st.integers(0, 2**32 - 1)
QUICK = SequentialQuadratic(SqpOptions(iterations=6))


@cache
def _problem() -> Problem:
    """The IRp-6's first three axes, 13 parameters, friction and drive limits."""
    return formulate(built_in("irp6"), Task("irp6")).problem


@pytest.fixture
def problem() -> Problem:
    return _problem()


def start(problem: Problem, seed: int = 0) -> Array:
    return random_motion(problem, np.random.default_rng(seed))


def constraints(problem: Problem) -> list[Limits]:
    return [limit.function.constraint for limit in problem.limits.linear]


def excess(problem: Problem, x: Array) -> float:
    """Worst excess over any limit over continuous time, as part of its bound."""
    trajectory = Trajectory(problem.family, x)
    uses = [use for limit in constraints(problem) for use in limit_uses(limit, trajectory.extrema(limit))]
    return max(-use.margin / abs(use.bound) for use in uses)


def value_of(problem: Problem, x: Array) -> float:
    return problem.criterion_value(problem.point(x, problem.criterion.stages[-1]))


# --- the problem's limits --------------------------------------------------------------------------------------------


@given(SEED)
@settings(max_examples=20)
def test_what_keeps_the_grid_keeps_the_limits_at_all_times(seed: int) -> None:
    """Pushed until the grid's tightened bounds are reached: exact extrema stay within the true ones, and near them."""
    problem = _problem()
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=problem.shape)
    x = problem.rest + problem.longest_step(problem.rest, direction) * direction
    assert abs(problem.violation(x)) <= 1e-9
    assert -2e-3 <= excess(problem, x) <= 1e-12


@given(SEED, st.floats(0.1, 3.0))
@settings(max_examples=20)
def test_longest_step_ends_where_a_limit_begins(seed: int, scale: float) -> None:
    problem = _problem()
    x = start(problem, seed)
    direction = np.random.default_rng(seed + 1).normal(size=problem.shape)
    step = problem.longest_step(x, direction)
    assert problem.longest_step(x, scale * direction) == pytest.approx(step / scale)
    assert problem.violation(x + 0.999999 * step * direction) < 0 < problem.violation(x + 1.000001 * step * direction)
    assert problem.longest_step(x, 0 * direction) == np.inf


def test_rows_are_the_jacobian_of_the_values(problem: Problem) -> None:
    x = start(problem)
    for limit in problem.limits.linear_in_x:
        k, N = limit.values(x).shape
        function, instant = np.arange(2 * k) % k, np.arange(2 * k) * 7 % N
        found, expected = limit.tangent(x)(function, instant) @ x.ravel(), limit.values(x)[function, instant]
        np.testing.assert_allclose(found, expected, atol=1e-12)


# --- starts ----------------------------------------------------------------------------------------------------------


def test_starts_are_inside_and_repeatable(problem: Problem) -> None:
    for seed in range(10):
        x = start(problem, seed)
        assert excess(problem, x) < 0
        assert x.tobytes() == start(problem, seed).tobytes()
        assert x.tobytes() != start(problem, seed + 1).tobytes()
        assert np.all(np.ptp(Trajectory(problem.family, x).sampled(50.0).q, axis=0) > 0)  # every joint moves


def test_promising_start_is_the_best_of_its_trials(problem: Problem) -> None:
    rng = np.random.default_rng(4)
    motions = [random_motion(problem, rng) for _ in range(6)]
    values = [problem.point(x, 1.0).value for x in motions]
    found = promising_motion(problem, np.random.default_rng(4), trials=6)
    np.testing.assert_array_equal(found, motions[int(np.argmin(values))])


# --- solvers ---------------------------------------------------------------------------------------------------------


def watched(method: Solver, problem: Problem, *starts: Array) -> tuple[SolverResult, list[Array], list[float]]:
    """What a method ends with, and the points and values that it told; none of the points is outside a limit."""
    points, values = list[Array](), list[float]()

    def watch(x: Array, value: float) -> None:
        points.append(x.copy())
        values.append(value)

    found = method.solve(problem, starts, watch)
    assert max(excess(problem, x) for x in (*points, found.x)) <= 1e-12
    return found, points, values


def test_every_iterate_is_inside_all_limits_and_the_best_is_returned(problem: Problem) -> None:
    x = start(problem, 1)
    before = x.copy()
    found, points, values = watched(QUICK, problem, x)
    assert len(points) > 4
    assert values == [value_of(problem, point) for point in points] == found.history
    assert found.value == min(values) == value_of(problem, found.x)
    assert values[0] == value_of(problem, x)
    assert found.value < 0.9 * values[0]
    assert found.evaluations > 0
    assert isinstance(found.status, Status)
    np.testing.assert_array_equal(x, before)


@pytest.mark.slow
def test_of_several_starts_nothing_better_is_thrown_away(problem: Problem) -> None:
    starts = [start(problem, seed) for seed in (20, 21, 22)]
    found, _, values = watched(QUICK, problem, *starts)
    assert found.value == value_of(problem, found.x) == min(found.history) == min(values)
    assert found.value <= min(value_of(problem, x) for x in starts)


@pytest.mark.slow
def test_a_start_on_the_border_is_left(problem: Problem) -> None:
    """Pushed to a limit, so that the first step has no room in some directions."""
    inside, direction = start(problem, 7), np.random.default_rng(7).normal(size=problem.shape)
    x = inside + problem.longest_step(inside, direction) * direction
    assert watched(QUICK, problem, x)[0].value < 0.9 * value_of(problem, x)


def with_one_stage(problem: Problem, sharpness: float) -> Problem:
    """The same problem, solved for one stand-in of its criterion."""

    class OneStage(ConditionNumber):
        stages = (sharpness,)

    return dataclasses.replace(problem, objective=dataclasses.replace(problem.objective, criterion=OneStage()))


def test_sqp_descends_with_every_step_of_a_stage(problem: Problem) -> None:
    changed = with_one_stage(problem, 8.0)
    for seed in range(3):
        _, points, _ = watched(SequentialQuadratic(SqpOptions(iterations=30)), changed, start(problem, seed))
        objective = [changed.point(x, 8.0).value for x in points]
        assert len(objective) > 5
        assert np.all(np.diff(objective) <= 0)


def test_sqp_stays_inside_even_if_its_programme_misses_limits(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A single programme that starts without any row: its steps leave the limits, the iterates must not."""
    monkeypatch.setattr("excite.design.solvers.descent._NEAR", 10.0)
    monkeypatch.setattr("excite.design.solvers.descent._ROUNDS", 1)
    x = start(problem, 1)
    found, _, _ = watched(SequentialQuadratic(SqpOptions(iterations=10)), problem, x)
    assert found.value < value_of(problem, x)


def limit_rows(problem: Problem, x: Array, spacing: int) -> tuple[Array, ...]:
    """Rows of all limits at some instants, their values at a motion, and their bounds."""
    parts = []
    for limit in problem.limits.linear_in_x:
        values = limit.values(x)
        k, N = values.shape
        function, instant = (i.ravel() for i in np.meshgrid(np.arange(k), np.arange(0, N, spacing), indexing="ij"))
        rows = limit.tangent(x)(function, instant)
        parts.append((rows, values[function, instant], limit.lower[function], limit.upper[function]))
    return tuple(map(np.concatenate, zip(*parts, strict=True)))


def linear_descent(problem: Problem, x: Array, sharpness: float, radius: float) -> float:
    """Largest decrease of the objective's linearisation within all limit rows and a box about x; one LP."""
    g = problem.gradient(problem.point(x, sharpness)).ravel()
    rows, at, lower, upper = limit_rows(problem, x, 4)
    room = np.maximum(np.concatenate([upper - at, at - lower]), 0.0)
    return -float(linprog(g, A_ub=np.vstack([rows, -rows]), b_ub=room, bounds=[(-radius, radius)] * g.size).fun)


def test_sqp_ends_where_no_step_within_the_limits_descends(problem: Problem) -> None:
    """First-order optimality by a linear programme, which knows nothing of the solver's working set or Hessian."""
    x, last = start(problem, 11), problem.criterion.stages[-1]
    found = instance("solver", "sqp").solve(problem, [x])
    assert found.status in (Status.CONVERGED, Status.NO_DESCENT)
    assert linear_descent(problem, found.x, last, 0.01) < 0.1 * linear_descent(problem, x, last, 0.01)
    once = SequentialQuadratic(SqpOptions(iterations=1))
    assert once.solve(problem, [x]).status is Status.ITERATION_LIMIT


def slsqp(problem: Problem, x: Array, sharpness: float) -> Array:
    """Where SciPy's SLSQP takes the smooth objective within every second row of the limits."""
    rows, _, lower, upper = limit_rows(problem, x, 2)
    within = LinearConstraint(rows, lower, upper)

    def value(flat: Array) -> tuple[float, Array]:
        point = problem.point(flat.reshape(x.shape), sharpness)
        return point.value, problem.gradient(point).ravel()

    found = minimize(value, x.ravel(), jac=True, method="SLSQP", constraints=[within], options={"maxiter": 200})
    return np.asarray(found.x.reshape(x.shape))


@pytest.mark.slow
def test_it_ends_as_low_as_slsqp() -> None:
    """The best of three starts each, by the smooth objective of the last stage."""
    some = formulate(built_in("irp6"), Task("irp6", harmonics=2)).problem
    starts, last = [random_motion(some, np.random.default_rng(seed)) for seed in (1, 2, 3)], some.criterion.stages[-1]
    ours = [instance("solver", "sqp").solve(some, [x]).x for x in starts]
    assert max(map(some.violation, ours)) <= 1e-12
    best = min(some.point(slsqp(some, x, last), last).value for x in starts)
    assert min(some.point(x, last).value for x in ours) < 1.01 * best


OPTIONS: dict[str, dict[str, object]] = {
    "differential": {},
    "energy": {"model": "energy", "window": "long"},
    "orthonormal, torques": {"base": "orthonormal", "torque_margin": 0.3},
    "weighted": {"noise": (1.0, 2.0, 3.0), "weighted": True},
    "nonlinear family": {"trajectory": "sines", "harmonics": 2},
    "other criterion": {"criterion": "max-deviation"},
}

LONG = {"nonlinear family", "other criterion"}


def attempts(problem: Problem) -> list[Attempt]:
    guesses = [candidates(problem, k, np.random.default_rng(k)) for k in range(2)]
    known = [guesses[0][0], guesses[1][0]]
    return [
        Attempt("solve", guesses[0][:3]),
        Attempt("combine", combinations(problem, known, np.random.default_rng(0), 3), known),
        Attempt("solve", guesses[1][:1]),
        Attempt("refine", [guesses[1][0]]),
    ]


def in_order(method: Solver, problem: Problem, some: Sequence[Attempt]) -> list[SolverResult]:
    return [result for _, result in sorted(method.attempt(problem, some), key=lambda numbered: numbered[0])]


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


def test_points_and_gradients_together_are_those_one_by_one(problem: Problem) -> None:
    rng = np.random.default_rng(1)
    xs = [problem.rest + 0.1 * rng.normal(size=problem.shape) for _ in range(40)]
    sharpness = [1.0, 4.0, 16.0, 64.0] * 10
    points = problem.points(xs, sharpness)
    assert [point.value for point in points] == [problem.point(x, p).value for x, p in zip(xs, sharpness, strict=True)]
    for point, g in zip(points[::3], problem.gradients(points[::3]), strict=True):
        np.testing.assert_array_equal(g, problem.gradient(point))


class OneByOne(Solver):
    def solve(self, problem: Problem, starts: Sequence[Array], watch: Watcher | None = None) -> SolverResult:
        return QUICK.solve(problem, starts, watch)


def test_other_solvers_make_attempts_one_after_the_other() -> None:
    problem = formulate(built_in("irp6"), Task("irp6", harmonics=3)).problem
    some = [attempts(problem)[k] for k in (2, 1, 3)]
    results = list(OneByOne().attempt(problem, some))
    assert [k for k, _ in results] == [0, 1, 2]
    assert all(np.isfinite(result.value) for _, result in results)
