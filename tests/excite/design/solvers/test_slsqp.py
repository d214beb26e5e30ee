"""SciPy's SLSQP as a solver: inside all limits at all times, as good as the fast solver, refused where it must be."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import excite
from constraints.certificate import limit_uses
from excite.design.formulation import formulate
from excite.design.initial_guesses import random_motion
from excite.design.problem import Problem
from excite.design.solvers.slsqp import Slsqp, _Rows
from excite.design.solvers.solver import Status
from excite.registry import SOLVERS, instance
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from regressors.errors import InputError
from regressors.readers.library import built_in
from regressors.samples import Array


@cache
def problem() -> Problem:
    """The IRp-6's first three axes and two harmonics: 9 coefficients."""
    return formulate(built_in("irp6"), Task("irp6", harmonics=2)).problem


def start(seed: int) -> Array:
    return random_motion(problem(), np.random.default_rng(seed))


def excess(x: Array) -> float:
    """Worst excess over any limit over continuous time, as part of its bound."""
    trajectory = Trajectory(problem().family, x)
    limits = [limit.function.constraint for limit in problem().limits.linear]
    uses = [use for limit in limits for use in limit_uses(limit, trajectory.extrema(limit))]
    return max(-use.margin / abs(use.bound) for use in uses)


def test_registered() -> None:
    assert Slsqp.name in SOLVERS
    assert type(instance("solver", Slsqp.name)) is Slsqp


@pytest.mark.slow
@pytest.mark.parametrize("harmonics", [2, 3])
def test_it_comes_within_five_percent_of_the_fast_solver(harmonics: int) -> None:
    """The best of three starts each; neither leaves the limits."""
    some = formulate(built_in("irp6"), Task("irp6", harmonics=harmonics)).problem
    starts = [random_motion(some, np.random.default_rng(seed)) for seed in (1, 2, 3)]
    best = {}
    for name in ("sqp", Slsqp.name):
        solver = instance("solver", name)
        results = [solver.solve(some, [x]) for x in starts]
        assert max(some.violation(result.x) for result in results) <= 1e-12
        best[name] = min(result.value for result in results)
    assert best[Slsqp.name] < 1.05 * best["sqp"]


def test_every_point_is_inside_and_the_best_is_returned() -> None:
    seen: list[tuple[Array, float]] = []
    x = start(1)
    before = x.copy()
    result = Slsqp().solve(problem(), [x], lambda point, value: seen.append((point.copy(), value)))
    assert len(seen) > 4
    assert max(excess(point) for point, _ in seen) <= 1e-12
    assert result.history == [value for _, value in seen]
    assert result.value == min(result.history) < 0.9 * result.history[0]
    assert isinstance(result.status, Status)
    assert result.evaluations > 0
    np.testing.assert_array_equal(x, before)


def test_the_same_start_gives_the_same_bytes() -> None:
    first, second = (Slsqp(iterations=10).solve(problem(), [start(2)]) for _ in range(2))
    assert first.x.tobytes() == second.x.tobytes()
    assert first.history == second.history


def test_the_iteration_limit_is_told() -> None:
    assert Slsqp(iterations=1, rounds=1).solve(problem(), [start(1)]).status is Status.ITERATION_LIMIT


def test_rows_are_the_limits_values_over_their_scale() -> None:
    rows, x = _Rows(problem()), start(3)
    assert rows.add(x, 0.1)
    assert not rows.add(x, 0.1)
    (constraint,) = rows.constraints()
    room = constraint["fun"](x.ravel())
    least = min(float((1.0 - limit.uses(limit.values(x))).min()) for limit in problem().limits.linear_in_x)
    assert room.min() == pytest.approx(least, abs=1e-12)
    step = 0.01 * np.random.default_rng(4).normal(size=x.size)
    np.testing.assert_allclose(constraint["fun"](x.ravel() + step) - room, constraint["jac"](x) @ step, atol=1e-12)


def test_by_name() -> None:
    task = excite.Task("irp6", harmonics=2, starts=1, executor="serial", solver="slsqp")
    design = excite.design_trajectory(task)
    assert design.feasible
    assert design.condition_number < 130


@pytest.mark.parametrize("options", [{"torque_margin": 0.2}, {"trajectory": "waypoints"}])
def test_limits_that_are_not_linear_are_refused(options: dict[str, object]) -> None:
    with pytest.raises(InputError, match="not for slsqp"):
        excite.design_trajectory(Task("irp6", starts=1, executor="serial", solver="slsqp", **options))
