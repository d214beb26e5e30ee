"""Autoregressive noise and the covariances that follow from it, against matrices written out."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.signal
from observed import observations_of

from excite.identification.autoregressive_noise import (
    NoiseGroup,
    _autocovariance,
    _Spread,
    autoregressive_covariance,
    autoregressive_noise,
)
from excite.identification.covariance import robust_covariance
from excite.identification.estimators.least_squares import weighted
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


def test_white_noise_has_no_coefficients() -> None:
    assert autoregressive_noise(np.array([2.0, 0.01, -0.02]), 500).coefficients.size == 0


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
    spread = _Spread.of(group, D, autoregressive_noise(ar2_autocovariance(lags + 1), 10_000))
    C = B.T @ Omega @ B
    np.testing.assert_allclose(spread.covariance, C, rtol=1e-9)
    left_over = Omega - X @ B.T @ Omega - (X @ B.T @ Omega).T + X @ C @ X.T
    shares = [n / (n - k) * sum(float(d[: n - k] @ d[k:]) for d in D.T) for k in range(lags)]
    lost = [np.trace(Omega - left_over, offset=k) for k in range(lags)]
    removed = spread.removed(group, np.linalg.cholesky(C), spread.shares.size)[:lags]
    np.testing.assert_allclose(removed, np.array(lost) / shares, rtol=1e-9)


def test_channels_scale_the_autocovariance() -> None:
    rng = np.random.default_rng(4)
    D = rng.uniform(0.5, 2.0, (40_000, 1))
    e = scipy.signal.lfilter([1.0], [1.0, -0.8], rng.normal(size=40_000))
    expected = 0.8 ** np.arange(4) / (1 - 0.8**2)
    np.testing.assert_allclose(_autocovariance(D[:, 0] * e, D)[:4], expected, rtol=0.05)


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


def test_deviations_of_autoregressive_noise_are_those_that_the_estimates_have() -> None:
    rng = np.random.default_rng(6)
    n, rho = 1500, 0.9
    t = np.arange(n) * 0.005
    W = np.column_stack([np.sin(2 * t), np.cos(5 * t), np.sign(np.sin(3 * t))])
    B = np.linalg.pinv(W)
    exact = np.sqrt(np.diag(B @ scipy.linalg.toeplitz(rho ** np.arange(n) / (1 - rho**2)) @ B.T))
    stated = []
    for _ in range(20):
        e = scipy.signal.lfilter([1.0], [1.0, -rho], rng.normal(size=n + 100))[100:]
        observations = observations_of(W, W @ [1.0, 2.0, 3.0] + e)
        stated.append(robust_covariance(weighted(observations), observations, "autoregressive").deviation)
    np.testing.assert_allclose(np.mean(stated, axis=0), exact, rtol=0.1)
