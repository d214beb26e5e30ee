"""Least squares without weights [KD96] eq. (16), and weighted by the noise of each log and equation, the default.

Normal equations are never formed. Without weights the joints with the largest torques, and so the largest residuals,
would decide on every parameter.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy

from excite.identification.estimator import (
    Context,
    Estimate,
    Estimator,
    LinearSolution,
    solve_triangular_system,
    stated_estimate,
)
from excite.identification.observations import GroupFactors, Observations
from regressors.errors import InputError
from regressors.samples import Array, Index

_EQUAL_NOISE = "the intervals assume independent noise of equal variance in all rows"
_GIVEN_NOISE = "the intervals use the given noise"


def least_squares(observations: Observations) -> Estimate:
    """Minimiser of ``||W beta - y||`` [KD96] eq. (16).

    The covariance is ``s^2 (W'W)^-1`` with ``s^2 = ||y - W beta||^2 / (m - p)``; with known noise of covariance Sigma
    it is ``(W'W)^-1 W' Sigma W (W'W)^-1``.
    """
    return _unweighted("least-squares", observations)


def _unweighted(
    method: str, observations: Observations, end: tuple[Array, Array] | None = None, notes: tuple[str, ...] = ()
) -> Estimate:
    """Estimate by rows that count alike; with the values, and a factor of their covariance, of a recursion's end."""
    factors = GroupFactors.of(observations)
    solution = solve_triangular_system(factors.stacked(np.ones(factors.count.size)))
    values, root = (solution.values, solution.half) if end is None else end
    square, freedom = solution.square if end is None else factors.squares(values).sum(), factors.rows - solution.rank
    variance = float(square) / freedom if freedom > 0 else np.nan
    covariance, note = scaled_covariance(root, variance), _EQUAL_NOISE
    if observations.noise is not None:
        p = len(solution.half)
        scaled = zip(factors.R, observations.noise.ravel(), strict=True)
        parts = [s * R[:, -p - 1 : -1] @ solution.half for R, s in scaled]
        spread = np.linalg.qr(np.concatenate(parts), mode="r") @ solution.half.T
        covariance, note = np.asarray(spread.T @ spread), _GIVEN_NOISE
    noise = residual_noise(observations, factors, values, factors.leverages(solution.half))
    return stated_estimate(method, observations, solution, variance, values, covariance, noise, (*notes, note))


def scaled_covariance(half: Array, variance: float) -> Array:
    """``variance * half half'``; infinite variances if the variance is not known (NaN)."""
    return np.diag(np.full(len(half), np.inf)) if np.isnan(variance) else np.asarray(variance * (half @ half.T))


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
    return weighting(observations).estimate("weighted")


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

    observations: Observations
    factors: GroupFactors
    scale: Array  # (groups,) divisor of each group's rows [unit of its equation]; positive
    R: Array  # (k, p + 1) triangular factor of the rows divided by their scale
    solution: LinearSolution  # of that factor
    freedom: int  # rows less estimated parameters
    note: str

    @property
    def variance(self) -> float:
        """Variance of a row divided by its scale: one, or NaN where it is not given, and no redundant row is left."""
        return 1.0 if self.freedom > 0 or self.note == _GIVEN else np.nan

    def estimate(self, method: str) -> Estimate:
        """The estimate of the solution, with the noise of its residuals."""
        rows, solution, variance = self.observations, self.solution, self.variance
        values, covariance = solution.values, scaled_covariance(solution.half, variance)
        noise = residual_noise(rows, self.factors, values, self.factors.leverages(solution.half) / self.scale**2)
        return stated_estimate(method, rows, solution, variance, values, covariance, noise, (self.note,))


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
        return _problem(observations, factors, scale, _GIVEN)
    start = _first_scales(factors, p)
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
            return _problem(observations, factors, scale, "each equation of each log counts by its own noise")
    late = f"they still changed by {change:.1e} after {_ITERATIONS} iterations"
    return _problem(observations, factors, scale, f"the weights of the rows did not converge: {late}")


def _first_scales(factors: GroupFactors, p: int) -> Array:
    """Size of each group's y; where it is zero, of what the parameters that the other groups show make of it.

    ``0 = W beta`` holds for ``beta = 0``, to which weights by its own residuals lead from any smaller scale.
    """
    sizes = factors.sizes()
    largest = sizes.max(initial=0.0) or 1.0
    empty = (sizes == 0) & (factors.count > 0)
    if not empty.any() or empty.all():
        return np.where(sizes > 0, sizes, largest)
    measured = np.where(sizes > 0, sizes, np.inf)
    shown = solve_triangular_system(factors.stacked(measured)[:, -p - 1 :]).values
    made = np.sqrt(factors.squares(shown) / np.maximum(factors.count, 1))
    return np.where(sizes > 0, sizes, np.where(made > 0, made, largest))


def _problem(observations: Observations, factors: GroupFactors, scale: Array, note: str) -> GroupWeights:
    R = factors.stacked(scale)
    solution = solve_triangular_system(R[:, -observations.W.shape[1] - 1 :])
    return GroupWeights(observations, factors, scale, R, solution, factors.rows - solution.rank, note)


PRIOR = 1e8
_BLOCK = 64


def recursive(observations: Observations, prior: float = PRIOR, every: int = 1) -> Estimate:
    """Estimate after all rows, taken in their order, with its whole history.

    ``X_{L+1} = X_L + P_{L+1} d_L (y_L - d_L' X_L)``, ``P_{L+1} = P_L - P_L d_L d_L' P_L / (1 + d_L' P_L d_L)``,
    from ``P_0 = c E``, ``X_0 = 0`` [KD96] eq. (17), (18), read with P_L as the last factor of (18). After the last
    row it is the minimiser of ``||W X - y||^2 + ||X||^2 / c``.
    """  # result (k,)
    if not (np.isfinite(prior) and prior > 0):
        raise InputError(f"recursive: the prior c must be a positive number, given {prior}")
    if every < 1:
        raise InputError(f"recursive: every must be 1 or more, given {every}")
    GroupFactors.of(observations)  # refuses what is not finite
    last = _ends_of_instants(observations)
    kept = np.unique(np.append(np.arange(every - 1, last.size, every), last.size - 1))
    p, wanted = observations.W.shape[1], last[kept]
    estimates, values, root = np.empty((kept.size, p)), np.zeros(p), np.sqrt(prior) * np.eye(p)
    for rows in _blocks(last):
        path, root = _block_of_rows(values, root, observations.W[rows], observations.y[rows])
        a, b = np.searchsorted(wanted, (rows.start, rows.stop))
        estimates[a:b] = path[wanted[a:b] - rows.start]
        values = path[-1]
    notes = (f"started from zero with P = {prior:g} E", "forgetting factor 1")
    estimate = _unweighted("recursive", observations, (values, root), notes)
    return replace(estimate, history=(observations.time[wanted], estimates))


def _block_of_rows(values: Array, root: Array, D: Array, y: Array) -> tuple[Array, Array]:
    """Estimates after each of some rows, shape (rows, p), and F with ``P = F F'`` after them."""
    # values (p,): X before them; root (p, p): F before them
    k, p = D.shape
    array = np.block([[np.eye(k), np.zeros((k, p))], [(D @ root).T, root.T]])  # transposed [[E, D F], [0, F]]
    lower = np.asarray(np.linalg.qr(array, mode="r")).T
    S, K = lower[:k, :k], lower[k:, :k]
    innovation = scipy.linalg.lapack.dtrtrs(S, y - D @ values, lower=1)[0]  # S^-1 (y - D X)
    return np.asarray(values + np.cumsum((K * innovation).T, axis=0)), lower[k:, k:].copy()


def _ends_of_instants(observations: Observations) -> Index:
    """Last row of every instant, shape (instants,)."""
    changed = (np.diff(observations.time) != 0) | (np.diff(observations.log) != 0)
    return np.append(np.flatnonzero(changed), observations.time.size - 1)


def _blocks(last: Index) -> Iterator[slice]:
    """Blocks of rows of whole instants."""
    start = first = 0
    while first < last.size:
        end = max(int(np.searchsorted(last, start + _BLOCK)), first + 1)
        yield slice(start, int(last[end - 1]) + 1)
        start, first = int(last[end - 1]) + 1, end


class Recursive(Estimator):
    """Unweighted recursive least squares, with the estimate after every instant."""

    name = "recursive"

    def estimate(self, observations: Observations, context: Context | None = None) -> Estimate:
        """See `recursive`."""
        return recursive(observations)
