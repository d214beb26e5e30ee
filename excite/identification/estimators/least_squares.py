"""Ordinary least squares without weights [KD96] eq. (16), without forming the normal equations."""

from __future__ import annotations

import numpy as np

from excite.identification.estimability import estimability, shown_estimate
from excite.identification.estimate import Estimate
from excite.identification.estimator import Context, Estimator, LinearSolution, solve_triangular_system
from excite.identification.observations import GroupFactors, Observations
from regressors.samples import Array


def least_squares(observations: Observations) -> Estimate:
    """Minimiser of ``||W beta - y||`` [KD96] eq. (16).

    The covariance is ``s^2 (W'W)^-1`` with ``s^2 = ||y - W beta||^2 / (m - p)``; with known noise of covariance Sigma
    it is ``(W'W)^-1 W' Sigma W (W'W)^-1``.
    """
    factors = GroupFactors.of(observations)
    solution = solve_triangular_system(factors.stacked(np.ones(factors.count.size)))
    freedom = factors.rows - solution.rank
    variance = solution.square / freedom if freedom > 0 else np.nan
    covariance = plain_covariance(observations, factors, solution, variance)
    noise = residual_noise(observations, factors, solution.values, factors.leverages(solution.half))
    equal = "the intervals assume independent noise of equal variance in all rows"
    note = equal if observations.noise is None else "the intervals use the given noise"
    shown = estimability(solution, observations.names, variance, freedom)
    values = solution.values
    return shown_estimate("least-squares", observations, shown, values, covariance, noise, freedom, (note,))


def plain_covariance(
    observations: Observations, factors: GroupFactors, solution: LinearSolution, variance: float
) -> Array:
    """Covariance of an unweighted estimate, shape (p, p)."""
    half = solution.half
    if observations.noise is None:
        return scaled_covariance(half, variance)
    p = half.shape[0]
    parts = [s * R[:, -p - 1 : -1] @ half for R, s in zip(factors.R, observations.noise.ravel(), strict=True)]
    spread = np.linalg.qr(np.concatenate(parts), mode="r") @ half.T
    return np.asarray(spread.T @ spread)


def scaled_covariance(half: Array, variance: float) -> Array:
    """``variance * half half'``; infinite variances if the variance is not known (NaN)."""
    if np.isnan(variance):
        return np.diag(np.full(half.shape[0], np.inf))
    return np.asarray(variance * (half @ half.T))


def residual_noise(observations: Observations, factors: GroupFactors, values: Array, leverages: Array) -> Array:
    """Known noise of each group, or the standard deviation of its residuals, shape (groups,).

    ``sigma_g^2 = ||y_g - W_g beta||^2 / (n_g - h_g)``; NaN for a group without redundant rows.
    """  # values (p,); leverages (groups,)
    if observations.noise is not None:
        return observations.noise.ravel()
    spare = factors.count - leverages
    squares = factors.squares(values)
    return np.asarray(np.sqrt(np.divide(squares, spare, out=np.full(spare.shape, np.nan), where=spare > 1e-6)))


class LeastSquares(Estimator):
    """Ordinary least squares, all rows weighted equally."""

    name = "least-squares"
    holds_rows = False

    def estimate(self, observations: Observations, context: Context | None = None) -> Estimate:
        """See `least_squares`."""
        return least_squares(observations)
