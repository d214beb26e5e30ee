"""Triangular factors of the first rows of a matrix, for more and more rows."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from regressors.samples import Array, Index


def growing_factors(A: Array, ends: Index) -> Iterator[Array]:
    """``R_k`` with ``R_k' R_k = A[:e_k]' A[:e_k]`` for every end ``e_k``, each from the one before and the new rows.

    All rows are read once: ``[R_{k-1}; A[e_{k-1}:e_k]] = Q R_k``.
    """  # A (m, p); ends (k,)
    R, begin = np.zeros((0, A.shape[1])), 0
    for end in ends:
        if end > begin:
            R, begin = np.asarray(np.linalg.qr(np.concatenate([R, A[begin:end]]), mode="r")), int(end)
        yield R
