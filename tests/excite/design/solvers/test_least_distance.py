"""Programmes in whitened coordinates: their optimality conditions, whatever was expected to be active."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from excite.design.solvers.limit_rows import AT_LOWER, AT_UPPER, FREE, LeastDistance, Rows
from regressors.samples import Array

SEED = st.integers(0, 2**32 - 1)


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


@given(SEED, st.integers(1, 12), st.integers(1, 20))
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
def test_rows_can_be_added_later(seed: int) -> None:
    rng = np.random.default_rng(seed)
    c, first, second = 3.0 * rng.normal(size=8), some_rows(rng, 6, 8), some_rows(rng, 9, 8)
    programme, whole = LeastDistance(c), LeastDistance(c)
    programme.add(first, np.zeros(6, dtype=np.int32))
    programme.solve()
    programme.add(second, np.zeros(9, dtype=np.int32))
    w, both = programme.solve(), tuple(np.concatenate(pair) for pair in zip(first, second, strict=True))
    whole.add(both, np.zeros(15, dtype=np.int32))
    assert w is not None
    np.testing.assert_allclose(w, whole.solve(), atol=1e-6)
    check_optimal(c, both, w, programme.sides)


@given(SEED)
def test_other_rows_hold_without_being_added(seed: int) -> None:
    rng = np.random.default_rng(seed)
    c, rows, (A, lower, _) = 3.0 * rng.normal(size=8), some_rows(rng, 6, 8), some_rows(rng, 4, 8)
    others = A, lower, np.full(4, np.inf)
    programme, whole = LeastDistance(c), LeastDistance(c)
    programme.add(rows, np.zeros(6, dtype=np.int32))
    whole.add(rows, np.zeros(6, dtype=np.int32))
    whole.add(others, np.zeros(4, dtype=np.int32))
    expected = whole.solve()
    for _ in range(2):  # the second time from where the first ended
        np.testing.assert_allclose(programme.solve([others]), expected, atol=1e-6)
    assert programme.sides.size == 6


def test_without_rows_it_ends_at_its_minimum() -> None:
    c = np.array([1.0, -2.0])
    programme = LeastDistance(c)
    assert programme.solve() == pytest.approx(-c)
