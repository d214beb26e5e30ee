"""Exact extrema of functions with many polynomial pieces: only those that may hold one are looked into.

On a piece of length h a polynomial ``sum_i p_i s^i`` of degree d in ``s = t / h`` stays between the least and the
largest of its Bernstein coefficients ``b_j = sum_{i <= j} C(j, i) / C(d, i) p_i`` [Farouki 2012, eq. 15]. Pieces whose
coefficients do not pass what is reached at the ends of the others need no roots.
"""

from __future__ import annotations

from math import comb

import numpy as np

from constraints.bounds.extrema import Extrema
from constraints.bounds.piecewise import piecewise_extrema
from regressors.samples import Array

_ROUNDING = 1e-12  # of the largest value, by which pieces may pass it without being looked into


def hulled_extrema(breaks: Array, coefficients: Array) -> Extrema:
    """Extrema of piecewise polynomials, to 1e-12 of the largest value; see `piecewise_extrema`."""
    # breaks (m + 1,); coefficients (d + 1, m, k)
    hull = _bernstein(np.diff(breaks), coefficients)
    ends = np.concatenate([hull[0], hull[-1][-1:]])  # values at all breaks, shape (m + 1, k)
    low, high = ends.min(axis=0), ends.max(axis=0)
    low_time, high_time = breaks[ends.argmin(axis=0)], breaks[ends.argmax(axis=0)]
    slack = _ROUNDING * np.abs(ends).max(axis=0)
    beyond = (hull.max(axis=0) > high + slack) | (hull.min(axis=0) < low - slack)
    for i, k in zip(*np.nonzero(beyond), strict=True):
        inner = piecewise_extrema(breaks[i : i + 2], coefficients[:, i : i + 1, k : k + 1])
        if inner.low[0] < low[k]:
            low[k], low_time[k] = inner.low[0], inner.low_time[0]
        if inner.high[0] > high[k]:
            high[k], high_time[k] = inner.high[0], inner.high_time[0]
    return Extrema(low, high, low_time, high_time)


def _bernstein(length: Array, coefficients: Array) -> Array:
    """Bernstein coefficients of every piece, shape (d + 1, m, k)."""
    d = coefficients.shape[0] - 1
    powers = length[None] ** np.arange(d + 1.0)[:, None]  # (d + 1, m)
    p = coefficients[::-1] * powers[:, :, None]  # of s^i
    B = np.array([[comb(j, i) / comb(d, i) if i <= j else 0.0 for i in range(d + 1)] for j in range(d + 1)])
    return np.asarray(np.einsum("ji,imk->jmk", B, p))
