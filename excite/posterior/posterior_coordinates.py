"""Standard parameters as a linear function of coordinates that are uncorrelated in the posterior.

The data say ``beta ~ t(b, C, nu)`` of the base parameters ``beta = A phi``, the description ``phi ~ N(phi0, V)``. What
the data determine is taken from the data alone; the description decides what they leave open, ``phi | beta``:

    phi = phi0 + G (b + L x - A phi0) + N y,   G = V A' (A V A')^-1,   L L' = C,   N N' = V - G A V,

with ``x ~ t(0, E, nu)`` and ``y ~ N(0, E)``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from excite.identification.estimators.standard import StandardProblem
from excite.posterior.described_prior import DescribedPrior
from regressors.errors import InputError
from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class PosteriorCoordinates:
    """``theta = origin + slope @ z`` with ``z = (x, y)``."""

    origin: Array  # (t,)
    slope: Array  # (t, d)
    determined: int  # number of the coordinates x, which the data determine; they are the first
    freedom: float  # degrees of freedom nu of their distribution; infinite for a normal one

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return int(self.slope.shape[1])

    def theta(self, z: Array) -> Array:
        """Standard parameters, shape (..., t)."""
        return np.asarray(self.origin + z @ self.slope.T)

    def energy(self, z: Array) -> Array:
        """``-log p(z)`` without its constant, shape (...)."""
        x, y = self._squares(z)
        if np.isinf(self.freedom):
            return np.asarray((x + y) / 2)
        return np.asarray((self.freedom + self.determined) / 2 * np.log1p(x / self.freedom) + y / 2)

    def slope_of_energy(self, z: Array) -> Array:
        """Gradient of `energy`, shape (..., d)."""
        gradient = z.copy()
        if np.isfinite(self.freedom):
            x, _ = self._squares(z)
            gradient[..., : self.determined] *= ((self.freedom + self.determined) / (self.freedom + x))[..., None]
        return gradient

    def _squares(self, z: Array) -> tuple[Array, Array]:
        p = self.determined
        return np.sum(z[..., :p] ** 2, axis=-1), np.sum(z[..., p:] ** 2, axis=-1)


def posterior_coordinates(
    standard: StandardProblem, prior: DescribedPrior, estimate: Array, covariance: Array, freedom: float
) -> PosteriorCoordinates:
    """Coordinates of a posterior."""  # estimate (b,); covariance (b, b)
    known = np.isfinite(np.diag(covariance))
    A = (standard.A @ standard.S)[known]  # (p, f)
    b, C = estimate[known], covariance[np.ix_(known, known)]
    size = np.sqrt(np.diag(C))
    try:
        L = size[:, None] * np.linalg.cholesky(C / np.outer(size, size))
    except np.linalg.LinAlgError:
        raise InputError("the covariance of the result is not positive definite; identify again") from None
    U, s, W = np.linalg.svd((A @ prior.half) / size[:, None], full_matrices=True)
    p = len(b)
    G = prior.half @ (W[:p].T / s) @ U.T / size  # V A' (A V A')^-1
    origin = prior.mean + G @ (b - A @ prior.mean)
    slope = np.hstack([G @ L, prior.half @ W[p:].T])
    return PosteriorCoordinates(standard.S @ origin, standard.S @ slope, p, freedom)
