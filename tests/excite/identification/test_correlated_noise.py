"""Autoregressive noise, noise of long windows, and stretches of long logs, against the matrices written out."""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.ndimage
import scipy.signal
from observed import observations_of
from played import EXACT, TASK, irp6, noisy, played, three_joints

from excite.identification import observations as module
from excite.identification.covariance import robust_covariance
from excite.identification.equations import equations_of, right_sides
from excite.identification.estimator import Context
from excite.identification.estimators.least_squares import least_squares, weighted
from excite.identification.noise import (
    NoiseGroup,
    _autocovariance,
    _removed,
    _shares,
    _spread,
    autoregressive_covariance,
    autoregressive_noise,
    noise_origin,
    noise_paths,
)
from excite.identification.observations import Observations, join_observations, row_stretches
from excite.identification.preparation import prepare
from excite.identification.procedure import estimate_parameters
from excite.identification.recipe import Recipe
from excite.information.target import target_of
from excite.tasks.task import Task
from regressors.samples import Array


def ar2_autocovariance(count: int) -> Array:
    """Of ``n_t = 1.2 n_{t-1} - 0.5 n_{t-2} + u_t``, from its impulse response."""
    h = scipy.signal.lfilter([1.0], [1.0, -1.2, 0.5], np.eye(1, 2000)[0])
    return np.array([h[: h.size - k] @ h[k:] for k in range(count)])


def test_yule_and_walker_recover_the_coefficients() -> None:
    noise = autoregressive_noise(ar2_autocovariance(12), 10_000)
    np.testing.assert_allclose(noise.coefficients, [1.2, -0.5], atol=1e-9)
    assert noise.variance == pytest.approx(1.0)
    length = 4096
    gamma = np.fft.irfft(noise.spectrum(length), length)[:12]
    np.testing.assert_allclose(gamma, ar2_autocovariance(12), rtol=1e-9)
    assert autoregressive_noise(np.array([2.0, 0.01, -0.02]), 500).coefficients.size == 0
    rng = np.random.default_rng(4)
    D = rng.uniform(0.5, 2.0, (40_000, 1))  # channels scale the autocovariance
    e = scipy.signal.lfilter([1.0], [1.0, -0.8], rng.normal(size=40_000))
    expected = 0.8 ** np.arange(4) / (1 - 0.8**2)
    np.testing.assert_allclose(_autocovariance(D[:, 0] * e, _shares(D))[:4], expected, rtol=0.05)


@pytest.mark.parametrize("channels", [1, 2])
def test_the_spread_is_that_of_the_matrices(channels: int) -> None:
    """``B Omega B'`` and the autocovariance that a fit removes, by dense matrices."""
    rng = np.random.default_rng(3)
    n, r, lags = 120, 3, 5
    D = np.ones((n, 1)) if channels == 1 else rng.uniform(0.5, 2.0, (n, 2))
    X, B = rng.normal(size=(n, r)), rng.normal(size=(n, r)) / n
    T = scipy.linalg.toeplitz(ar2_autocovariance(n))
    Omega = sum(np.outer(d, d) * T for d in D.T)
    group = NoiseGroup(np.zeros(n), X, B, D)
    carried, spread = _spread(group, D, autoregressive_noise(ar2_autocovariance(lags + 1), 10_000))
    C = B.T @ Omega @ B
    np.testing.assert_allclose(spread, C, rtol=1e-9)
    left_over = Omega - X @ B.T @ Omega - (X @ B.T @ Omega).T + X @ C @ X.T
    shares = [n / (n - k) * sum(float(d[: n - k] @ d[k:]) for d in D.T) for k in range(lags)]
    lost = [np.trace(Omega - left_over, offset=k) for k in range(lags)]
    removed = _removed(X, carried, C, _shares(D))[:lags]
    np.testing.assert_allclose(removed, np.array(lost) / shares, rtol=1e-9)


def test_noise_that_the_fit_removes_is_restored() -> None:
    """Slow noise, slow regressor, few rows: residuals alone say half of the variance, the fixed point all of it."""
    rng = np.random.default_rng(5)
    n, rho = 300, 0.95
    t = np.arange(n) / n
    W = np.column_stack([np.ones(n), *(f(2 * np.pi * k * t) for k in range(1, 4) for f in (np.sin, np.cos))])
    B = np.linalg.pinv(W)
    exact = np.diag(B @ scipy.linalg.toeplitz(rho ** np.arange(n) / (1 - rho**2)) @ B.T)
    stated, naive = [], []
    for _ in range(15):
        u = rng.normal(size=n + 200)
        e = scipy.signal.lfilter([1.0], [1.0, -rho], u)[200:]
        groups = [NoiseGroup(e - W @ (B @ e), W, B.T, np.ones((n, 1)))]
        stated.append(np.diag(autoregressive_covariance(groups, 20.0)))
        naive.append(np.diag(autoregressive_covariance(groups, 1e6)))  # as if fitting removed nothing
    assert np.all(np.mean(naive, axis=0)[:3] < 0.6 * exact[:3])
    ratio = np.mean(stated, axis=0)[1:] / exact[1:]
    assert np.all((ratio > 0.75) & (ratio < 3.0))


def test_almost_as_many_parameters_as_effective_rows_leave_finite_deviations() -> None:
    """Restoring what the fit removes has no fixed point then."""
    rng = np.random.default_rng(1)
    rows, noise = (scipy.ndimage.gaussian_filter1d(rng.normal(size=(3, 200, k)), 6, axis=1) for k in (30, 1))
    Q = np.linalg.qr(rows.reshape(600, 30))[0]
    e = noise.ravel() - Q @ (Q.T @ noise.ravel())
    groups = [
        NoiseGroup(n, X, X, np.ones((200, 1))) for n, X in zip(e.reshape(3, 200), Q.reshape(3, 200, 30), strict=True)
    ]
    assert np.sqrt(np.trace(autoregressive_covariance(groups, 50.0))) < 100 * np.std(noise)
    one = np.ones((1, 1))  # a single row is white
    np.testing.assert_allclose(autoregressive_covariance([NoiseGroup(np.full(1, 0.1), 0 * one, one, one)], 9.0), 0.01)


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
    paths = noise_paths(estimate, observations, cumulated=True)
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
        stated.append(robust_covariance(least_squares(observations), observations, kind, cumulated=True).deviation)
    A = np.linalg.pinv(observations.W) @ np.tril(np.ones((400, 400)))
    exact = 0.1 * np.linalg.norm(A, axis=1)
    assert np.all(least_squares(observations).deviation < 0.5 * exact)  # as if independent
    np.testing.assert_allclose(np.mean(stated, axis=0), exact, rtol=0.2)


@pytest.mark.parametrize("window", ["short", "long"])
def test_channels_are_the_changes_of_the_rows_with_the_measured_torques(window: str) -> None:
    log = played(three_joints(), 3)
    task = TASK.changed(model="energy", window=window)
    target, recipe = target_of(irp6(), task), Recipe(rows="all", sign_width=0.0)
    part = prepare(log, irp6(), target, recipe)
    cumulated, channels = noise_origin(Context(target, (part,), recipe))
    rng = np.random.default_rng(3)
    gains = rng.normal(size=3)
    shifted = dataclasses.replace(part, measured=part.measured + gains)
    before, after = (join_observations([equations_of(target, p, recipe)]).y for p in (part, shifted))
    np.testing.assert_allclose(channels @ gains, after - before, atol=1e-9)
    assert cumulated == (window == "long")


def test_long_windows_of_the_energy_model_cover() -> None:
    """Logs of 4 s: 13 parameters, of which the intervals for independent noise miss many."""
    exact = played(three_joints(), 3, seconds=4.0)
    task = Task("irp6", model="energy", window="long")
    missed = dict.fromkeys(("auto", "white"), 0)
    for seed in range(3):
        for kind in missed:
            log, recipe = noisy(exact, 1.0, 0.0, seed), dataclasses.replace(EXACT, covariance=kind)
            estimate = (found := estimate_parameters(irp6(), task, [log], recipe)).estimate
            missed[kind] += int(np.sum(np.abs(estimate.values - found.reference.values) > estimate.half_width))
    assert missed["white"] / (3 * 13) > 0.2
    assert missed["auto"] / (3 * 13) < 0.03
    assert any("cumulated sum" in note for note in found.estimate.notes)
    # a model of single instants has none
    assert noise_origin(Context(target_of(irp6(), TASK), (), Recipe())) == (False, None)


def test_short_windows_state_the_noise_of_torques_times_velocities() -> None:
    """Against torques drawn again, through the windows' right-hand sides and the pseudoinverse of W."""
    exact, task, drawn = played(three_joints(), 3, rate=1000.0, seconds=4.0), Task("irp6", model="energy"), 1.0
    logs = [noisy(exact, drawn, 0.0, seed) for seed in range(4)]
    results = [estimate_parameters(irp6(), task, [log], EXACT) for log in logs]
    alike = estimate_parameters(irp6(), task, logs[:1], dataclasses.replace(EXACT, covariance="white"))
    part, rng = alike.prepared[0], np.random.default_rng(0)
    torques = drawn * rng.normal(size=(300, *part.measured.shape))
    inverse = np.linalg.pinv(alike.observations.W)
    scatter = np.std(right_sides(alike.target, part, alike.recipe, torques).T @ inverse.T, axis=0)
    np.testing.assert_allclose(np.mean([r.estimate.deviation for r in results], axis=0), scatter, rtol=0.2)
    assert np.max(np.abs(np.log(alike.estimate.deviation / scatter))) > 0.25
    assert any("what multiplies them" in note for note in results[0].estimate.notes)


COUNT = 6000


def correlated(logs: tuple[int, ...] = (COUNT,)) -> Observations:
    """Two equations with autoregressive noise, and a motion that is the same throughout."""
    n = sum(logs)
    t, W = np.arange(n), np.zeros((n, 2, 3))
    W[:, 0, 0], W[:, 0, 1], W[:, 1, 1] = np.sin(t / 3), np.cos(t / 11), np.sin(t / 7)
    W[:, 1, 2] = 1.0
    e = scipy.signal.lfilter([1.0], [1.0, -0.8], np.random.default_rng(3).normal(size=(n, 2)), axis=0)
    one = observations_of(W.reshape(-1, 3), (W @ np.ones(3) + e).reshape(-1), 2, step=1.0)
    names = tuple(f"L{k}" for k in range(len(logs)))
    return replace(one, log=np.repeat(np.arange(len(logs)), logs).repeat(2), logs=names)


@pytest.mark.parametrize("logs", [(COUNT,), (4000, 2000), (5000, 3, 997)])
def test_stretches_are_whole_instants_of_one_log_each(logs: tuple[int, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST", 2000)
    observations = correlated(logs)
    stretches = row_stretches(observations)
    assert 0.9 * 2000 < sum(s.stop - s.start for s in stretches) <= 2000 + 2 * len(logs)
    assert len(stretches) in range(8, 10)
    for before, after in itertools.pairwise(stretches):
        assert before.stop <= after.start
    for s in stretches:
        assert s.start % 2 == s.stop % 2 == 0
        assert np.unique(observations.log[s]).size == 1
    assert set(observations.log[[s.start for s in stretches]].tolist()) == set(range(len(logs)))


def test_stretches_of_a_uniform_motion_give_what_all_rows_give(monkeypatch: pytest.MonkeyPatch) -> None:
    observations = correlated()
    assert row_stretches(observations) == [slice(0, 2 * COUNT)]
    estimate = weighted(observations)
    whole = robust_covariance(estimate, observations, "autoregressive")
    monkeypatch.setattr(module, "MOST", 4000)
    part = robust_covariance(estimate, observations, "autoregressive")
    np.testing.assert_allclose(part.deviation, whole.deviation, rtol=0.1)
    assert np.all(whole.deviation / estimate.deviation > [0.5, 1.5, 2.0])
    assert "found from 4000 of 12000 rows" in part.notes[-1]
    assert "of 12000 rows" in robust_covariance(estimate, observations).notes[-1]
