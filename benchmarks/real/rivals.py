"""The rivals' estimators, from the equations ``y = W x`` alone: blocks of W are (N, n, p), those of y (N, n)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
BLOCKS = 5
RELATIVE_PENALTIES = np.logspace(-9, 0, 28)  # of the squared length of the columns, all scaled to one


@dataclass(frozen=True, eq=False)
class Fit:
    """An estimate, and the standard deviations that white noise would give it.

    Parameters
    ----------
    x : ndarray, shape (p,)
    deviation : ndarray, shape (p,), or None
    noise : ndarray, shape (n,)
        Deviation of each joint's residuals [Nm].
    """

    x: Array
    deviation: Array | None
    noise: Array


def ordinary(W: Array, y: Array) -> Fit:
    """Least squares with all joints alike."""
    return _least_squares(W, y, np.ones(y.shape[1]))


def weighted(W: Array, y: Array) -> Fit:
    """Least squares, then again with each joint's equations divided by the deviation of its residuals."""
    return _least_squares(W, y, ordinary(W, y).noise)


def ridge(W: Array, y: Array) -> Fit:
    """The weighted equations with a penalty on all scaled parameters that five blocks of time predict best with."""
    A, b = _rows(W / weighted(W, y).noise[:, None]), (y / weighted(W, y).noise).ravel()
    size = np.linalg.norm(A, axis=0)
    A = A / np.where(size > 0, size, 1.0)
    parts = [(A[k].T @ A[k], A[k].T @ b[k], b[k] @ b[k]) for k in np.array_split(np.arange(b.size), BLOCKS)]
    G, g = sum(part[0] for part in parts), sum(part[1] for part in parts)
    errors = [sum(_left_out(G, g, part, penalty) for part in parts) for penalty in RELATIVE_PENALTIES]
    x = _solved(G, g, RELATIVE_PENALTIES[int(np.argmin(errors))]) / np.where(size > 0, size, 1.0)
    return Fit(x, None, _deviation(W, y, x))


def _left_out(G: Array, g: Array, part: tuple[Array, Array, float], penalty: float) -> float:
    """Squared error of one block by the parameters from the others."""
    x = _solved(G - part[0], g - part[1], penalty)
    return float(part[2] - 2 * part[1] @ x + x @ part[0] @ x)


def _solved(G: Array, g: Array, penalty: float) -> Array:
    return np.asarray(np.linalg.solve(G + penalty * np.eye(g.size), g))


def _least_squares(W: Array, y: Array, noise: Array) -> Fit:
    A, b = _rows(W / noise[:, None]), (y / noise).ravel()
    size = np.linalg.norm(A, axis=0)
    size[size == 0] = 1.0
    U, s, Vt = np.linalg.svd(A / size, full_matrices=False)
    shown = s > 1e-10 * s[0]
    U, s, Vt = U[:, shown], s[shown], Vt[shown]
    x = Vt.T @ (U.T @ b / s) / size
    variance = float(np.sum((b - A @ x) ** 2)) / (b.size - s.size)
    deviation = np.sqrt(variance * np.sum((Vt.T / s) ** 2, axis=1)) / size
    return Fit(x, deviation, _deviation(W, y, x))


def _rows(W: Array) -> Array:
    return W.reshape(-1, W.shape[2])


def _deviation(W: Array, y: Array, x: Array) -> Array:
    return np.asarray(np.std(y - W @ x, axis=0))
