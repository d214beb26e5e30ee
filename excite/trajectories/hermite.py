"""The six polynomials of fifth order that take value, slope and bend at both ends of [0, 1]."""

from __future__ import annotations

import numpy as np

from regressors.samples import Array

QUINTIC = np.array(  # coefficients of 1, u ... u^5; value, slope, bend at 0, then the same at 1
    [
        [1.0, 0.0, 0.0, -10.0, 15.0, -6.0],
        [0.0, 1.0, 0.0, -6.0, 8.0, -3.0],
        [0.0, 0.0, 0.5, -1.5, 1.5, -0.5],
        [0.0, 0.0, 0.0, 10.0, -15.0, 6.0],
        [0.0, 0.0, 0.0, -4.0, 7.0, -3.0],
        [0.0, 0.0, 0.0, 0.5, -1.0, 0.5],
    ]
)
ORDERS = np.array([0, 1, 2, 0, 1, 2])  # derivative that each of them takes
_SLOPES = [np.polynomial.polynomial.polyder(QUINTIC, d, axis=1) for d in range(6)]


def quintic_hermite(u: Array, length: Array, derivative: int) -> Array:
    """Values on an interval of some length of the polynomials of its ends' position, velocity and acceleration.

    ``h^(k - d) H^(d)(u)`` with k the order of what the polynomial takes: a motion is the sum of these, times position,
    velocity and acceleration at the beginning and at the end.

    Parameters
    ----------
    u : ndarray, shape (N,)
        Part of the interval, 0 to 1.
    length : ndarray, shape (N,)
        h of the interval that each belongs to [s].
    derivative : int
        d, by time.

    Returns
    -------
    ndarray, shape (N, 6)
    """
    slopes = _SLOPES[derivative]
    return np.asarray(
        np.vander(u, slopes.shape[1], increasing=True) @ slopes.T * length[:, None] ** (ORDERS - derivative)
    )
