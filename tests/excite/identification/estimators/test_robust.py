"""Huber and instrumental variables: other implementations, laws, bad input."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
import scipy.optimize
from observed import observations_of, random_problem
from refused import refusal

from excite.identification.estimators.robust import huber, instrumental

# --- Huber -----------------------------------------------------------------------------------------------------------


def test_huber_minimises_hubers_loss() -> None:
    """SciPy's general minimiser on the same loss, with the noise known."""
    observations, _ = random_problem(0, deviations=(0.3,))
    observations = dataclasses.replace(observations, noise=np.array([[0.3]]))
    y = observations.y.copy()
    y[::7] += 20.0
    observations = dataclasses.replace(observations, y=y)
    oracle = scipy.optimize.least_squares(
        lambda x: (observations.W @ x - y) / 0.3, np.zeros(4), loss="huber", f_scale=1.345, x_scale="jac", gtol=1e-14
    )
    found = huber(observations)
    np.testing.assert_allclose(found.values, oracle.x, atol=1e-5 * float(found.deviation.min()), rtol=1e-5)


@pytest.mark.parametrize("k", [0.8, 1.345, 2.5])
def test_huber_is_the_fixed_point_of_reweighting(k: float) -> None:
    """Iteratively reweighted least squares as in the textbook, scale from the median with its degrees of freedom."""
    observations, _ = random_problem(1, deviations=(0.3,), instants=150)
    W, y = observations.W, observations.y.copy()
    y[:15] += 5.0
    found = huber(dataclasses.replace(observations, y=y), threshold=k)
    values = np.linalg.lstsq(W, y)[0]
    for _ in range(500):
        e = y - W @ values
        scale = 1.482602218505602 * np.median(np.abs(e)) * np.sqrt(len(y) / (len(y) - W.shape[1]))
        w = np.minimum(1.0, k / np.maximum(np.abs(e / scale), 1e-300))
        values = np.linalg.lstsq(W * np.sqrt(w)[:, None], y * np.sqrt(w))[0]
    np.testing.assert_allclose(found.values, values, atol=1e-6 * found.deviation.min())


@pytest.mark.slow
def test_coverage_of_huber_with_heavy_tails() -> None:
    rng = np.random.default_rng(4)
    W, beta, inside, runs = rng.normal(size=(150, 3)), np.array([1.0, -2.0, 0.5]), 0, 200
    for _ in range(runs):
        y = W @ beta + rng.standard_t(3, size=150)
        estimate = huber(observations_of(W, y))
        inside += int(np.sum(np.abs(estimate.values - beta) <= estimate.half_width))
    assert inside / (3 * runs) > 0.975


# --- instrumental variables ------------------------------------------------------------------------------------------


def test_instruments_are_the_closed_form() -> None:
    observations, _ = random_problem(11)
    observations = dataclasses.replace(observations, noise=np.array([[0.2, 1.5]]))
    Z = observations.W + np.random.default_rng(0).normal(size=observations.W.shape)
    w = 1 / np.tile([0.2, 1.5], 60) ** 2
    G = np.linalg.solve(Z.T @ (observations.W * w[:, None]), Z.T * w)
    found = instrumental(observations, Z)
    np.testing.assert_allclose(found.values, G @ observations.y, rtol=1e-7)
    np.testing.assert_allclose(found.covariance, (G / w) @ G.T, rtol=1e-6)


# --- bad input -------------------------------------------------------------------------------------------------------

GOOD = random_problem(0)[0]


def test_bad_settings() -> None:
    for make, message in (
        (lambda: huber(GOOD, threshold=0.0), "threshold must be greater than zero, given 0.0"),
        (lambda: instrumental(GOOD, GOOD.W[:-1]), r"instruments have shape \(119, 4\), .* W has \(120, 4\)"),
        (lambda: instrumental(GOOD, np.full(GOOD.W.shape, np.nan)), "instruments must hold finite numbers"),
    ):
        assert re.search(message, refusal(make))
