"""Huber's estimator, total least squares, instrumental variables: other implementations, laws, Monte-Carlo."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import scipy.optimize
from observed import noise_of, observations_of, random_problem

from excite.identification.estimators.huber import huber
from excite.identification.estimators.instrumental import instrumental
from excite.identification.estimators.least_squares import weighted
from excite.identification.estimators.total import total
from regressors.errors import InputError
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


def test_far_rows_hardly_move_huber_and_do_move_weighted() -> None:
    observations, beta = random_problem(2, instants=300)
    y = observations.y.copy()
    y[np.random.default_rng(0).choice(y.size, 30, replace=False)] += 1e3
    spoiled = dataclasses.replace(observations, y=y)
    found, plain = huber(spoiled), weighted(spoiled)
    assert np.all(np.abs(found.values - beta) < 4 * found.deviation)
    assert np.all(found.deviation < 0.1 * plain.deviation)
    np.testing.assert_allclose(found.noise, [[0.2, 1.5]], rtol=0.25)


def test_huber_costs_five_percent_on_normal_noise() -> None:
    observations, _ = random_problem(3, instants=4000)
    ratio = huber(observations).deviation / weighted(observations).deviation
    np.testing.assert_allclose(ratio**2, 1 / 0.95, rtol=0.05)


@pytest.mark.slow
def test_coverage_of_huber_with_heavy_tails() -> None:
    rng = np.random.default_rng(4)
    W, beta, inside, runs = rng.normal(size=(150, 3)), np.array([1.0, -2.0, 0.5]), 0, 250
    for _ in range(runs):
        y = W @ beta + rng.standard_t(3, size=150)
        estimate = huber(observations_of(W, y))
        inside += int(np.sum(np.abs(estimate.values - beta) <= estimate.half_width))
    assert inside / (3 * runs) > 0.975


def test_huber_of_exact_data_is_exact() -> None:
    W, beta = np.random.default_rng(5).normal(size=(50, 3)), np.array([1.0, 2.0, 3.0])
    y = W @ beta
    y[7] += 1.0
    np.testing.assert_allclose(huber(observations_of(W, y)).values, beta, atol=1e-9)


# --- total least squares ---------------------------------------------------------------------------------------------


def noisy_columns(
    rng: np.random.Generator, truth: Array, beta: Array, column_noise: Array, noise: float
) -> tuple[Array, Array]:
    W = truth + column_noise * rng.normal(size=truth.shape)
    return W, truth @ beta + noise * rng.normal(size=len(truth))


def test_total_is_the_smallest_distance_to_the_plane() -> None:
    """Each row's distance from its plane in units of the errors, ``(y - w b) / sqrt(s_y^2 + sum (s_j b_j)^2)``."""
    rng = np.random.default_rng(6)
    truth, beta, sx = rng.normal(size=(60, 2)) * [1.0, 5.0], np.array([2.0, -0.7]), np.array([0.1, 0.3])
    W, y = noisy_columns(rng, truth, beta, sx, 0.2)

    def distances(b: Array) -> Array:
        return np.asarray((y - W @ b) / np.sqrt(0.2**2 + np.sum((sx * b) ** 2)))

    nearest = scipy.optimize.least_squares(distances, np.linalg.lstsq(W, y)[0], xtol=1e-15, gtol=1e-15, ftol=1e-15)
    found = total(observations_of(W, y), column_noise=sx / 0.2)
    np.testing.assert_allclose(found.values, nearest.x, rtol=1e-6)


@pytest.mark.parametrize("ratio", [0.3, 1.0, 4.0])
def test_total_is_the_smallest_singular_vector(ratio: float) -> None:
    rng = np.random.default_rng(7)
    truth, beta = rng.normal(size=(40, 3)) * [1.0, 50.0, 0.1], np.array([2.0, -0.7, 30.0])
    W, y = noisy_columns(rng, truth, beta, 0.05 * np.array([1.0, 50.0, 0.1]), 0.5)
    nu = ratio * np.linalg.norm(W, axis=0) / np.linalg.norm(y)
    v = np.linalg.svd(np.column_stack([W / nu, y]))[2][-1]
    np.testing.assert_allclose(total(observations_of(W, y), ratio=ratio).values, -v[:3] / v[3] / nu, rtol=1e-7)


def test_exact_columns_are_left_as_they_are() -> None:
    """Mixed problem: exact columns projected out by hand, then the singular vector."""
    rng = np.random.default_rng(8)
    W, y = rng.normal(size=(40, 4)), rng.normal(size=40)
    exact, noisy = W[:, [0, 2]], W[:, [1, 3]]
    P = np.eye(40) - exact @ np.linalg.pinv(exact)
    v = np.linalg.svd(P @ np.column_stack([noisy, y]))[2][-1]
    x = -v[:2] / v[2]
    expected = np.empty(4)
    expected[[1, 3]] = x
    expected[[0, 2]] = np.linalg.lstsq(exact, y - noisy @ x)[0]
    found = total(observations_of(W, y), column_noise=np.array([0.0, 1.0, 0.0, 1.0]))
    np.testing.assert_allclose(found.values, expected, rtol=1e-8)


def test_without_errors_in_the_columns_total_is_weighted() -> None:
    observations, _ = random_problem(9)
    found, expected = total(observations, ratio=0.0), weighted(observations)
    np.testing.assert_allclose(found.values, expected.values, rtol=1e-9)
    np.testing.assert_allclose(found.covariance, expected.covariance, rtol=1e-2)


def test_total_is_unbiased_and_its_deviations_hold_where_weighted_is_biased() -> None:
    rng = np.random.default_rng(10)
    truth, beta = rng.normal(size=(400, 2)), np.array([3.0, -1.0])
    found, plain, deviations = [], [], []
    for _ in range(250):
        W, y = noisy_columns(rng, truth, beta, np.array([0.3, 0.3]), 0.3)
        estimate = total(observations_of(W, y), column_noise=np.ones(2))
        found.append(estimate.values)
        deviations.append(estimate.deviation)
        plain.append(weighted(observations_of(W, y)).values)
    spread = np.std(found, axis=0)
    assert np.all(np.abs(np.mean(found, axis=0) - beta) < 3.5 * spread / np.sqrt(250))
    assert np.abs(np.mean(plain, axis=0) - beta).max() > 0.15
    np.testing.assert_allclose(np.mean(deviations, axis=0), spread, rtol=0.12)


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


def test_instruments_that_are_the_regressor_itself_give_weighted() -> None:
    observations, _ = random_problem(12, deviations=(0.5,))
    found, expected = instrumental(observations, observations.W), weighted(observations)
    np.testing.assert_allclose(found.values, expected.values, rtol=1e-8)
    np.testing.assert_allclose(found.covariance, expected.covariance, rtol=1e-6)


def test_instruments_remove_the_bias_of_a_noisy_regressor() -> None:
    rng = np.random.default_rng(13)
    truth, beta = rng.normal(size=(400, 2)), np.array([3.0, -1.0])
    Z = truth + 0.2 * rng.normal(size=truth.shape)  # simulated: another motion than the true one, without its noise
    inside, plain = 0, []
    for _ in range(250):
        W = truth + 0.3 * rng.normal(size=truth.shape)
        observations = observations_of(W, truth @ beta + noise_of(rng, (0.3,), 400))
        estimate = instrumental(observations, Z)
        inside += int(np.sum(np.abs(estimate.values - beta) <= estimate.half_width))
        plain.append(weighted(observations).values)
    assert inside / 500 > 0.975
    assert np.abs(np.mean(plain, axis=0) - beta).max() > 0.15


# --- bad input -------------------------------------------------------------------------------------------------------

GOOD = random_problem(0)[0]
BAD = {
    "threshold": (lambda: huber(GOOD, threshold=0.0), "threshold must be greater than zero, given 0.0"),
    "ratio": (lambda: total(GOOD, ratio=-1.0), "ratio must be zero or more, given -1.0"),
    "columns": (lambda: total(GOOD, column_noise=np.ones(3)), r"4 numbers of zero or more, given \[1.0, 1.0, 1.0\]"),
    "shape": (lambda: instrumental(GOOD, GOOD.W[:-1]), r"instruments have shape \(119, 4\), .* W has \(120, 4\)"),
    "nan": (lambda: instrumental(GOOD, np.full(GOOD.W.shape, np.nan)), "instruments must hold finite numbers"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_settings(case: str) -> None:
    make, message = BAD[case]
    with pytest.raises(InputError, match=message):
        make()


def test_errors_as_large_as_the_columns_have_no_solution() -> None:
    W = np.concatenate([np.eye(2), np.zeros((2, 2))])
    y = np.array([0.0, 0.0, 1.0, 0.0])  # orthogonal to the columns, and [W y] has equal singular values
    with pytest.raises(InputError, match="errors are as large as the columns"):
        total(observations_of(W, y, known=[1.0]), column_noise=np.ones(2))
