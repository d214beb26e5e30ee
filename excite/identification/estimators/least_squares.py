"""Least squares without weights [KD96] eq. (16), and weighted by the noise of each log and equation, the default.

Normal equations are never formed. Without weights the joints with the largest torques, and so the largest residuals,
would decide on every parameter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from excite.identification.estimate import Estimate
from excite.identification.estimator import (
    Context,
    Estimator,
    LinearSolution,
    solve_triangular_system,
    stated_estimate,
)
from excite.identification.observations import GroupFactors, Observations
from regressors.errors import InputError
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
    values = solution.values
    return stated_estimate(
        "least-squares", observations, solution, variance, freedom, values, covariance, noise, (note,)
    )


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


def weighted(observations: Observations) -> Estimate:
    """Minimiser of ``sum_g ||y_g - W_g beta||^2 / sigma_g^2`` with covariance ``(W' Sigma^-1 W)^-1``."""
    return weighted_estimate("weighted", observations, weighting(observations))


def weighted_estimate(method: str, observations: Observations, problem: GroupWeights) -> Estimate:
    """Estimate from the solution of a weighted problem."""
    values, covariance = problem.solution.values, scaled_covariance(problem.solution.half, problem.variance)
    return problem.stated(method, observations, problem.variance, values, covariance, problem.notes)


class Weighted(Estimator):
    """Weighted least squares: rows divided by the noise of their log and equation."""

    name = "weighted"
    holds_rows = False

    def estimate(self, observations: Observations, context: Context | None = None) -> Estimate:
        """See `weighted`."""
        return weighted(observations)


_ITERATIONS = 500
_TOLERANCE = 1e-9
_FLOOR = 1e-11  # of a group's y: residuals of exact data are rounding errors


@dataclass(frozen=True, eq=False)
class GroupWeights:
    """Rows divided by their noise, and the least-squares problem of these."""

    factors: GroupFactors
    scale: Array  # (groups,) divisor of each group's rows [unit of its equation]; positive
    R: Array  # (k, p + 1) triangular factor of the rows divided by their scale
    solution: LinearSolution  # of that factor
    freedom: int  # rows less estimated parameters
    notes: tuple[str, ...]

    @property
    def variance(self) -> float:
        """Variance of a row divided by its scale: one, or NaN where it is not given, and no redundant row is left."""
        return 1.0 if self.freedom > 0 or self.notes[0] == _GIVEN else np.nan

    def stated(
        self,
        method: str,
        observations: Observations,
        variance: float,
        values: Array,
        covariance: Array,
        notes: tuple[str, ...],
    ) -> Estimate:
        """Estimate with some values, and the noise of the residuals that they leave."""
        leverages = self.factors.leverages(self.solution.half) / self.scale**2
        noise = residual_noise(observations, self.factors, values, leverages)
        return stated_estimate(
            method, observations, self.solution, variance, self.freedom, values, covariance, noise, notes
        )


_GIVEN = "rows weighted by the given noise"


def weighting(observations: Observations, factors: GroupFactors | None = None) -> GroupWeights:
    """Determine the scales of the groups, and solve the least-squares problem of the scaled rows.

    Unknown noise is a fixed point: ``sigma_g^2 = ||y_g - W_g beta||^2 / (n_g - h_g)`` with the leverage
    ``h_g = tr(W_g (W' Sigma^-1 W)^-1 W_g') / sigma_g^2``, which is restricted maximum likelihood of one variance per
    group [Patterson, Thompson 1971].
    """
    factors = factors if factors is not None else GroupFactors.of(observations)
    p = observations.W.shape[1]
    if observations.noise is not None:
        scale = observations.noise.ravel()
        if not np.all(np.isfinite(scale) & (scale > 0)):
            raise InputError(f"observations: known noise must be positive, given {observations.noise.tolist()}")
        return _problem(factors, scale, p, (_GIVEN,))
    sizes = factors.sizes()
    start = np.where(sizes > 0, sizes, sizes.max(initial=0.0) or 1.0)
    scale, floor = start, _FLOOR * start
    for _ in range(_ITERATIONS):
        solution = solve_triangular_system(factors.stacked(scale)[:, -p - 1 :])
        spare = factors.count - factors.leverages(solution.half) / scale**2
        determined = spare > 1e-6
        noise = np.sqrt(factors.squares(solution.values) / np.where(determined, spare, 1.0))
        updated = np.where(determined, np.maximum(noise, floor), start)
        change = float(np.abs(np.log(updated / scale)).max())
        scale = updated
        if change < _TOLERANCE:
            return _problem(factors, scale, p, ("rows weighted by the residuals of their log and equation",))
    note = (
        f"the weights of the rows did not converge: they still changed by {change:.1e} after {_ITERATIONS} iterations"
    )
    return _problem(factors, scale, p, (note,))


def _problem(factors: GroupFactors, scale: Array, p: int, notes: tuple[str, ...]) -> GroupWeights:
    R = factors.stacked(scale)
    solution = solve_triangular_system(R[:, -p - 1 :])
    return GroupWeights(factors, scale, R, solution, factors.rows - solution.rank, notes)
