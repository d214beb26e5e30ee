"""Ordinary, weighted and recursive least squares: other implementations, laws of equivariance, coverage, bad input."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings, strategies as st
from observed import noise_of, observations_of, random_problem
from refused import refusal

from excite.identification import observations as observations_file
from excite.identification.estimator import Estimate
from excite.identification.estimators import least_squares as recursive_file
from excite.identification.estimators.least_squares import least_squares, recursive, weighted
from excite.identification.observations import GroupFactors, Observations, join_observations
from excite.registry import ESTIMATORS, instance
from regressors.errors import UnknownName
from regressors.samples import Array

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


def assert_factors(observations: Observations, factors: GroupFactors) -> None:
    whole = np.column_stack([observations.W, observations.y])
    for g, R in enumerate(factors.R):
        part = whole[observations.group == g]
        np.testing.assert_allclose(R.T @ R, part.T @ part, rtol=1e-10, atol=1e-9)
    R = factors.stacked(np.ones(2))
    np.testing.assert_allclose(R.T @ R, whole.T @ whole, rtol=1e-10, atol=1e-9)


def test_chunks_of_rows_make_the_factor_of_all_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    observations, _ = random_problem(0, instants=100)
    for chunk in (1, 3, 7, 1000):
        monkeypatch.setattr(observations_file, "BLOCK", chunk)
        assert_factors(observations, GroupFactors.of(dataclasses.replace(observations)))  # the same object's are known


def test_equations_without_some_columns_have_the_same_factor() -> None:
    """Torques of the last joints do not depend on the bodies before them; a column may appear late, or never."""
    observations, _ = random_problem(0, instants=100, p=6)
    W = observations.W.copy()
    W[observations.equation == 1, :2] = 0.0
    W[:150, 3] = 0.0
    W[:, 4] = 0.0
    observations = dataclasses.replace(observations, W=W)
    assert_factors(observations, GroupFactors.of(observations))


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


def test_known_noise_has_the_closed_form_and_the_sandwich_covariance() -> None:
    observations, _ = random_problem(4)
    observations = dataclasses.replace(observations, noise=np.array([[0.2, 1.5]]))
    W, sigma = observations.W, np.tile([0.2, 1.5], 60)
    M = W.T @ (W / sigma[:, None] ** 2)
    estimate = weighted(observations)
    np.testing.assert_allclose(estimate.values, np.linalg.solve(M, W.T @ (observations.y / sigma**2)), rtol=1e-9)
    np.testing.assert_allclose(estimate.covariance, np.linalg.inv(M), rtol=1e-7)
    np.testing.assert_array_equal(estimate.noise, [[0.2, 1.5]])
    G = np.linalg.pinv(W)
    np.testing.assert_allclose(least_squares(observations).covariance, (G * sigma**2) @ G.T, rtol=1e-7)


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


def test_known_noise_split_into_logs_is_the_same_estimate() -> None:
    observations, _ = random_problem(7)
    observations = dataclasses.replace(observations, noise=np.array([[0.2, 1.5]]))
    parts = [observations.rows(np.arange(a, b)) for a, b in ((0, 50), (50, 52), (52, 120))]
    close(weighted(join_observations(parts)), weighted(observations))
    close(least_squares(join_observations(parts)), least_squares(observations))


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


# --- names and bad input ---------------------------------------------------------------------------------------------


def test_estimators_have_the_names_that_they_are_registered_by() -> None:
    observations, _ = random_problem(0)
    for name in sorted(set(ESTIMATORS) - {"instrumental", "physical"}):
        assert instance("estimator", name).estimate(observations).method == name
    with pytest.raises(UnknownName, match="no estimator named 'magic'; available: huber, instrumental, least-squares"):
        instance("estimator", "magic")


def nan_at(array: np.ndarray, *place: int) -> np.ndarray:
    array = array.copy()
    array[place] = np.nan
    return array


BASE = random_problem(0)[0]


def test_bad_observations() -> None:
    for observations, message in (
        (BASE.rows(np.arange(0)), "no rows, so nothing can be estimated"),
        (observations_of(np.zeros((4, 0)), np.ones(4)), "no parameters to estimate"),
        (
            dataclasses.replace(BASE, W=nan_at(BASE.W, 5, 2)),
            "W must be finite, given nan for b3 in row 5, log log1, time 0.0",
        ),
        (dataclasses.replace(BASE, y=nan_at(BASE.y, 8)), "y must be finite, given nan in row 8"),
        (dataclasses.replace(BASE, noise=np.array([[1.0, 0.0]])), r"noise must be positive, given \[\[1.0, 0.0\]\]"),
    ):
        assert re.search(message, refusal(weighted, observations))


def literal(W: Array, y: Array, c: float) -> tuple[Array, Array]:
    """[KD96] eq. (17), (18), one row after the other: estimates after every row, and the last P."""
    p = W.shape[1]
    X, P, path = np.zeros(p), c * np.eye(p), []
    for d, value in zip(W, y, strict=True):
        P = P - np.outer(P @ d, d) @ P / (1 + d @ P @ d)
        X = X + P @ d * (value - d @ X)
        path.append(X)
    return np.array(path), P


def small_problem(seed: int, rows: int, p: int) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(rows, p))
    return W, W @ rng.normal(size=p) + 0.1 * rng.normal(size=rows)


@given(st.integers(0, 2**32 - 1), st.integers(1, 100), st.integers(1, 5), st.sampled_from([1.0, 1e4]))
@settings(max_examples=25)
def test_every_row_is_the_literal_loops(seed: int, rows: int, p: int, c: float) -> None:
    W, y = small_problem(seed, rows, p)
    path, _ = literal(W, y, c)
    time, estimates = recursive(observations_of(W, y), prior=c).history
    np.testing.assert_allclose(estimates, path, atol=1e-7 * (1 + np.abs(path).max()))
    np.testing.assert_allclose(time, np.arange(rows) * 0.01)


def test_rows_of_one_instant_are_taken_one_after_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three rows per instant in blocks of any size: the history holds the literal loop's every third estimate."""
    W, y = small_problem(1, 120, 4)
    path, P = literal(W, y, 10.0)
    for block in (1, 5, 32, 1000):
        monkeypatch.setattr(recursive_file, "_BLOCK", block)
        found = recursive(observations_of(W, y, equations=3), prior=10.0)
        np.testing.assert_allclose(found.history[1], path[2::3], rtol=1e-9)
    square = float(np.sum((y - W @ path[-1]) ** 2))
    np.testing.assert_allclose(found.covariance, square / 116 * P, rtol=1e-8, atol=1e-12)
    np.testing.assert_array_equal(found.covariance, found.covariance.T)


@pytest.mark.parametrize(("every", "instants"), [(1, 60), (7, 9), (30, 2), (59, 2), (1000, 1)])
def test_decimated_history_ends_with_the_last_estimate(every: int, instants: int) -> None:
    observations, _ = random_problem(3)
    found = recursive(observations, every=every)
    time, estimates = found.history
    assert len(time) == instants
    assert time[-1] == observations.time[-1]
    np.testing.assert_array_equal(estimates[-1], found.values)
    whole = recursive(observations).history[1]
    np.testing.assert_array_equal(estimates[:-1], whole[every - 1 :: every][: instants - 1])


def test_bad_settings() -> None:
    for setting, message in (
        ({"prior": 0.0}, "the prior c must be a positive number, given 0.0"),
        ({"every": 0}, "every must be 1 or more, given 0"),
    ):
        assert re.search(message, refusal(recursive, random_problem(0)[0], **setting))
