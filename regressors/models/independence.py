"""Which columns of a matrix are independent, from the left or by pivots."""

from __future__ import annotations

import numpy as np

from regressors.samples import Array, Index

TOLERANCE = 1e-8
_TIE = 1e-6


def independent_columns(R: Array, tolerance: float = TOLERANCE) -> Index:
    """Columns that do not depend on the ones to their left (left-to-right QR) [Gautier 1991].

    Parameters
    ----------
    R : ndarray, shape (k, p)
    tolerance : float
        A column counts as dependent if less than this fraction of it is left after projection.

    Returns
    -------
    ndarray of int
        Indices in ascending order.
    """
    Q = np.zeros((R.shape[0], min(R.shape)))
    chosen: list[int] = []
    smallest = 1e-12 * float(np.linalg.norm(R, axis=0).max(initial=0.0))
    for j in range(R.shape[1]):
        column, size = R[:, j].copy(), float(np.linalg.norm(R[:, j]))
        for _ in range(2):  # a second projection removes what rounding left of the first
            column -= Q @ (Q.T @ column)
        rest = float(np.linalg.norm(column))
        if rest > tolerance * size and rest > smallest and len(chosen) < Q.shape[1]:
            Q[:, len(chosen)] = column / rest
            chosen.append(j)
    return np.asarray(chosen, dtype=np.intp)


def pivoted_columns(R: Array, tolerance: float = TOLERANCE) -> Index:
    """Columns in the order of column-pivoted QR: each time the one with the largest remainder after projection.

    Equal remainders are common, since links share lengths; the leftmost is taken, so that the choice does not depend on
    rounding.

    Parameters
    ----------
    R : ndarray, shape (k, p)
    tolerance : float
        Stop at a remainder that is smaller than this fraction of the first pivot.

    Returns
    -------
    ndarray of int
        Indices in the order of choice.
    """
    rest = R.copy()
    chosen: list[int] = []
    first = 0.0
    for _ in range(min(R.shape)):
        sizes = np.linalg.norm(rest, axis=0)
        sizes[chosen] = 0.0
        largest = float(sizes.max(initial=0.0))
        first = first or largest
        if largest <= tolerance * first:
            break
        chosen.append(int(np.argmax(sizes >= (1.0 - _TIE) * largest)))
        direction = rest[:, chosen[-1]] / np.linalg.norm(rest[:, chosen[-1]])
        for _ in range(2):  # the second projection removes what rounding left of the first
            rest = rest - np.outer(direction, direction @ rest)
    return np.asarray(chosen, dtype=np.intp)
