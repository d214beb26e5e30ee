"""Least-squares solution from a triangular factor, also if it is rank-deficient."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regressors.samples import Array

TOLERANCE = 1e-10  # of the largest singular value of the columns scaled to length one, and of the longest column


@dataclass(frozen=True, eq=False)
class LinearSolution:
    """Minimiser of ``||A beta - r||``, with its covariance factor and singular values."""

    values: Array  # (p,) minimum-norm solution with respect to the columns scaled to length one
    # (p, rank) factor of the covariance: ``half @ half.T`` is ``(A'A)^-1`` within the identifiable directions
    half: Array
    sizes: Array  # (p,) lengths of the columns of A; zero where a column counts as zero
    singular_values: Array  # (p,) of the columns scaled to length one
    directions: Array  # (p, p) right singular vectors in its rows, of the scaled columns
    rank: int
    square: float  # sum of the squared residuals
    size: float  # length of r


def solve_triangular_system(R: Array, tolerance: float = TOLERANCE) -> LinearSolution:
    """Solution from the triangular factor of ``[A r]``.

    Columns are scaled to length one and decomposed, ``A S^-1 = U diag(s) V'``; normal equations are never formed.
    """  # R (k, p + 1)
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
