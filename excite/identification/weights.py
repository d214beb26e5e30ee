"""The scale of each group's rows: its known noise, or that of its own residuals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from excite.identification.estimator import LinearSolution, solve_triangular_system
from excite.identification.estimators.least_squares import residual_noise
from excite.identification.observations import GroupFactors, Observations
from regressors.errors import InputError
from regressors.samples import Array

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
        """Variance of a row divided by its scale: one, or NaN where no redundant row is left to estimate it."""
        return 1.0 if self.freedom > 0 or self.known else np.nan

    @property
    def known(self) -> bool:
        """True if the noise was given."""
        return self.notes[0] == _KNOWN

    def noise(self, observations: Observations) -> Array:
        """Standard deviation of each group's residuals, or the known one, shape (groups,)."""
        leverages = self.factors.leverages(self.solution.half) / self.scale**2
        return residual_noise(observations, self.factors, self.solution.values, leverages)


_KNOWN = "rows weighted by the given noise"


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
        return _problem(factors, scale, p, (_KNOWN,))
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
