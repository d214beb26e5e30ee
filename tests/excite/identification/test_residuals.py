"""Residuals and covariances of correlated noise: closed forms, literal sums, size of the tests, coverage."""

from __future__ import annotations

import dataclasses
import re
from math import erfc

import numpy as np
import pytest
import scipy.signal
from hypothesis import given, settings, strategies as st
from observed import noise_of, observations_of, random_problem
from refused import refusal

from excite.identification.covariance import _bartlett, bandwidth, robust_covariance
from excite.identification.estimators.least_squares import least_squares, recursive, weighted
from excite.identification.estimators.robust import huber, instrumental
from excite.identification.noise import autocorrelation, effective_samples, residual_diagnostics
from regressors.samples import Array


def coloured(rng: np.random.Generator, r: float, count: int) -> Array:
    """First-order autoregression of unit variance, started in its stationary state."""
    e = np.sqrt(1 - r**2) * rng.normal(size=count)
    e[0] /= np.sqrt(1 - r**2)
    return np.asarray(scipy.signal.lfilter([1.0], [1.0, -r], e))


# --- diagnostics -----------------------------------------------------------------------------------------------------


def test_sizes_and_the_worst_row() -> None:
    observations, _ = random_problem(0, logs=2)
    y = observations.y.copy()
    y[85] -= 50.0
    observations = dataclasses.replace(observations, y=y)
    estimate = least_squares(observations)
    found = residual_diagnostics(estimate, observations)
    assert [(g.log, g.equation) for g in found] == [(f"log{a}", f"joint{b}") for a in (1, 2) for b in (1, 2)]
    assert [g.rows for g in found] == [30, 30, 30, 30]
    e = y - observations.W @ estimate.values
    for k, group in enumerate(found):
        rows = observations.group == k
        assert group.rms == pytest.approx(np.sqrt(np.mean(e[rows] ** 2)))
        assert group.relative == pytest.approx(group.rms / np.sqrt(np.mean(y[rows] ** 2)))
        assert abs(group.worst) == pytest.approx(np.abs(e[rows]).max())
    assert found[3].worst == pytest.approx(e[85])
    assert found[3].worst_time == observations.time[85]
    assert found[3].normality < 1e-6 < found[0].normality


@given(st.integers(0, 2**32 - 1), st.integers(2, 60))
@settings(max_examples=20)
def test_autocorrelation_is_the_sum(seed: int, n: int) -> None:
    e = np.random.default_rng(seed).normal(size=n)
    c = e - e.mean()
    expected = [float(np.sum(c[: n - k] * c[k:]) / np.sum(c**2)) for k in range(n)]
    np.testing.assert_allclose(autocorrelation(e), expected, atol=1e-10)


def test_ljung_box_is_its_formula() -> None:
    observations = observations_of(np.ones((35, 1)), coloured(np.random.default_rng(1), 0.4, 35))
    (group,) = residual_diagnostics(least_squares(observations), observations)
    e = observations.y - observations.y.mean()
    r = [np.sum(e[:-k] * e[k:]) / np.sum(e**2) for k in range(1, 8)]
    statistic = 35 * 37 * sum(r[k - 1] ** 2 / (35 - k) for k in range(1, 8))
    assert (group.ljung_box, group.lags) == (pytest.approx(statistic), 7)
    assert group.lag_one == pytest.approx(r[0])
    # chi squared with seven degrees of freedom in closed form
    x = statistic
    tail = np.exp(-x / 2) * np.sqrt(2 * x / np.pi) * (1 + x / 3 + x**2 / 15)
    assert group.whiteness == pytest.approx(erfc(np.sqrt(x / 2)) + tail, rel=1e-6)


def test_effective_samples_of_an_autoregression() -> None:
    """``n (1 - r) / (1 + r)`` in the limit of long records."""
    for r in (0.0, 0.5, 0.9):
        rng = np.random.default_rng(3)
        found = np.mean([effective_samples(autocorrelation(coloured(rng, r, 20000)), 20000) for _ in range(5)])
        np.testing.assert_allclose(found, 20000 * (1 - r) / (1 + r), rtol=0.15)


def test_residuals_that_are_zero_or_constant() -> None:
    W = np.random.default_rng(4).normal(size=(30, 2))
    nothing = observations_of(W, np.zeros(30))
    (group,) = residual_diagnostics(weighted(nothing), nothing)
    assert (group.rms, group.relative, group.lag_one, group.effective) == (0.0, 0.0, 0.0, 30.0)
    one = observations_of(np.ones((1, 1)), np.ones(1))
    assert residual_diagnostics(least_squares(one), one)[0].rows == 1


# --- covariance ------------------------------------------------------------------------------------------------------


@given(st.integers(0, 2**32 - 1), st.integers(1, 12))
@settings(max_examples=20)
def test_bartlett_sum_is_the_literal_one(seed: int, width: int) -> None:
    g = np.random.default_rng(seed).normal(size=(12, 2))
    expected = np.zeros((2, 2))
    for t in range(12):
        for u in range(12):
            expected += max(0.0, 1 - abs(t - u) / width) * np.outer(g[t], g[u])
    for parts in ([g], [g[:1], g[1:]], [g[:5], g[5:7], g[7:]], list(g[:, None])):
        np.testing.assert_allclose(_bartlett(parts, width), expected, atol=1e-10)


@pytest.mark.parametrize("method", [least_squares, weighted])
def test_newey_west_is_the_literal_sandwich(method) -> None:
    """Two equations, two logs: scores of one instant are summed, products taken within each log."""
    observations, _ = random_problem(5, logs=2)
    estimate = method(observations)
    W, e, group = observations.W, estimate.residual(observations), observations.group
    v = np.ones_like(e) if method is least_squares else 1 / estimate.noise.ravel()[group] ** 2
    bread = np.linalg.inv(W.T @ (W * v[:, None]))
    S = np.zeros((4, 4))
    for log in (0, 1):
        rows = observations.log == log
        g = (W * (v * e)[:, None])[rows].reshape(30, 2, 4).sum(axis=1)
        ones = [autocorrelation(e[group == 2 * log + k])[1] for k in (0, 1)]
        S += _bartlett([g], bandwidth(float(np.mean(ones)), 30))
    expected = bread @ S @ bread * 120 / 116
    found = robust_covariance(estimate, observations, "newey-west")
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-6, atol=1e-12 * expected.max())
    np.testing.assert_array_equal(found.values, estimate.values)
    assert "Newey and West" in found.notes[-1]


def test_bandwidth() -> None:
    assert [bandwidth(r, n) for r, n in ((0.0, 1000), (0.9, 1000), (-0.9, 1000), (0.999, 40))] == [1, 52, 52, 10]


@pytest.mark.slow
def test_intervals_under_correlated_noise_hold_only_with_the_robust_covariance() -> None:
    """Slow regressor and noise: the plain 99 % interval misses often, the robust ones rarely."""
    rng, missed = np.random.default_rng(6), dict.fromkeys(("", "robust", "newey-west", "autoregressive"), 0)
    t = np.arange(600) * 0.01
    W = np.column_stack([np.ones(600), np.sin(2 * np.pi * 0.5 * t)])
    for _ in range(150):
        observations = observations_of(W, W @ [1.0, 2.0] + coloured(rng, 0.8, 600))
        plain = weighted(observations)
        for kind in missed:
            estimate = robust_covariance(plain, observations, kind) if kind else plain
            missed[kind] += int(np.sum(np.abs(estimate.values - [1.0, 2.0]) > estimate.half_width))
    assert missed.pop("") / 300 > 0.2
    assert max(missed.values()) / 300 < 0.06


@pytest.mark.parametrize("method", [least_squares, weighted, huber, recursive])
def test_white_noise_leaves_the_deviations_about_as_they_are(method) -> None:
    rng = np.random.default_rng(7)
    W = rng.normal(size=(4000, 3))
    observations = observations_of(W, W @ np.ones(3) + noise_of(rng, (0.4,), 4000))
    estimate = method(observations)
    for kind in ("robust", "newey-west", "autoregressive"):
        ratio = robust_covariance(estimate, observations, kind).deviation / estimate.deviation
        np.testing.assert_allclose(ratio, 1.0, rtol=0.08)


# --- bad input -------------------------------------------------------------------------------------------------------

GOOD = random_problem(0)[0]


def test_bad_input() -> None:
    other = dataclasses.replace(GOOD, names=("a", "b", "c", "d"))
    for make, message in (
        (lambda: residual_diagnostics(weighted(GOOD), other), "has the parameters b1, b2, b3, b4"),
        (lambda: robust_covariance(instrumental(GOOD, GOOD.W), GOOD), "not implemented for the estimator instrumental"),
        (
            lambda: robust_covariance(weighted(GOOD), GOOD, "white"),
            "no kind of robust covariance named 'white'; available: robust, newey-west, autoregressive",
        ),
    ):
        assert re.search(message, refusal(make))
    W = GOOD.W.copy()
    W[:, 2] = 0.0  # a parameter that is not seen stays so
    blind = dataclasses.replace(GOOD, W=W)
    assert np.isinf(robust_covariance(weighted(blind), blind).deviation).tolist() == [False, False, True, False]


@pytest.mark.parametrize("r", [0.0, 0.9, 0.9999])
def test_the_autocorrelation_of_long_residuals_is_that_of_short_ones(r: float) -> None:
    """By sums of products; as many lags as effective samples need."""
    e = coloured(np.random.default_rng(2), r, 140_000) + 3.0
    found, x = autocorrelation(e), e - e.mean()
    lags = (0, 1, 7, 1000, 16_000)
    np.testing.assert_allclose(found[list(lags)], [x[: x.size - k] @ x[k:] / (x @ x) for k in lags], atol=1e-10)
    assert found.size == e.size or np.any(found.reshape(-1, 2).sum(axis=1) <= 0)
