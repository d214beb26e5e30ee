"""The estimators of `excite.identification` for repetitions: the same formulas on second moments of the rows.

Moments ``[W e]'[W e]`` take a third of the time of triangular factors. They hold the errors ``e = y - W beta`` at the
true beta in place of y, so that what rounding does to them is small compared with the scatter, not with the parameters.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.linalg

from regressors.samples import Array

_ITERATIONS = 500
_SETTLED = 1e-9
_FLOOR = 1e-11


@dataclass(frozen=True, eq=False)
class Moments:
    """Second moments of the rows of each of r equations."""

    G: Array  # (r, k, k) ``A'A`` of ``A = [W e]``, or of ``[Z W e]`` with instruments Z
    count: int  # rows of each equation
    sizes: Array  # (r,) root mean square of y within each equation

    @property
    def floor(self) -> Array:
        """Least noise of each equation: residuals of exact data are rounding errors, shape (r,)."""
        return _FLOOR * np.where(self.sizes > 0, self.sizes, 1.0)

    def without(self, front: int) -> Moments:
        """The moments without the first columns."""
        return Moments(self.G[:, front:, front:], self.count, self.sizes)

    def weighted(self, scale: Array) -> Array:
        """Moments of all rows divided by their equation's scale, shape (k, k)."""
        return np.asarray(np.tensordot(1 / scale**2, self.G, 1))

    def leverages(self, half: Array) -> Array:
        """``tr(W_g H H' W_g')`` of each equation, shape (r,)."""
        return np.asarray(np.tensordot(self.G[:, :-1, :-1], half @ half.T, 2))

    def noise(self, error: Array, spare: Array) -> Array:
        """Root of the sum of squared residuals over the redundant rows, shape (r,); `error` is that of beta."""
        signed = np.append(error, -1.0)
        squares = np.einsum("i,rij,j->r", signed, self.G, signed)
        return np.asarray(np.sqrt(np.maximum(squares, 0.0) / spare))


class Solved(NamedTuple):
    """One repetition's estimate."""

    error: Array  # (b,) estimate less true value
    # (b, b) ``half half'`` is the covariance that the formula of the estimator predicts from this repetition's
    # residuals
    half: Array
    noise: Array  # (r,) standard deviation of each equation's residuals


def least_squares(moments: Moments) -> Solved:
    """Unweighted, with covariance ``s^2 (W'W)^-1``; see `excite.identification.estimators.least_squares`."""
    G = moments.weighted(np.ones(len(moments.G)))
    error, half = _solution(G)
    freedom = len(moments.G) * moments.count - error.size
    variance = max(float(G[-1, -1] - G[:-1, -1] @ error), 0.0) / freedom
    return Solved(error, np.sqrt(variance) * half, moments.noise(error, moments.count - moments.leverages(half)))


def weighted(moments: Moments) -> Solved:
    """Rows divided by the noise of their equation, a fixed point, with covariance ``(W' Sigma^-1 W)^-1``.

    See `excite.identification.weights`; parameters as for `least_squares`.
    """
    scale = _weights(moments)
    error, half = _solution(moments.weighted(scale))
    spare = moments.count - moments.leverages(half) / scale**2
    return Solved(error, half, moments.noise(error, spare))


def instrumental(moments: Moments) -> Solved:
    """``(Z' Sigma^-1 W)^-1 Z' Sigma^-1 y`` with the noise-free regressor Z, as the estimator ``instrumental``."""
    b = moments.G.shape[1] // 2
    rows = moments.without(b)
    spare = np.full(len(moments.G), moments.count * (1 - b / (len(moments.G) * moments.count)))

    def solution_at(scale: Array) -> tuple[Array, Array]:
        G = moments.weighted(scale)
        A = _inverse_root(G[:b, :b]).T @ G[:b, b:]  # Q'[W e] with Z = QT
        half = np.asarray(np.linalg.inv(A[:, :b]), dtype=float)
        return half @ A[:, b], half

    scale = _fixed_point(lambda scale: np.maximum(rows.noise(solution_at(scale)[0], spare), rows.floor), _weights(rows))
    error, half = solution_at(scale)
    return Solved(error, half, rows.noise(error, spare))


ESTIMATORS: dict[str, Callable[[Moments], Solved]] = {
    "least-squares": least_squares,
    "weighted": weighted,
    "instrumental": instrumental,
}


def _inverse_root(M: Array) -> Array:
    """Upper triangular H with ``H H' = M^-1``, columns scaled to length one in between."""
    sizes = np.sqrt(np.diag(M))
    R = scipy.linalg.cholesky(M / np.outer(sizes, sizes))
    return np.asarray(scipy.linalg.solve_triangular(R, np.eye(len(M))) / sizes[:, None])


def _solution(G: Array) -> tuple[Array, Array]:
    """Error of the least-squares estimate, and a root of its covariance for unit noise, from the moments."""
    half = _inverse_root(G[:-1, :-1])
    return half @ (half.T @ G[:-1, -1]), half


def _weights(moments: Moments) -> Array:
    def updated(scale: Array) -> Array:
        error, half = _solution(moments.weighted(scale))
        spare = moments.count - moments.leverages(half) / scale**2
        return np.asarray(np.maximum(moments.noise(error, spare), moments.floor))

    return _fixed_point(updated, moments.floor / _FLOOR)


def _fixed_point(updated: Callable[[Array], Array], scale: Array) -> Array:
    for _ in range(_ITERATIONS):
        new = updated(scale)
        change = float(np.abs(np.log(new / scale)).max())
        scale = new
        if not change > _SETTLED:
            break
    return scale
