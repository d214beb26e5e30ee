"""Huber, instrumental variables and ridge regression: other implementations, laws, bad input."""

from __future__ import annotations

import dataclasses
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings, strategies as st
from observed import observations_of, random_problem
from played import EXACT, TASK, found, noisy, played, three_joints

import excite
from excite.identification.estimators.least_squares import Ridge, ridge, weighted
from excite.identification.estimators.robust import huber, instrumental
from excite.identification.observations import Observations
from excite.registry import instance
from regressors.errors import InputError, UnknownName
from regressors.samples import Array

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


def literal_huber(W: Array, y: Array, k: float) -> Array:
    """Iteratively reweighted least squares as in the textbook, scale from the median with its degrees of freedom."""
    values = np.linalg.lstsq(W, y)[0]
    for _ in range(500):
        e = y - W @ values
        scale = 1.482602218505602 * np.median(np.abs(e)) * np.sqrt(len(y) / (len(y) - W.shape[1]))
        w = np.minimum(1.0, k / np.maximum(np.abs(e / scale), 1e-300))
        values = np.linalg.lstsq(W * np.sqrt(w)[:, None], y * np.sqrt(w))[0]
    return np.asarray(values)


@pytest.mark.parametrize("k", [0.8, 1.345, 2.5])
def test_huber_is_the_fixed_point_of_reweighting(k: float) -> None:
    observations, _ = random_problem(1, deviations=(0.3,), instants=150)
    y = observations.y.copy()
    y[:15] += 5.0
    observations = dataclasses.replace(observations, y=y)
    found = huber(observations, threshold=k)
    np.testing.assert_allclose(found.values, literal_huber(observations.W, y, k), atol=1e-6 * found.deviation.min())


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
BAD = (
    (lambda: huber(GOOD, threshold=0.0), "threshold must be greater than zero, given 0.0"),
    (lambda: instrumental(GOOD, GOOD.W[:-1]), r"instruments have shape \(119, 4\), .* W has \(120, 4\)"),
    (lambda: instrumental(GOOD, np.full(GOOD.W.shape, np.nan)), "instruments must hold finite numbers"),
)


def test_bad_settings() -> None:
    for make, message in BAD:
        with pytest.raises(InputError, match=message):
            make()


SEED = st.integers(0, 2**32 - 1)
WEIGHTS = st.sampled_from([1e-6, 1e-2, 1.0, 30.0])


def of_known_noise(seed: int, p: int = 4) -> tuple[Observations, Array, Array]:
    """Observations of known noise, with whitened columns and left side."""
    observations, _ = random_problem(seed, p=p)
    noise = np.array([0.2, 1.5])
    observations = observations_of(observations.W, observations.y, 2, 1, noise.tolist())
    each = np.tile(noise, len(observations.y) // 2)
    return observations, observations.W / each[:, None], observations.y / each


@given(SEED, WEIGHTS)
@settings(max_examples=15)
def test_values_and_covariance_are_those_of_the_closed_form(seed: int, weight: float) -> None:
    observations, W, y = of_known_noise(seed)
    reference = np.random.default_rng(seed).normal(size=4)
    estimate = ridge(observations, weight, reference)
    normal = W.T @ W
    gain = np.linalg.inv(normal + weight * np.diag(np.diag(normal)))
    np.testing.assert_allclose(estimate.values, reference + gain @ W.T @ (y - W @ reference), rtol=1e-7, atol=1e-9)
    expected = gain @ normal @ gain
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(estimate.covariance / size, expected / size, atol=1e-7)


@given(SEED)
@settings(max_examples=10)
def test_without_weight_it_is_weighted_least_squares(seed: int) -> None:
    observations, _ = random_problem(seed)
    estimate, expected = ridge(observations, 0.0, np.ones(4)), weighted(observations)
    np.testing.assert_allclose(estimate.values, expected.values, rtol=1e-8)
    np.testing.assert_allclose(estimate.covariance, expected.covariance, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(estimate.noise, expected.noise, rtol=1e-8)
    assert estimate.degrees_of_freedom == expected.degrees_of_freedom


def test_the_weight_is_the_minimum_of_the_cross_validation_function() -> None:
    """By its definition, the trace of the hat matrix computed row by row; columns that are nearly dependent."""
    rng = np.random.default_rng(5)
    W = rng.normal(size=(60, 5)) @ np.diag([1, 1, 1, 1e-2, 1e-2]) @ rng.normal(size=(5, 5))
    y = W @ rng.normal(size=5) + rng.normal(size=60)
    estimate = ridge(observations_of(W, y, 1, 1, [1.0]))
    weight = float(estimate.notes[0].split()[1].rstrip(","))

    def score(weight: float) -> float:
        hat = W @ np.linalg.inv(W.T @ W + weight * np.diag(np.diag(W.T @ W))) @ W.T
        return float(np.sum((y - hat @ y) ** 2) / (60 - np.trace(hat)) ** 2)

    grid = np.logspace(-8, 3, 400)
    assert score(weight) <= min(map(score, grid)) * (1 + 1e-6)
    assert "by generalised cross-validation" in estimate.notes[0]
    assert any("ignore the bias" in note for note in estimate.notes)


def test_what_the_data_does_not_show_keeps_its_reference() -> None:
    rng = np.random.default_rng(6)
    column = rng.normal(size=40)
    W = np.column_stack([column, np.zeros(40), rng.normal(size=40)])
    estimate = ridge(observations_of(W, 2 * column + 0.01 * rng.normal(size=40)), 0.1, np.array([1.0, 5.0, 0.0]))
    assert estimate.unseen[0] == "b2"
    assert estimate.coefficients[1] == 5.0


@pytest.mark.slow
def test_by_name_towards_the_description(tmp_path: Path) -> None:
    assert type(instance("estimator", "ridge")) is Ridge
    log = noisy(played(three_joints(), 3), 1.0, 1e-6, 1)
    result = found(TASK, log, recipe=replace(EXACT, estimator="ridge"))
    assert result.estimate.method == "ridge"
    result.save(tmp_path / "result")
    assert excite.load_result(tmp_path / "result").recipe.estimator == "ridge"
    pulled = found(TASK, log, recipe=replace(EXACT, estimator=Ridge(1e9))).coefficients
    np.testing.assert_allclose(pulled, result.reference.values, rtol=1e-4, atol=1e-5)
    nothing = found(TASK, log, recipe=replace(EXACT, estimator=Ridge(1e9, towards="zero"))).coefficients
    np.testing.assert_allclose(nothing, 0.0, atol=1e-4)


def test_bad_input() -> None:
    for weight in (-1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="ridge: the weight must be zero or a positive number, given"):
            ridge(random_problem(0)[0], weight)
    with pytest.raises(UnknownName, match="no value to pull towards named 'truth'; available: description, zero"):
        Ridge(towards="truth")
    with pytest.raises(InputError, match="ridge: the reference must be 4 finite numbers"):
        ridge(random_problem(0)[0], 1.0, np.ones(3))
    with pytest.raises(InputError, match="no rows"):
        ridge(random_problem(0)[0].rows(np.arange(0)))
