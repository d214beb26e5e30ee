"""Limits that are linear in x as one array, against each limit by itself, and peaks against a slow search."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from excite.design.formulation import formulate
from excite.design.problem import Problem
from excite.design.solvers.linear_rows import LinearRows, peaks
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
    monkeypatch.setattr("excite.design.solvers.linear_rows._SMALL", small)
    rng = np.random.default_rng(3)
    J = rng.normal(size=(problem.rest.size, 7))
    flat = rng.choice(rows.count, 40, replace=False)
    np.testing.assert_allclose(rows.products(flat, J), rows.rows(flat) @ J, rtol=1e-11, atol=1e-11)


def test_bounded_rows_end_at_the_bound(problem: Problem, rows: LinearRows) -> None:
    """A step to a side of the programme uses the bound as stated, or does not change a value beyond it."""
    at = rows.values(problem.rest + 0.3 * np.random.default_rng(0).normal(size=problem.shape))
    flat = np.arange(0, rows.count, 17)
    _, lower, upper = rows.bounded(at, flat, np.eye(problem.rest.size), 0.9)
    here = at.ravel()[flat]
    np.testing.assert_allclose(here + upper, np.maximum(here, 0.9))
    np.testing.assert_allclose(here + lower, np.minimum(here, -0.9))


def test_uses_are_sizes_after_a_step(problem: Problem, rows: LinearRows) -> None:
    step = np.random.default_rng(1).normal(size=problem.shape)
    at = rows.values(problem.rest)
    np.testing.assert_allclose(rows.uses(at, step), np.abs(rows.values(problem.rest + step)), rtol=1e-9, atol=1e-9)


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
    assert peaks(use, float(threshold)).tolist() == expected
