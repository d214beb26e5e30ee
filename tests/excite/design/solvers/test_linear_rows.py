"""Limits that are linear in x as one array, against each limit by itself, and peaks against a slow search."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from excite.design.formulation import formulate
from excite.design.problem import Problem
from excite.design.solvers.limit_rows import LinearRows, largest_part, local_maxima
from excite.tasks.task import Task
from regressors.readers.library import built_in


@pytest.fixture(scope="module")
def problem() -> Problem:
    """Drive 3 of the IRp-6 couples joints 2 and 3, so that rows depend on two coordinates."""
    return formulate(built_in("irp6"), Task("irp6")).problem


@pytest.fixture(scope="module")
def rows(problem: Problem) -> LinearRows:
    return LinearRows(problem.limits.linear_in_x, problem.shape)


def test_values_are_those_of_each_limit(problem: Problem, rows: LinearRows) -> None:
    x = problem.rest + 0.3 * np.random.default_rng(0).normal(size=problem.shape)
    expected = [
        (limit.values(x) - 0.5 * (limit.upper + limit.lower)[:, None]) / (0.5 * (limit.upper - limit.lower)[:, None])
        for limit in problem.limits.linear_in_x
    ]
    np.testing.assert_allclose(rows.values(x), np.concatenate(expected), rtol=1e-12, atol=1e-12)


def test_rows_times_a_step_are_its_changes(problem: Problem, rows: LinearRows) -> None:
    step = np.random.default_rng(1).normal(size=problem.rest.size)
    changes = rows.changes(step)
    flat = np.random.default_rng(2).choice(changes.size, 50, replace=False)
    np.testing.assert_allclose(rows.rows(flat) @ step, changes.ravel()[flat], rtol=1e-12, atol=1e-12)
    x = problem.rest + step.reshape(problem.shape)
    np.testing.assert_allclose(rows.values(x) - rows.values(problem.rest), changes, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("small", [0, 100**2])
def test_products_are_those_of_the_rows(
    problem: Problem, rows: LinearRows, small: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("excite.design.solvers.limit_rows._SMALL", small)
    rng = np.random.default_rng(3)
    J = rng.normal(size=(problem.rest.size, 7))
    flat = rng.choice(rows.count, 40, replace=False)
    here = rows.rows(flat)
    np.testing.assert_allclose(rows.products(flat, here, J), here @ J, rtol=1e-11, atol=1e-11)


def test_bounded_rows_end_at_the_bound(problem: Problem, rows: LinearRows) -> None:
    """A step to a side of the programme uses the bound as stated, or does not change a value beyond it."""
    x = problem.rest + 0.3 * np.random.default_rng(0).normal(size=problem.shape)
    flat = np.arange(0, rows.count, 17)
    given_rows, lower, upper = rows.bounded(np.tile(x.ravel(), (flat.size, 1)), flat, 0.9)
    here = rows.values(x).ravel()[flat]
    np.testing.assert_array_equal(given_rows, rows.rows(flat))
    np.testing.assert_allclose(here + upper, np.maximum(here, 0.9), rtol=1e-9)
    np.testing.assert_allclose(here + lower, np.minimum(here, -0.9), rtol=1e-9)


@pytest.mark.parametrize("threshold", [0.3, 0.7, 0.9995])
def test_peaks_are_the_local_maxima_at_all_instants(problem: Problem, rows: LinearRows, threshold: float) -> None:
    rng = np.random.default_rng(5)
    xs = [problem.rest + part * rng.normal(size=problem.shape) for part in (0.01, 0.1, 0.3, 1.0)]
    which, flat, outside = rows.peaks(np.array([x.ravel() for x in xs]), threshold)
    assert np.all(np.diff(which) >= 0)
    assert which.size >= 10
    for k, x in enumerate(xs):
        use = np.abs(rows.values(x))
        here = np.sort(flat[which == k])
        assert np.unique(here).tolist() == here.tolist() == local_maxima(use, threshold).tolist()
        assert outside[which == k].any() == (use.max() > 1.0)


def test_the_largest_part_of_a_change_ends_at_the_bound() -> None:
    at, change = np.array([[0.2, -0.4], [0.0, 0.9]]), np.array([[1.6, -0.3], [0.0, 0.0]])
    assert largest_part(at, change) == pytest.approx(0.5)
    assert largest_part(at, 0.1 * change) == 1.0
    assert largest_part(np.array([[1.0 + 1e-12]]), np.ones((1, 1))) == 0.0


@given(
    values=st.lists(st.lists(st.integers(0, 4), min_size=3, max_size=3), min_size=1, max_size=4),
    threshold=st.integers(-1, 4),
)
def test_peaks_are_where_both_neighbours_are_not_larger(values: list[list[int]], threshold: int) -> None:
    use = np.array(values, dtype=float).repeat(2, axis=1)
    expected = [
        k * use.shape[1] + i
        for k, row in enumerate(use)
        for i in range(len(row))
        if row[i] > threshold and row[i] >= row[i - 1] and row[i] >= row[(i + 1) % len(row)]
    ]
    assert local_maxima(use, float(threshold)).tolist() == expected
