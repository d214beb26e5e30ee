"""Least-squares solution from a triangular factor, also if it is rank-deficient."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regressors.samples import Array

TOLERANCE = 1e-10  # of the largest singular value of the columns scaled to length one, and of the longest column


@dataclass(frozen=True, eq=False)
class LinearSolution:
    """Minimiser of ``||A beta - r||``, with its covariance factor and singular values.

    Parameters
    ----------
    values : ndarray, shape (p,)
        Minimum-norm solution with respect to the columns scaled to length one.
    half : ndarray, shape (p, rank)
        Factor of the covariance: ``half @ half.T`` is ``(A'A)^-1`` within the identifiable directions.
    sizes : ndarray, shape (p,)
        Lengths of the columns of A; zero where a column counts as zero.
    singular_values : ndarray, shape (p,)
        Of the columns scaled to length one.
    directions : ndarray, shape (p, p)
        Right singular vectors in its rows, of the scaled columns.
    rank : int
    square : float
        Sum of the squared residuals.
    size : float
        Length of r.
    """

    values: Array
    half: Array
    sizes: Array
    singular_values: Array
    directions: Array
    rank: int
    square: float
    size: float


def solve_triangular_system(R: Array, tolerance: float = TOLERANCE) -> LinearSolution:
    """Solution from the triangular factor of ``[A r]``.

    Columns are scaled to length one and decomposed, ``A S^-1 = U diag(s) V'``; normal equations are never formed.

    Parameters
    ----------
    R : ndarray, shape (k, p + 1)
    tolerance : float
        Singular values below this share of the largest one count as zero.
    """
    A, r = R[:, :-1], R[:, -1]
    p = A.shape[1]
    sizes = np.linalg.norm(A, axis=0)
    sizes = np.where(sizes > tolerance * sizes.max(initial=0.0), sizes, 0.0)
    scaled = A * _inverse(sizes)
    U, s, V = np.linalg.svd(np.concatenate([scaled, np.zeros((max(p - A.shape[0], 0), p))]), full_matrices=False)
    rank = int(np.sum(s > tolerance * s[0])) if s[0] > 0 else 0
    half = _inverse(sizes)[:, None] * (V[:rank].T / s[:rank])
    values = half @ (U[: r.size, :rank].T @ r)
    square = float(np.sum((A @ values - r) ** 2))
    return LinearSolution(values, half, sizes, s, V, rank, square, float(np.linalg.norm(r)))


def _inverse(sizes: Array) -> Array:
    return np.asarray(np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes > 0))
