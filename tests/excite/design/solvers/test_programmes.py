"""Programmes of the fast solver: the BFGS factor, programmes in whitened coordinates, limits as rows."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from excite.design.formulation import formulate
from excite.design.problem import Problem
from excite.design.solvers.descent import BfgsFactor
from excite.design.solvers.limit_rows import (
    AT_LOWER,
    AT_UPPER,
    FREE,
    LeastDistance,
    LinearRows,
    Rows,
    largest_part,
    local_maxima,
)
from excite.tasks.task import Task
from regressors.readers.library import built_in
from regressors.samples import Array

SEED = st.integers(0, 2**32 - 1)


def hessian(factor: BfgsFactor) -> Array:
    J = np.linalg.inv(factor.J)
    return np.asarray(J.T @ J)


def updated(H: Array, s: Array, y: Array) -> Array:
    """Powell's damped update of H itself."""
    Hs = H @ s
    curvature, sy = s @ Hs, s @ y
    theta = 1.0 if sy >= 0.2 * curvature else 0.8 * curvature / (curvature - sy)
    r = theta * y + (1 - theta) * Hs
    return np.asarray(H - np.outer(Hs, Hs) / curvature + np.outer(r, r) / (s @ r))


def test_it_begins_as_a_multiple_of_the_identity_and_a_step_of_no_length_changes_nothing() -> None:
    factor = BfgsFactor(np.array([3.0, 0.0, -4.0]))
    for _ in range(2):
        np.testing.assert_allclose(hessian(factor), 5.0 * np.eye(3), rtol=1e-14)
        factor.update(np.zeros(3), np.ones(3), np.zeros(3))
    assert np.all(np.isfinite(BfgsFactor(np.zeros(3)).J))


@given(SEED, st.floats(-3.0, 3.0))
def test_an_update_is_that_of_the_full_matrix(seed: int, bend: float) -> None:
    """[Powell 1978]: ``H_new s = y`` if s'y >= s'Hs / 5, else with y drawn towards Hs just so far."""
    rng = np.random.default_rng(seed)
    factor = BfgsFactor(rng.normal(size=5))
    for _ in range(4):
        H, s = hessian(factor), rng.normal(size=5)
        y = bend * H @ s + rng.normal(size=5)
        expected = updated(H, s, y)
        factor.update(s, y, factor.whitened(s))
        new = hessian(factor)
        scale = np.linalg.cond(expected) * np.abs(expected).max()
        np.testing.assert_allclose(new, expected, atol=1e-13 * scale)
        assert np.linalg.eigvalsh(new)[0] > 0
        if s @ y >= 0.2 * (s @ H @ s):
            np.testing.assert_allclose(new @ s, y, atol=1e-12 * scale)
        else:
            assert s @ new @ s == pytest.approx(0.2 * (s @ H @ s), rel=1e-6)


def some_rows(rng: np.random.Generator, m: int, n: int) -> Rows:
    """Rows around zero, some pairs of them nearly parallel, as neighbours in time are."""
    A = rng.normal(size=(m, n))
    A[m // 2 :] = A[: m - m // 2] + 1e-3 * A[m // 2 :]
    return A, -rng.uniform(0.0, 1.0, m), rng.uniform(0.0, 1.0, m)


def check_optimal(c: Array, rows: Rows, w: Array, sides: np.ndarray) -> None:
    """Karush, Kuhn and Tucker: inside, and ``c + w`` is a combination of active rows with the right signs."""
    A, lower, upper = rows
    assert np.all(A @ w <= upper + 1e-6)
    assert np.all(A @ w >= lower - 1e-6)
    active = np.flatnonzero(sides != FREE)
    bound = np.where(sides == AT_UPPER, upper, lower)[active]
    np.testing.assert_allclose((A @ w)[active], bound, atol=1e-6)
    multipliers = np.linalg.lstsq(A[active].T, -(c + w), rcond=None)[0]
    np.testing.assert_allclose(A[active].T @ multipliers, -(c + w), atol=1e-6)
    assert np.all(np.where(sides[active] == AT_UPPER, multipliers, -multipliers) >= -1e-6)


@given(SEED, st.integers(1, 12), st.integers(0, 20))
def test_the_solution_is_optimal_whatever_was_expected(seed: int, n: int, m: int) -> None:
    rng = np.random.default_rng(seed)
    c, rows = 3.0 * rng.normal(size=n), some_rows(rng, m, n)
    expected = rng.choice([FREE, AT_UPPER, AT_LOWER], m).astype(np.int32)
    programme = LeastDistance(c)
    programme.add(rows, expected)
    w = programme.solve()
    assert w is not None
    check_optimal(c, rows, w, programme.sides)


@given(SEED)
def test_rows_can_be_added_later_or_hold_without_being_added(seed: int) -> None:
    rng = np.random.default_rng(seed)
    c, first, second = 3.0 * rng.normal(size=8), some_rows(rng, 6, 8), some_rows(rng, 9, 8)
    programme, other, whole = LeastDistance(c), LeastDistance(c), LeastDistance(c)
    both = tuple(np.concatenate(pair) for pair in zip(first, second, strict=True))
    whole.add(both, np.zeros(15, dtype=np.int32))
    expected = whole.solve()
    programme.add(first, np.zeros(6, dtype=np.int32))
    programme.solve()
    programme.add(second, np.zeros(9, dtype=np.int32))
    np.testing.assert_allclose(w := programme.solve(), expected, atol=1e-6)
    check_optimal(c, both, w, programme.sides)
    other.add(first, np.zeros(6, dtype=np.int32))
    for _ in range(2):  # the second time from where the first ended
        np.testing.assert_allclose(other.solve([second]), expected, atol=1e-6)
    assert other.sides.size == 6


@pytest.fixture(scope="module")
def problem() -> Problem:
    """Drive 3 of the IRp-6 couples joints 2 and 3, so that rows depend on two coordinates."""
    return formulate(built_in("irp6"), Task("irp6")).problem


@pytest.fixture(scope="module")
def rows(problem: Problem) -> LinearRows:
    return LinearRows(problem.limits.linear_in_x, problem.shape)


def test_rows_times_a_step_are_its_changes(problem: Problem, rows: LinearRows) -> None:
    step = np.random.default_rng(1).normal(size=problem.rest.size)
    changes = rows.changes(step)
    flat = np.random.default_rng(2).choice(changes.size, 50, replace=False)
    np.testing.assert_allclose(rows.rows(flat) @ step, changes.ravel()[flat], rtol=1e-12, atol=1e-12)
    x = problem.rest + step.reshape(problem.shape)
    np.testing.assert_allclose(rows.values(x) - rows.values(problem.rest), changes, rtol=1e-9, atol=1e-9)


def test_values_are_those_of_each_limit(problem: Problem, rows: LinearRows) -> None:
    x, expected = problem.rest + 0.3 * np.random.default_rng(0).normal(size=problem.shape), []
    for limit in problem.limits.linear_in_x:
        middle, half = 0.5 * (limit.upper + limit.lower), 0.5 * (limit.upper - limit.lower)
        expected.append((limit.values(x) - middle[:, None]) / half[:, None])
    np.testing.assert_allclose(rows.values(x), np.concatenate(expected), rtol=1e-12, atol=1e-12)


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


def test_peaks_are_the_local_maxima_at_all_instants(problem: Problem, rows: LinearRows) -> None:
    rng = np.random.default_rng(5)
    xs = [problem.rest + part * rng.normal(size=problem.shape) for part in (0.01, 0.1, 0.3, 1.0)]
    for threshold in (0.3, 0.7, 0.9995):
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
