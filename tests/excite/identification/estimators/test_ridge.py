"""Ridge regression: closed form, its limits at zero and infinite weight, cross-validation, covariance, bad input."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from observed import observations_of, random_problem, robot_observations

import excite
from excite.identification.estimators.least_squares import weighted
from excite.identification.estimators.ridge import Ridge, ridge
from excite.identification.observations import Observations
from excite.registry import ESTIMATORS, instance
from regressors.errors import InputError, UnknownName
from regressors.samples import Array

SEED = st.integers(0, 2**32 - 1)
WEIGHTS = st.sampled_from([1e-6, 1e-2, 1.0, 30.0])


def known(seed: int, p: int = 4) -> tuple[Observations, Array, Array]:
    """Observations of known noise, with whitened columns and left side."""
    observations, _ = random_problem(seed, p=p)
    noise = np.array([0.2, 1.5])
    observations = observations_of(observations.W, observations.y, 2, 1, noise.tolist())
    each = np.tile(noise, len(observations.y) // 2)
    return observations, observations.W / each[:, None], observations.y / each


@given(SEED, WEIGHTS)
@settings(max_examples=15)
def test_values_and_covariance_are_those_of_the_closed_form(seed: int, weight: float) -> None:
    observations, W, y = known(seed)
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


def test_more_weight_means_less_distance_and_less_variance() -> None:
    observations, W, _ = known(3)
    reference = np.array([1.0, -2.0, 0.5, 0.0])
    estimates = [ridge(observations, weight, reference) for weight in (0.0, 1e-3, 0.1, 10.0, 1e9)]
    distances = [float(np.linalg.norm((e.values - reference) * np.linalg.norm(W, axis=0))) for e in estimates]
    variances = [float(np.trace(e.covariance)) for e in estimates]
    residuals = [float(np.sum((e.residual(observations) / np.tile([0.2, 1.5], 60)) ** 2)) for e in estimates]
    assert distances == sorted(distances, reverse=True)
    assert variances == sorted(variances, reverse=True)
    assert residuals == sorted(residuals)
    np.testing.assert_allclose(estimates[-1].values, reference, atol=1e-5)


def test_units_do_not_matter() -> None:
    observations, _, _ = known(4)
    scale = np.array([1e3, 1e-2, 1.0, 7.0])
    other = observations_of(observations.W / scale, observations.y, 2, 1, [0.2, 1.5])
    for weight in (0.5, None):
        np.testing.assert_allclose(ridge(other, weight).values, scale * ridge(observations, weight).values, rtol=1e-6)


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


def test_cross_validation_helps_where_the_motion_shows_little() -> None:
    """Noisy torques at few states of the IRp-6: nearer to the truth than weighted least squares, on the average."""
    errors = []
    for seed in range(12):
        observations, beta = robot_observations("irp6", 0.3, seed, count=20)
        sizes = np.linalg.norm(observations.W, axis=0)
        near = beta * (1 + 0.1 * np.random.default_rng(seed).normal(size=beta.size))
        fits = ridge(observations, None, near).coefficients, weighted(observations).coefficients
        errors.append([np.linalg.norm((fit - beta) * sizes) for fit in fits])
    pulled, free = np.mean(errors, axis=0)
    assert pulled < 0.8 * free


def test_what_the_data_does_not_show_keeps_its_reference() -> None:
    rng = np.random.default_rng(6)
    column = rng.normal(size=40)
    W = np.column_stack([column, np.zeros(40), rng.normal(size=40)])
    estimate = ridge(observations_of(W, 2 * column + 0.01 * rng.normal(size=40)), 0.1, np.array([1.0, 5.0, 0.0]))
    assert estimate.unseen[0] == "b2"
    assert estimate.coefficients[1] == 5.0


@pytest.mark.slow
def test_by_name_towards_the_description(tmp_path: Path) -> None:
    assert "ridge" in ESTIMATORS
    assert type(instance("estimator", "ridge")) is Ridge
    design = excite.design_trajectory(excite.Task("irp6", harmonics=3, starts=1, executor="serial"))
    log = excite.simulate(design, noise=1.0, seed=1, rate=200.0)
    result = excite.identify("irp6", log, design=design, estimator="ridge")
    assert result.estimate.method == "ridge"
    result.save(tmp_path / "result")
    assert excite.load_result(tmp_path / "result").recipe.estimator == "ridge"
    described = excite.identify("irp6", log, design=design, estimator=Ridge(1e9)).coefficients
    np.testing.assert_allclose(described, result.reference.values, rtol=1e-4, atol=1e-5)
    nothing = excite.identify("irp6", log, design=design, estimator=Ridge(1e9, towards="zero")).coefficients
    np.testing.assert_allclose(nothing, 0.0, atol=1e-4)


@pytest.mark.parametrize("weight", [-1.0, np.nan, np.inf])
def test_weights_that_are_none(weight: float) -> None:
    with pytest.raises(InputError, match="ridge: the weight must be zero or a positive number, given"):
        ridge(random_problem(0)[0], weight)


def test_bad_input() -> None:
    with pytest.raises(UnknownName, match="no value to pull towards named 'truth'; available: description, zero"):
        Ridge(towards="truth")
    with pytest.raises(InputError, match="ridge: the reference must be 4 finite numbers"):
        ridge(random_problem(0)[0], 1.0, np.ones(3))
    with pytest.raises(InputError, match="no rows"):
        ridge(random_problem(0)[0].rows(np.arange(0)))
