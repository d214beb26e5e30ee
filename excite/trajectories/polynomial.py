"""One polynomial of high degree per joint, at rest at both ends at the same pose.

``q(t) = sum_k c_k T_k(2 t / T - 1)``, k = 0 ... d, with Chebyshev's polynomials T_k. The five conditions
``q(0) = q(T)``, ``dq = ddq = 0`` at both ends leave d - 4 free coefficients. Limits hold over continuous time: on
Chebyshev's nodes they are tightened by the factor of Ehlich and Zeller (1964), and extrema are exact.
"""

from __future__ import annotations

import numpy as np
import numpy.polynomial.chebyshev as chebyshev

from constraints.certificate import Extrema
from constraints.enclosure import chebyshev_extrema, chebyshev_nodes, node_factor
from excite.trajectories.family import check_size
from excite.trajectories.linear import LinearFamily
from regressors.numerical import null_space
from regressors.samples import Array


class Polynomial(LinearFamily):
    """Polynomials of degree ``4 harmonics + 5``: about as rich as a Fourier series with that many harmonics.

    Parameters
    ----------
    period : float
        T [s].
    harmonics : int
        At least 1.

    Raises
    ------
    InputError
        An invalid duration or number of harmonics.
    """

    name = "polynomial"
    terms = "polynomials of degree {degree}"
    form = "q(t) = sum_k coefficients_k T_k(2 t / period - 1), T_k Chebyshev's polynomials"
    samples_per_term = 4

    def __init__(self, period: float, harmonics: int) -> None:
        check_size(period, 1, harmonics=harmonics)
        self.duration, self.harmonics = float(period), int(harmonics)
        self.degree = 4 * self.harmonics + 5
        self._Z = self._rest_basis()
        self.size = self._Z.shape[1]

    def _rest_basis(self) -> Array:
        """Coefficients of motions at rest at both ends, at the same pose, shape (degree + 1, size).

        Polynomial k is weighted by 1/k so that equal coefficients mean about equal velocities, the usual bound.
        """
        ends = np.array([0.0, self.duration])
        position, *rest = (chebyshev_terms(ends, self.duration, self.degree, d) for d in range(3))
        conditions = np.vstack([np.diff(position, axis=0), *rest])
        weight = 1.0 / np.maximum(np.arange(self.degree + 1), 1)
        conditions = conditions * weight
        conditions /= np.linalg.norm(conditions, axis=1)[:, None]
        return np.asarray(weight[:, None] * null_space(conditions))

    def basis(self, time: Array, derivative: int) -> Array:
        """Values of the free basis functions, shape (N, size)."""
        terms = chebyshev_terms(np.asarray(time, dtype=float), self.duration, self.degree, derivative)
        return np.asarray(terms @ self._Z)

    def grid(self, count: int) -> Array:
        """Zeros of a Chebyshev polynomial."""
        return chebyshev_nodes(count, 0.0, self.duration)

    def grid_factor(self, count: int, derivative: int) -> float:
        """See `constraints.enclosure.chebyshev_nodes`."""
        return node_factor(self.degree - derivative, count)

    def extrema(self, x: Array, derivative: int) -> Extrema:
        """Extrema from the roots of the derivative, see `constraints.enclosure.chebyshev_extrema`."""
        return chebyshev_extrema(lambda time: self.basis(time, derivative) @ x.T, self.degree, self.duration)


def chebyshev_terms(time: Array, duration: float, degree: int, derivative: int) -> Array:
    """Chebyshev's polynomials of all degrees up to one on [0, T], or their derivatives, shape (N, degree + 1)."""
    each = np.eye(degree + 1)
    series = chebyshev.chebder(each, m=derivative) if derivative else each
    rate = 2.0 / duration
    return np.asarray(chebyshev.chebval(rate * time - 1.0, series).T * rate**derivative)


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
    c = _SLOPES[derivative]
    return np.asarray(np.vander(u, c.shape[1], increasing=True) @ c.T * length[:, None] ** (ORDERS - derivative))
