"""The six quintic Hermite polynomials on [0, 1]: value, slope and second derivative at both ends."""

from __future__ import annotations

import numpy as np

from regressors.samples import Array

QUINTIC = np.array(  # coefficients of 1, u ... u^5; value, slope, second derivative at 0, then the same at 1
    [
        [1.0, 0.0, 0.0, -10.0, 15.0, -6.0],
        [0.0, 1.0, 0.0, -6.0, 8.0, -3.0],
        [0.0, 0.0, 0.5, -1.5, 1.5, -0.5],
        [0.0, 0.0, 0.0, 10.0, -15.0, 6.0],
        [0.0, 0.0, 0.0, -4.0, 7.0, -3.0],
        [0.0, 0.0, 0.0, 0.5, -1.0, 0.5],
    ]
)
ORDERS = np.array([0, 1, 2, 0, 1, 2])  # order of the derivative that each of them interpolates
_SLOPES = [np.polynomial.polynomial.polyder(QUINTIC, d, axis=1) for d in range(6)]


def quintic_hermite(u: Array, length: Array, derivative: int) -> Array:
    """Quintic Hermite basis functions on an interval, for position, velocity and acceleration at its ends.

    ``h^(k - d) H^(d)(u)`` with k the order of the interpolated derivative: a motion is the sum of these times position,
    velocity and acceleration at the beginning and at the end.
    """  # u (N,); length (N,)
    slopes = _SLOPES[derivative]
    return np.asarray(
        np.vander(u, slopes.shape[1], increasing=True) @ slopes.T * length[:, None] ** (ORDERS - derivative)
    )
