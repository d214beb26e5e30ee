"""Finite Fourier series, at rest at both ends.

``q(t) = c + sum_k a_k cos(k w t) + b_k sin(k w t)`` with w = 2 pi / T; position, velocity and acceleration are
periodic, and ``dq(0) = w sum_k k b_k = 0``, ``ddq(0) = -w^2 sum_k k^2 a_k = 0`` [Swevers 1997, with rest added].
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

from constraints.certificate import Extrema, trigonometric_extrema
from excite.trajectories.family import check_size
from excite.trajectories.linear import LinearFamily
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.samples import Array


@checked
class Fourier(LinearFamily):
    """Fourier series of ``harmonics`` terms over one period.

    Parameters
    ----------
    period : float
        Period T [s].
    harmonics : int
        Number of harmonics K, at least 2: rest at both ends uses up one sine and one cosine.

    Raises
    ------
    InputError
        An invalid duration or number of harmonics.
    """

    name = "fourier"
    parts = ("offset", "cosine", "sine")
    form = "q(t) = offset + sum_k cosine_k cos(2 pi k t / period) + sine_k sin(2 pi k t / period)"

    def __init__(self, period: float, harmonics: int) -> None:
        if harmonics < 2:
            raise InputError(
                f"harmonics: {harmonics} are too few for a motion at rest at both ends; expected 2 or more"
            )
        check_size(period, harmonics=harmonics)
        self.duration = float(period)
        self.harmonics = int(harmonics)
        self.size = 2 * harmonics - 1
        self.omega = 2 * np.pi / self.duration
        self._Z = self._rest_basis()

    @property
    def richness(self) -> int:
        """Number of harmonics."""
        return self.harmonics

    @property
    def described(self) -> str:
        """Number of harmonics, as text."""
        return f"{self.harmonics} harmonics"

    @property
    def harmonic_frequencies(self) -> Array:
        """``w, 2 w, ..., K w``."""
        return np.asarray(self.omega * np.arange(1.0, self.harmonics + 1.0))

    def _rest_basis(self) -> Array:
        """Orthonormal coefficients (c, a_1 .. a_K, b_1 .. b_K) of motions at rest at t = 0, shape (2K+1, size).

        Harmonics are weighted by k so that equal coefficients mean equal velocities, which limits usually bound.
        """
        order = np.arange(1, self.harmonics + 1)
        weight = np.concatenate([[1.0], 1.0 / order, 1.0 / order])
        ends = np.zeros((2, 2 * self.harmonics + 1))
        ends[0, 1 : self.harmonics + 1] = order**2
        ends[1, self.harmonics + 1 :] = order
        return np.asarray(weight[:, None] * scipy.linalg.null_space(ends * weight))

    def _series(self, time: Array, derivative: int) -> Array:
        order = self.omega * np.arange(1, self.harmonics + 1)
        shift = derivative * np.pi / 2
        phase = np.outer(time, order) + shift
        constant = np.full((time.size, 1), 1.0 if derivative == 0 else 0.0)
        return np.hstack([constant, order**derivative * np.cos(phase), order**derivative * np.sin(phase)])

    def basis(self, time: Array, derivative: int) -> Array:
        """Values of the free basis functions, shape (N, size)."""
        return np.asarray(self._series(np.asarray(time, dtype=float), derivative) @ self._Z)

    def grid_factor(self, count: int, derivative: int) -> float:
        """``cos(pi K / count)``: the bound of Ehlich and Zeller (1964) for trigonometric polynomials of degree K."""
        if count <= 2 * self.harmonics:
            raise ValueError(f"a grid of {count} instants is too coarse for {self.harmonics} harmonics")
        return float(np.cos(np.pi * self.harmonics / count))

    def extrema(self, x: Array, derivative: int) -> Extrema:
        """Extrema from the roots of the derivative, see `constraints.certificate.trigonometric_extrema`."""
        K = self.harmonics
        series = self.coefficients(x)
        scale = (self.omega * np.arange(1, K + 1)) ** derivative
        cosine, sine = scale * series[:, 1 : K + 1], scale * series[:, K + 1 :]
        for _ in range(derivative):
            cosine, sine = sine, -cosine
        constant = series[:, 0] if derivative == 0 else np.zeros(len(series))
        return trigonometric_extrema(constant, cosine, sine, self.omega)

    def _split(self, coefficients: Array) -> list[Array]:
        offset, cosine, sine = np.split(coefficients, [1, 1 + self.harmonics], axis=1)
        return [offset[:, 0], cosine, sine]
