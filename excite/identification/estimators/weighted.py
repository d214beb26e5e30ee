"""Weighted least squares: each row divided by the noise of its log and equation. The default estimator.

Without weights the joints with the largest torques, and so the largest residuals, would decide on every parameter.
"""

from __future__ import annotations

from excite.identification.estimability import Estimability, estimability, shown_estimate
from excite.identification.estimate import Estimate
from excite.identification.estimator import Context, Estimator
from excite.identification.estimators.least_squares import scaled_covariance
from excite.identification.observations import Observations
from excite.identification.weights import GroupWeights, weighting


def weighted(observations: Observations) -> Estimate:
    """Minimiser of ``sum_g ||y_g - W_g beta||^2 / sigma_g^2`` with covariance ``(W' Sigma^-1 W)^-1``."""
    return weighted_estimate("weighted", observations, weighting(observations))


def weighted_estimate(method: str, observations: Observations, problem: GroupWeights) -> Estimate:
    """Estimate from the solution of a weighted problem."""
    covariance = scaled_covariance(problem.solution.half, problem.variance)
    noise = problem.noise(observations)
    values, freedom = problem.solution.values, problem.freedom
    shown = shown_by(observations, problem)
    return shown_estimate(method, observations, shown, values, covariance, noise, freedom, problem.notes)


def shown_by(observations: Observations, problem: GroupWeights | None = None) -> Estimability:
    """Which parameters are identifiable from observations, each row weighted by its noise."""
    problem = problem if problem is not None else weighting(observations)
    return estimability(problem.solution, observations.names, problem.variance, problem.freedom)


class Weighted(Estimator):
    """Weighted least squares: rows divided by the noise of their log and equation."""

    name = "weighted"
    holds_rows = False

    def estimate(self, observations: Observations, context: Context | None = None) -> Estimate:
        """See `weighted`."""
        return weighted(observations)
