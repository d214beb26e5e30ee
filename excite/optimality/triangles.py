"""Symmetric matrices as vectors with the same inner product, in the order of Clarabel: upper triangle by columns."""

from __future__ import annotations

import numpy as np

from regressors.samples import Array, Index


def _places(size: int) -> tuple[Index, Index]:
    column, row = np.tril_indices(size)
    return row, column


def triangle(M: Array) -> Array:
    """Vectors of symmetric matrices, shape (..., n, n) to (..., n (n + 1) / 2); off-diagonal entries times sqrt 2."""
    row, column = _places(M.shape[-1])
    return np.asarray(M[..., row, column] * np.where(row == column, 1.0, np.sqrt(2.0)))


def matrix_of(v: Array, size: int) -> Array:
    """Symmetric matrix of a vector, the inverse of `triangle`, shape (size, size)."""
    row, column = _places(size)
    M = np.zeros((size, size))
    M[row, column] = M[column, row] = v / np.where(row == column, 1.0, np.sqrt(2.0))
    return M


def triangle_basis(size: int) -> Array:
    """Symmetric matrices whose vectors are unit vectors, shape (n (n + 1) / 2, size, size)."""
    return np.stack([matrix_of(e, size) for e in np.eye(size * (size + 1) // 2)])
