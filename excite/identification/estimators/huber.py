"""Robust estimation: rows far from the rest count less [Huber 1981]."""

from __future__ import annotations

import numpy as np

from excite.identification.estimate import Estimate
from excite.identification.estimator import (
    Context,
    Estimator,
    LinearSolution,
    solve_triangular_system,
    stated_estimate,
)
from excite.identification.estimators.least_squares import scaled_covariance, weighting
from excite.identification.observations import Observations
from regressors.errors import InputError
from regressors.samples import Array, Index

THRESHOLD = 1.345  # 95 % efficiency for normal noise
_NORMAL = 1.482602218505602  # standard deviation over median magnitude of a normal variable
_ITERATIONS = 300
_TOLERANCE = 1e-9  # last step over standard deviation
_FLOOR = 1e-11


def huber(observations: Observations, threshold: float = THRESHOLD) -> Estimate:
    """Huber's M-estimate: the solution of ``sum_i psi((y_i - w_i beta) / sigma_g) w_i / sigma_g = 0``.

    ``psi(u) = u`` up to the threshold, constant beyond; sigma_g is known, or 1.4826 times the median magnitude of the
    group's residuals. The same equation as that of iteratively reweighted least squares, with weights
    ``min(1, k / |u|)``; solved with modified residuals [Huber 1981, section 7.8], so that W is factored only once. The
    covariance is Huber's, ``K^2 (sum psi^2 / (m - p)) / mean(psi')^2 (W' Sigma^-1 W)^-1`` with
    ``K = 1 + p/m (1 - mean psi') / mean psi'`` [Huber 1981, section 7.6].
    """
    if not threshold > 0:
        raise InputError(f"huber: the threshold must be greater than zero, given {threshold}")
    solution, values, scale, ratio, step = _fit(observations, threshold)
    count = observations.y.size
    freedom = count - solution.rank
    inside = float(np.mean(np.abs(ratio) <= threshold))
    psi = np.clip(ratio, -threshold, threshold)
    variance = np.nan
    if freedom > 0 and inside > 0:
        correction = 1 + solution.rank / count * (1 - inside) / inside
        variance = correction**2 * float(psi @ psi) / freedom / inside**2
    notes: tuple[str, ...] = (
        f"residuals beyond {threshold:g} standard deviations are given less weight: {1 - inside:.2%} of {count} rows",
        "the noise is estimated from the median magnitude of the residuals"
        if observations.noise is None
        else "the threshold uses the given noise",
    )
    if step > _TOLERANCE:
        notes += (
            f"not converged: the last of {_ITERATIONS} iterations changed the estimate by {step:.1e} "
            "standard deviations",
        )
    covariance = scaled_covariance(solution.half, variance)
    noise = scale if observations.noise is None else observations.noise.ravel()
    return stated_estimate("huber", observations, solution, variance, freedom, values, covariance, noise, notes)


def _fit(observations: Observations, threshold: float) -> tuple[LinearSolution, Array, Array, Array, float]:
    """Solution of the whitened rows, the values, scale of each group, residuals divided by it, and the last step."""
    problem = weighting(observations)
    factors, scale, solution = problem.factors, problem.scale, problem.solution
    values, group = solution.values.copy(), observations.group
    members = [np.flatnonzero(group == g) for g in range(scale.size)]
    floor = _FLOOR * np.where(factors.sizes() > 0, factors.sizes(), 1.0)
    step = np.inf
    for _ in range(_ITERATIONS):
        residual = observations.y - observations.W @ values
        if observations.noise is None:
            spare = factors.count - factors.leverages(solution.half) / scale**2
            scale = np.maximum(_median_scale(residual, members, factors.count / np.maximum(spare, 1.0)), floor)
            solution = solve_triangular_system(factors.stacked(scale))
        ratio = residual / scale[group]
        if step <= _TOLERANCE:
            break
        modified = np.clip(ratio, -threshold, threshold) / scale[group]
        change = solution.half.T @ (modified @ observations.matrix)  # in standard deviations
        values = values + solution.half @ change
        step = float(np.linalg.norm(change))
    return solution, values, scale, ratio, step


def _median_scale(residual: Array, members: list[Index], inflation: Array) -> Array:
    medians = [np.median(np.abs(residual[rows])) if rows.size else 1.0 for rows in members]
    return np.asarray(_NORMAL * np.array(medians) * np.sqrt(inflation))


class Huber(Estimator):
    """Weighted least squares in which rows far from the rest count less."""

    name = "huber"

    def estimate(self, observations: Observations, context: Context | None = None) -> Estimate:
        """See `huber`."""
        return huber(observations)
