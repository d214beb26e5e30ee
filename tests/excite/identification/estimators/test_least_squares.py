"""Ordinary and weighted least squares: NumPy's lstsq, laws of equivariance, coverage of the intervals, bad input."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st
from observed import noise_of, observations_of, random_problem, robot_observations

from excite.identification import observations as observations_file
from excite.identification.estimate import Estimate
from excite.identification.estimators.instrumental import instrumental
from excite.identification.estimators.least_squares import least_squares, weighted
from excite.identification.observations import GroupFactors, Observations, join_observations
from excite.identification.recipe import Recipe
from excite.registry import ESTIMATORS, instance
from regressors.errors import InputError, UnknownName

SEED = st.integers(0, 2**32 - 1)


def close(found: Estimate, expected: Estimate, rtol: float = 1e-8) -> None:
    np.testing.assert_allclose(found.values, expected.values, rtol=rtol)
    np.testing.assert_allclose(found.covariance, expected.covariance, rtol=rtol, atol=rtol * expected.covariance.max())


# --- against other implementations -----------------------------------------------------------------------------------


@given(SEED)
@settings(max_examples=15)
def test_least_squares_is_numpys(seed: int) -> None:
    observations, _ = random_problem(seed)
    estimate = least_squares(observations)
    W, y = observations.W, observations.y
    values, square, _, _ = np.linalg.lstsq(W, y)
    np.testing.assert_allclose(estimate.values, values, rtol=1e-9)
    variance = square[0] / (len(y) - W.shape[1])
    np.testing.assert_allclose(estimate.covariance, variance * np.linalg.inv(W.T @ W), rtol=1e-7)
    assert estimate.degrees_of_freedom == len(y) - W.shape[1]


def test_chunks_of_rows_make_the_factor_of_all_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    observations, _ = random_problem(0, instants=100)
    whole = np.column_stack([observations.W, observations.y])
    for chunk in (1, 3, 7, 1000):
        monkeypatch.setattr(observations_file, "BLOCK", chunk)
        factors = GroupFactors.of(dataclasses.replace(observations))  # those of the same object are known
        for g, R in enumerate(factors.R):
            part = whole[observations.group == g]
            np.testing.assert_allclose(R.T @ R, part.T @ part, rtol=1e-10, atol=1e-9)
        R = factors.stacked(np.ones(2))
        np.testing.assert_allclose(R.T @ R, whole.T @ whole, rtol=1e-10, atol=1e-9)


def test_equations_without_some_columns_have_the_same_factor() -> None:
    """Torques of the last joints do not depend on the bodies before them; a column may appear late, or never."""
    observations, _ = random_problem(0, instants=100, p=6)
    W = observations.W.copy()
    W[observations.equation == 1, :2] = 0.0
    W[:150, 3] = 0.0
    W[:, 4] = 0.0
    observations = dataclasses.replace(observations, W=W)
    whole = np.column_stack([W, observations.y])
    for g, R in enumerate(GroupFactors.of(observations).R):
        part = whole[observations.group == g]
        np.testing.assert_allclose(R.T @ R, part.T @ part, rtol=1e-10, atol=1e-9)


def test_columns_that_normal_equations_would_mix_up() -> None:
    """Läuchli's columns (1, e, 0), (1, 0, e): W'W is singular in double precision, W is not."""
    e = 1e-8
    W = np.array([[1.0, 1.0], [e, 0.0], [0.0, e], [1.0, -1.0 + e]])[:3]
    W = np.concatenate([W, W])
    estimate = least_squares(observations_of(W, W @ np.array([2.0, -3.0])))
    np.testing.assert_allclose(estimate.values, [2.0, -3.0], rtol=1e-6)
    assert np.linalg.matrix_rank(W.T @ W) == 1


@pytest.mark.parametrize("seed", range(3))
def test_weighted_is_the_maximum_of_the_restricted_likelihood(seed: int) -> None:
    """Minus twice the restricted log-likelihood of one variance per group, minimised by another way [Searle 1992]."""
    observations, _ = random_problem(seed, instants=12, p=3)
    W, y, group = observations.W, observations.y, observations.group

    def likelihood(logs: np.ndarray) -> float:
        v = np.exp(logs)[group]
        M = W.T @ (W / v[:, None])
        e = y - W @ np.linalg.solve(M, W.T @ (y / v))
        return float(np.sum(np.log(v)) + np.linalg.slogdet(M)[1] + e @ (e / v))

    best = scipy.optimize.minimize(
        likelihood, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12}
    )
    np.testing.assert_allclose(weighted(observations).noise[0], np.exp(best.x / 2), rtol=1e-5)


def test_weighted_with_known_noise_is_the_closed_form() -> None:
    observations, _ = random_problem(4)
    observations = dataclasses.replace(observations, noise=np.array([[0.2, 1.5]]))
    w = 1 / np.tile([0.2, 1.5], 60) ** 2
    M = observations.W.T @ (observations.W * w[:, None])
    estimate = weighted(observations)
    np.testing.assert_allclose(estimate.values, np.linalg.solve(M, observations.W.T @ (w * observations.y)), rtol=1e-9)
    np.testing.assert_allclose(estimate.covariance, np.linalg.inv(M), rtol=1e-7)
    np.testing.assert_array_equal(estimate.noise, [[0.2, 1.5]])


def test_least_squares_with_known_noise_has_the_sandwich_covariance() -> None:
    observations, _ = random_problem(5)
    W, sigma = observations.W, np.tile([0.2, 1.5], 60)
    G = np.linalg.pinv(W)
    expected = (G * sigma**2) @ G.T
    found = least_squares(dataclasses.replace(observations, noise=np.array([[0.2, 1.5]]))).covariance
    np.testing.assert_allclose(found, expected, rtol=1e-7)


# --- laws ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", [least_squares, weighted])
@given(SEED)
@settings(max_examples=8)
def test_parameters_in_other_units(method, seed: int) -> None:
    observations, _ = random_problem(seed)
    units = np.array([1e-3, 1.0, 1e4, 7.0])
    scaled = method(dataclasses.replace(observations, W=observations.W * units))
    original = method(observations)
    np.testing.assert_allclose(scaled.values * units, original.values, rtol=1e-7)
    np.testing.assert_allclose(scaled.deviation * units, original.deviation, rtol=1e-7)


@given(SEED)
@settings(max_examples=8)
def test_weighted_in_other_units_of_one_equation(seed: int) -> None:
    observations, _ = random_problem(seed)
    factor = np.tile([1.0, 1e3], 60)
    changed = dataclasses.replace(observations, W=observations.W * factor[:, None], y=observations.y * factor)
    found, original = weighted(changed), weighted(observations)
    close(found, original, rtol=1e-6)
    np.testing.assert_allclose(found.noise, original.noise * [1.0, 1e3], rtol=1e-6)


@pytest.mark.parametrize("method", [least_squares, weighted])
def test_order_of_the_rows_does_not_matter(method) -> None:
    observations, _ = random_problem(6)
    order = np.random.default_rng(0).permutation(observations.y.size)
    close(method(observations.rows(order)), method(observations))


def test_known_noise_split_into_logs_is_the_same_estimate() -> None:
    observations, _ = random_problem(7)
    observations = dataclasses.replace(observations, noise=np.array([[0.2, 1.5]]))
    parts = [observations.rows(np.arange(a, b)) for a, b in ((0, 50), (50, 52), (52, 120))]
    close(weighted(join_observations(parts)), weighted(observations))
    close(least_squares(join_observations(parts)), least_squares(observations))


def test_a_log_with_more_noise_counts_less() -> None:
    quiet, beta = random_problem(8, deviations=(0.01,), instants=200)
    loud, _ = random_problem(9, deviations=(5.0,), instants=200)
    loud = dataclasses.replace(loud, y=loud.W @ beta + noise_of(np.random.default_rng(1), (5.0,), 200))
    both, alone = weighted(join_observations([quiet, loud])), weighted(quiet)
    assert np.all(both.deviation < alone.deviation)
    np.testing.assert_allclose(both.deviation, alone.deviation, rtol=0.02)
    np.testing.assert_allclose(both.noise, [[0.01], [5.0]], rtol=0.2)


@pytest.mark.parametrize("method", [least_squares, weighted])
def test_exact_data_give_exact_parameters(method) -> None:
    observations, beta = robot_observations("irp6", noise=0.0)
    np.testing.assert_allclose(method(observations).values, beta, atol=1e-9 * np.abs(beta).max())


# --- coverage --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("known", [False, True], ids=["estimated", "known"])
@pytest.mark.parametrize("method", [least_squares, weighted])
def test_99_percent_intervals_hold_99_percent(method, known: bool) -> None:
    """Of 400 times 3 intervals, 2.6 standard deviations of the binomial distribution around 99 %."""
    deviations = (0.2, 1.5) if method is weighted or known else (0.7, 0.7)
    rng = np.random.default_rng(11)
    W = rng.normal(size=(80, 3))
    beta, inside, runs = np.array([1.0, -2.0, 0.5]), 0, 400
    for _ in range(runs):
        y = W @ beta + noise_of(rng, deviations, 40)
        estimate = method(observations_of(W, y, 2, known=deviations if known else None))
        inside += int(np.sum((estimate.interval[:, 0] <= beta) & (beta <= estimate.interval[:, 1])))
    assert abs(inside / (3 * runs) - 0.99) < 2.6 * np.sqrt(0.99 * 0.01 / (3 * runs)) + 0.001


def test_noise_is_estimated_without_bias() -> None:
    rng = np.random.default_rng(12)
    W = rng.normal(size=(40, 6))
    squares = [weighted(observations_of(W, noise_of(rng, (0.5, 2.0), 20), 2)).noise[0] ** 2 for _ in range(400)]
    np.testing.assert_allclose(np.mean(squares, axis=0), [0.25, 4.0], rtol=0.07)


# --- names and bad input ---------------------------------------------------------------------------------------------


def test_every_estimator_is_registered() -> None:
    assert [instance("estimator", name).name for name in ESTIMATORS] == list(ESTIMATORS)
    assert Recipe().chosen_estimator().name == "weighted"
    observations, _ = random_problem(0)
    for name in ESTIMATORS:
        if name not in ("instrumental", "physical"):
            assert instance("estimator", name).estimate(observations).method == name
    assert instrumental(observations, observations.W).method == "instrumental"


def test_unknown_estimator() -> None:
    with pytest.raises(UnknownName, match="no estimator named 'magic'; available: huber, instrumental, least-squares"):
        instance("estimator", "magic")


def spoiled(**changes: object) -> Observations:
    return dataclasses.replace(random_problem(0)[0], **changes)  # type: ignore[arg-type]


def nan_at(array: np.ndarray, *place: int) -> np.ndarray:
    array = array.copy()
    array[place] = np.nan
    return array


BASE = random_problem(0)[0]
BAD = {
    "empty": (lambda: BASE.rows(np.arange(0)), "no rows, so nothing can be estimated"),
    "no columns": (lambda: observations_of(np.zeros((4, 0)), np.ones(4)), "no parameters to estimate"),
    "W": (
        lambda: spoiled(W=nan_at(BASE.W, 5, 2)),
        "W must be finite, given nan for b3 in row 5, log log1, time 0.02 s",
    ),
    "y": (lambda: spoiled(y=nan_at(BASE.y, 8)), "y must be finite, given nan in row 8"),
    "noise": (lambda: spoiled(noise=np.array([[1.0, 0.0]])), r"noise must be positive, given \[\[1.0, 0.0\]\]"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_observations(case: str) -> None:
    make, message = BAD[case]
    with pytest.raises(InputError, match=message):
        weighted(make())
