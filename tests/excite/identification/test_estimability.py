"""Which parameters the data shows: zero and dependent columns, too few rows, columns lost in the noise."""

from __future__ import annotations

import numpy as np
import pytest
from observed import noise_of, observations_of

from excite.identification.estimator import estimability
from excite.identification.estimators.least_squares import least_squares, recursive, weighted, weighting
from excite.identification.estimators.robust import huber, instrumental
from excite.identification.observations import Observations
from regressors.samples import Array

METHODS = {"least-squares": least_squares, "weighted": weighted, "huber": huber, "recursive": recursive}
METHODS |= {"instrumental": lambda o: instrumental(o, o.W)}


def columns(seed: int = 0, rows: int = 80, p: int = 3) -> Array:
    return np.random.default_rng(seed).normal(size=(rows, p)) * np.array([1.0, 30.0, 0.1])[:p]


def observed(W: Array, beta: Array, noise: float = 0.01) -> Observations:
    y = W @ beta + noise_of(np.random.default_rng(1), (noise,), len(W))
    return observations_of(W, y)


def combinations_in(observations: Observations) -> tuple[str, ...]:
    problem = weighting(observations)
    return estimability(problem.solution, observations.names, problem.variance, problem.freedom)[1]


@pytest.mark.parametrize("units", [1.0, 1e4])
def test_what_is_seen_depends_on_the_noise_and_not_on_units(units: float) -> None:
    W = columns()
    W = np.column_stack([W, W[:, 0] + 1e-3 * np.random.default_rng(3).normal(size=len(W))]) * units
    for noise, unseen in ((0.01, ()), (1.0, ("b1", "b4"))):
        assert weighted(observed(W, np.ones(4) / units, noise)).unseen == unseen


def test_combinations_are_in_units() -> None:
    W = columns()
    W = np.column_stack([W, W[:, 0] - 0.5 * W[:, 2]]) * [1e-3, 1.0, 1e3, 1.0]
    combinations = combinations_in(observed(W, np.ones(4)))
    assert combinations == ("b1 is identifiable only in b1 + 1000 b4", "b3 is identifiable only in b3 - 0.0005 b4")


def test_combinations_are_written_out_up_to_six_others() -> None:
    W = np.ones((1, 8)) * columns(p=1)
    texts = [combinations_in(observed(W[:, :p], np.ones(p))) for p in (7, 8)]
    assert texts[0] == ("b1 is identifiable only in b1 + b2 + b3 + b4 + b5 + b6 + b7",)
    assert texts[1] == ("b1 is identifiable only in a combination with 7 others",)


@pytest.mark.parametrize("name", METHODS)
def test_a_zero_column_is_unseen_and_the_others_are_as_without_it(name: str) -> None:
    W, beta = columns(), np.array([1.0, 2.0, 3.0])
    without = METHODS[name](observed(W, beta))
    found = METHODS[name](observed(np.insert(W, 1, 0.0, axis=1), np.insert(beta, 1, 5.0)))
    assert found.unseen == ("b2",)
    assert np.isnan(found.values[1])
    assert np.isinf(found.deviation[1])
    assert "b2 does not influence the measurements" in found.notes
    np.testing.assert_allclose(np.delete(found.values, 1), without.values, rtol=1e-6)
    np.testing.assert_allclose(np.delete(found.deviation, 1), without.deviation, rtol=1e-6)


@pytest.mark.parametrize("name", METHODS)
def test_dependent_columns_are_named_with_their_combination(name: str) -> None:
    """Column 4 is column 1 less half of column 3, so b1 + b4 and b3 - b4 / 2 show, and b2."""
    W = columns()
    W = np.column_stack([W, W[:, 0] - 0.5 * W[:, 2]])
    beta = np.array([1.0, 2.0, 3.0, 4.0])
    observations = observed(W, beta)
    found = METHODS[name](observations)
    assert found.unseen == ("b1", "b3", "b4")
    assert "b1 is identifiable only in b1 + b4" in found.notes
    assert "b3 is identifiable only in b3 - 0.5 b4" in found.notes
    alone = METHODS[name](observed(W[:, :3], np.array([5.0, 2.0, 1.0])))
    np.testing.assert_allclose(found.values[1], alone.values[1], rtol=1e-6)
    np.testing.assert_allclose(found.deviation[1], alone.deviation[1], rtol=1e-6)
    np.testing.assert_allclose(found.residual(observations).std(), 0.01, rtol=0.2)


def test_fewer_rows_than_columns_show_nothing_on_its_own() -> None:
    found = least_squares(observations_of(columns(rows=2), np.array([1.0, 2.0])))
    assert found.unseen == ("b1", "b2", "b3")
    assert np.all(np.isnan(found.values))
    assert len([note for note in found.notes if "is identifiable only in" in note]) == 2
    silent = weighted(observations_of(columns(), np.zeros(80)))
    np.testing.assert_array_equal(silent.values, 0.0)
    assert silent.unseen == ()
    assert weighted(observations_of(np.zeros((80, 2)), np.ones(80))).unseen == ("b1", "b2")


def test_as_many_rows_as_columns_leave_the_noise_unknown() -> None:
    W, beta = columns(rows=3), np.array([1.0, 2.0, 3.0])
    for method in (least_squares, weighted):
        found = method(observations_of(W, W @ beta))
        np.testing.assert_allclose(found.values, beta, rtol=1e-6)
        assert np.all(np.isinf(found.half_width))
    known = weighted(observations_of(W, W @ beta, known=[0.1]))
    np.testing.assert_allclose(known.covariance, 0.01 * np.linalg.inv(W.T @ W), rtol=1e-8)


def test_a_direction_that_the_noise_covers_is_unseen_and_the_rest_stays_unbiased() -> None:
    """Columns 1 and 4 differ by 1e-7: independent in exact numbers, alike beside noise of 1 %."""
    W, rng = columns(), np.random.default_rng(3)
    W = np.column_stack([W, W[:, 0] + 1e-7 * rng.normal(size=len(W))])
    beta = np.array([1.0, 2.0, 3.0, 4.0])
    found = weighted(observed(W, beta))
    assert found.unseen == ("b1", "b4")
    assert "b1 is identifiable only in b1 + b4" in found.notes
    assert np.all(np.abs(found.values - beta)[1:3] < 4 * found.deviation[1:3])
    exact = weighted(observed(W, beta, noise=0.0))
    assert exact.unseen == ()
    np.testing.assert_allclose(exact.values, beta, rtol=1e-5)
