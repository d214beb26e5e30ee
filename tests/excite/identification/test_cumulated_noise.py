"""Noise of long windows: how it enters the estimate, against the matrices written out, and what the intervals cover."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from observed import observations_of
from played import EXACT, TASK, irp6, noisy, played, three_joints

from excite.identification.autoregressive_noise import NoiseOrigin, noise_origin, noise_paths
from excite.identification.covariance import robust_covariance, with_covariance
from excite.identification.equations import equations_of
from excite.identification.estimation import estimate_parameters
from excite.identification.estimator import Context
from excite.identification.estimators.least_squares import least_squares
from excite.identification.observations import Observations, join_observations
from excite.identification.preparation import prepare
from excite.identification.recipe import Recipe
from excite.information.target import target_of
from excite.tasks.task import Task
from regressors.samples import Array

CUMULATED = NoiseOrigin(cumulated=True)
BETA = np.array([1.0, -2.0, 0.5])


def long_windows(rng: np.random.Generator, count: int = 400, equations: int = 2) -> tuple[Observations, Array]:
    """Two equations of smooth growing rows, and the white noise that they cumulate, shape (m,)."""
    t = np.arange(1, count + 1) / count
    rows = [np.column_stack([np.sin(5 * t + k), t**2, np.cos(9 * t) - 1.0]) for k in range(equations)]
    noise = rng.normal(size=(count, equations)) * [0.1, 0.3][:equations]
    W = np.stack(rows, axis=1).reshape(-1, 3)
    return observations_of(W, W @ BETA + np.cumsum(noise, axis=0).ravel(), equations), noise.ravel()


def test_the_error_of_the_estimate_is_the_sum_over_the_noise() -> None:
    observations, noise = long_windows(np.random.default_rng(0))
    estimate = least_squares(observations)
    paths = noise_paths(estimate, observations, CUMULATED)
    error = estimate.values - BETA
    W = observations.W
    np.testing.assert_allclose(np.linalg.solve(W.T @ W, paths.sums.T @ noise), error, rtol=1e-9)
    np.testing.assert_allclose(paths.noise, noise - paths.rows @ error, atol=1e-12)


@pytest.mark.parametrize("kind", ["robust", "newey-west", "autoregressive"])
def test_the_deviations_are_those_of_noise_that_is_a_cumulated_sum(kind: str) -> None:
    """Against ``A^-1 W' L L' W A^-1`` with the lower triangle L of ones, one equation of known white noise."""
    rng = np.random.default_rng(1)
    stated = []
    for _ in range(20):
        observations, _ = long_windows(rng, equations=1)
        stated.append(robust_covariance(least_squares(observations), observations, kind, CUMULATED).deviation)
    A = np.linalg.pinv(observations.W) @ np.tril(np.ones((400, 400)))
    exact = 0.1 * np.linalg.norm(A, axis=1)
    assert np.all(least_squares(observations).deviation < 0.5 * exact)  # as if independent
    np.testing.assert_allclose(np.mean(stated, axis=0), exact, rtol=0.2)


def test_auto_takes_long_windows_as_cumulated_without_asking_the_residuals() -> None:
    observations, _ = long_windows(np.random.default_rng(2))
    estimate = least_squares(observations)
    auto, robust = (with_covariance(estimate, observations, kind, CUMULATED) for kind in ("auto", "robust"))
    np.testing.assert_array_equal(auto.covariance, robust.covariance)
    assert with_covariance(estimate, observations, "white", CUMULATED) is estimate


@pytest.mark.parametrize("window", ["short", "long"])
def test_channels_are_the_changes_of_the_rows_with_the_measured_torques(window: str) -> None:
    log = played(three_joints(), 3)
    task = TASK.changed(model="energy", window=window)
    target, recipe = target_of(irp6(), task), Recipe(rows="all", sign_width=0.0)
    part = prepare(log, irp6(), target, recipe)
    origin = noise_origin(Context(target, (part,), recipe))
    rng = np.random.default_rng(3)
    gains = rng.normal(size=3)
    shifted = dataclasses.replace(part, measured=part.measured + gains)
    before, after = (join_observations([equations_of(target, p, recipe)]).y for p in (part, shifted))
    assert origin.channels is not None
    np.testing.assert_allclose(origin.channels @ gains, after - before, atol=1e-9)
    assert origin.cumulated == (window == "long")


def test_a_model_of_single_instants_has_no_channels() -> None:
    target = target_of(irp6(), TASK)
    origin = noise_origin(Context(target, (), Recipe()))
    assert not origin.cumulated
    assert origin.channels is None


def test_long_windows_of_the_energy_model_cover() -> None:
    """Logs of 4 s: 13 parameters, of which the intervals for independent noise miss many."""
    exact = played(three_joints(), 3, seconds=4.0)
    task = Task("irp6", model="energy", window="long")
    missed = {"auto": 0, "white": 0}
    for seed in range(5):
        for kind in missed:
            recipe = dataclasses.replace(EXACT, covariance=kind)
            found = estimate_parameters(irp6(), task, [noisy(exact, 1.0, 0.0, seed)], recipe)
            assert found.reference is not None
            missed[kind] += int(
                np.sum(np.abs(found.estimate.values - found.reference.values) > found.estimate.half_width)
            )
    assert missed["white"] / (5 * 13) > 0.2
    assert missed["auto"] / (5 * 13) < 0.03
    assert any("cumulated sum" in note for note in found.estimate.notes)
