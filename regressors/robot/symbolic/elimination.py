"""Solution of sparse linear equations as an expression that intervals bound well.

CasADi's own is by a QR factorisation, whose many operations widen intervals far more than an elimination does whose
pivots have few others in their rows and columns [Markowitz 1957].
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from regressors.samples import Array

_LEAST = 0.3  # of the largest entry of its row and its column: a pivot


def eliminated(A: ca.SX, B: ca.SX, values: Array) -> ca.SX:
    """``A^-1 B`` by Gaussian elimination, with pivots that stay away from zero for values of ``[A B]``.

    It is right wherever these pivots do not vanish.
    """  # values (M, m, m + k)
    m, width = A.shape[0], A.shape[1] + B.shape[1]
    both, number = ca.horzcat(A, B), np.array(values)
    filled = np.array([[both.sparsity().has_nz(i, j) for j in range(width)] for i in range(m)])
    rows = [[both[i, j] for j in range(width)] for i in range(m)]
    order, left, open_ = list[tuple[int, int]](), set(range(m)), set(range(m))
    while left:
        i, j = _pivot(number, filled, sorted(left), sorted(open_))
        order.append((i, j))
        left.discard(i)
        open_.discard(j)
        for below in (row for row in left if filled[row, j]):
            factor, by = rows[below][j] / rows[i][j], number[:, below, j] / number[:, i, j]
            for column in np.flatnonzero(filled[i]).tolist():
                rows[below][column] -= factor * rows[i][column]
            number[:, below] -= by[:, None] * number[:, i]
            filled[below] |= filled[i]
            filled[below, j] = False
    solution: dict[int, ca.SX] = {}
    for i, j in reversed(order):
        rest = ca.horzcat(*rows[i][m:])
        for k, known in solution.items():
            if filled[i, k]:
                rest -= rows[i][k] * known
        solution[j] = rest / rows[i][j]
    return ca.vertcat(*(solution[j] for j in range(m)))


def _pivot(number: Array, filled: Array, left: list[int], columns: list[int]) -> tuple[int, int]:
    """Place of an entry that is large in all values, and whose row and column have few others."""
    size = np.abs(number[:, left][:, :, columns])
    largest = np.maximum(size.max(axis=2, keepdims=True), size.max(axis=1, keepdims=True))
    relative = np.min(size / largest.clip(1e-300), axis=0)
    fill = np.outer(filled[left].sum(axis=1) - 1, filled[np.ix_(left, columns)].sum(axis=0) - 1)
    allowed = relative >= min(_LEAST, float(relative.max()))
    cost = np.where(allowed, fill - 1e-3 * relative, np.inf)
    i, j = np.unravel_index(int(cost.argmin()), cost.shape)
    return left[int(i)], columns[int(j)]
