"""Recursive least squares [KD96] eq. (17), (18): the estimate after every instant.

The rows are taken in blocks. With ``S = lower(V + D P D')`` (Cholesky factor; D the block's rows, V their variances)
and ``K = P D' S^-T``, the estimate after row k of the block is ``X + K[:, :k] e[:k]``, ``e = S^-1 (y - D X)``, and P
becomes ``P - K K'``: row by row the same numbers as eq. (17), (18). All three come from one orthogonal transformation
of square roots (array form), so P = F F' stays symmetric and positive despite rounding.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from excite.identification.estimate import Estimate
from excite.identification.estimator import Context, Estimator, solve_triangular_system, stated_estimate
from excite.identification.estimators.least_squares import plain_covariance, residual_noise, scaled_covariance
from excite.identification.observations import GroupFactors, Observations
from regressors.errors import InputError
from regressors.samples import Array, Index

PRIOR = 1e8
_BLOCK = 64


def recursive(observations: Observations, prior: float = PRIOR, forgetting: float = 1.0, every: int = 1) -> Estimate:
    """Estimate after all rows, taken in their order, with its whole history.

    ``X_{L+1} = X_L + P_{L+1} d_L (y_L - d_L' X_L)``, ``P_{L+1} = P_L - P_L d_L d_L' P_L / (1 + d_L' P_L d_L)``,
    from ``P_0 = c E``, ``X_0 = 0`` [KD96] eq. (17), (18), read with P_L as the last factor of (18). After the last
    row it is the minimiser of ``||W X - y||^2 + ||X||^2 / c``.
    """  # result (k,)
    if not (np.isfinite(prior) and prior > 0):
        raise InputError(f"recursive: the prior c must be a positive number, given {prior}")
    if not 0 < forgetting <= 1:
        raise InputError(f"recursive: the forgetting factor must be in (0, 1], given {forgetting}")
    if every < 1:
        raise InputError(f"recursive: every must be 1 or more, given {every}")
    factors = GroupFactors.of(observations)
    last = _ends_of_instants(observations)
    kept = np.unique(np.append(np.arange(every - 1, last.size, every), last.size - 1))
    estimates = np.empty((kept.size, observations.W.shape[1]))
    state = _State(np.zeros(observations.W.shape[1]), np.sqrt(prior) * np.eye(observations.W.shape[1]))
    wanted = last[kept]
    for rows, age in _blocks(last):
        path = state.after(observations.W[rows], observations.y[rows], forgetting ** age.astype(float))
        a, b = np.searchsorted(wanted, (rows.start, rows.stop))
        estimates[a:b] = path[wanted[a:b] - rows.start]
        state.root /= forgetting ** (age[-1] / 2)
    history = (observations.time[wanted], estimates)
    return _estimate(observations, factors, state, history, prior, forgetting)


@dataclass
class _State:
    values: Array  # X, shape (p,)
    root: Array  # F with P = F F', shape (p, p)

    def after(self, D: Array, y: Array, variance: Array) -> Array:
        """Process a block of rows; return the estimates after each of them, shape (rows, p)."""
        k, p = D.shape
        array = np.zeros((k + p, k + p))  # transposed [[V^1/2, D F], [0, F]]
        array[np.arange(k), np.arange(k)] = np.sqrt(variance)
        array[k:, :k] = (D @ self.root).T
        array[k:, k:] = self.root.T
        lower = np.asarray(np.linalg.qr(array, mode="r")).T
        S, K = lower[:k, :k], lower[k:, :k]
        innovation = scipy.linalg.lapack.dtrtrs(S, y - D @ self.values, lower=1)[0]  # S^-1 (y - D X)
        path = self.values + np.cumsum((K * innovation).T, axis=0)
        self.values, self.root = path[-1], lower[k:, k:].copy()
        return np.asarray(path)


def _ends_of_instants(observations: Observations) -> Index:
    """Last row of every instant, shape (instants,)."""
    changed = (np.diff(observations.time) != 0) | (np.diff(observations.log) != 0)
    return np.append(np.flatnonzero(changed), observations.time.size - 1)


def _blocks(last: Index) -> Iterator[tuple[slice, Index]]:
    """Blocks of rows of whole instants, with the number of each row's instant within its block, counted from one."""
    start = first = 0
    while first < last.size:
        end = max(int(np.searchsorted(last, start + _BLOCK)), first + 1)
        counts = np.diff(np.concatenate([[start - 1], last[first:end]]))
        yield slice(start, int(last[end - 1]) + 1), np.repeat(np.arange(1, end - first + 1), counts)
        start, first = int(last[end - 1]) + 1, end


def _estimate(
    observations: Observations,
    factors: GroupFactors,
    state: _State,
    history: tuple[Array, Array],
    prior: float,
    forgetting: float,
) -> Estimate:
    plain = factors.stacked(np.ones(factors.count.size))
    solution = solve_triangular_system(plain)
    freedom = factors.rows - solution.rank
    square = float(factors.squares(state.values).sum())
    variance = square / freedom if freedom > 0 else np.nan
    if observations.noise is None or forgetting < 1:
        covariance = scaled_covariance(state.root, variance)
        note = "the intervals assume independent noise of equal variance in all rows"
    else:
        covariance = plain_covariance(observations, factors, solution, variance)
        note = "the intervals use the given noise"
    noise = residual_noise(observations, factors, state.values, factors.leverages(solution.half))
    notes = (f"started from zero with P = {prior:g} E", f"forgetting factor {forgetting:g}", note)
    estimate = stated_estimate(
        "recursive", observations, solution, variance, freedom, state.values, covariance, noise, notes
    )
    return replace(estimate, history=history)


class Recursive(Estimator):
    """Unweighted recursive least squares, with the estimate after every instant."""

    name = "recursive"

    def estimate(self, observations: Observations, context: Context | None = None) -> Estimate:
        """See `recursive`."""
        return recursive(observations)
