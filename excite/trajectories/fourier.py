"""Finite Fourier series, cosine series, and Fourier series plus a polynomial of fifth order, at rest at both ends.

``q(t) = c + sum_k a_k cos(k w t) + b_k sin(k w t)`` with w = 2 pi / T; position, velocity and acceleration are
periodic, and ``dq(0) = w sum_k k b_k = 0``, ``ddq(0) = -w^2 sum_k k^2 a_k = 0`` [Swevers 1997, with rest added].

``q(t) = sum_k a_k cos(k w t) + b_k sin(k w t) + p(t)`` with w = 2 pi / T. The polynomial satisfies the conditions at
the ends: ``dq = ddq = 0`` at 0 and T, and ``q(0) = q(T)``, so that the motion can be repeated.

``q(t) = c + sum_k a_k cos(k w t)`` with w = 2 pi / T; ``dq(0) = 0`` for every a, ``ddq(0) = -w^2 sum_k k^2 a_k = 0``.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from constraints.certificate import Extrema, trigonometric_extrema
from constraints.enclosure import chebyshev_extrema, chebyshev_nodes, node_factor
from excite.trajectories.family import Family, check_size
from excite.trajectories.linear import LinearFamily
from excite.trajectories.polynomial import chebyshev_terms
from regressors.arguments import checked
from regressors.numerical import null_space
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
        check_size(period, 2, harmonics=harmonics)
        self.duration, self.harmonics = float(period), int(harmonics)
        self.size = 2 * harmonics - 1
        self.omega = 2 * np.pi / self.duration
        self._Z = self._rest_basis()

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
        return np.asarray(weight[:, None] * null_space(ends * weight))

    def _series(self, time: Array, derivative: int) -> Array:
        order = self.omega * np.arange(1, self.harmonics + 1)
        phase = np.outer(time, order) + derivative * np.pi / 2
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


_QUINTIC = 5
_TAIL = 40  # degrees above pi K beyond which the Chebyshev coefficients of cos(K w t) vanish


class WavesAndQuintic(Family):
    """Waves of at most K periods plus a polynomial of fifth order: a polynomial of high degree, to rounding."""

    harmonics: int  # K
    nodes_per_instant: ClassVar[int]

    @property
    def degree(self) -> int:
        """Degree of a polynomial that equals any motion of the family to rounding."""
        return math.ceil(np.pi * self.harmonics) + _TAIL

    @property
    def richness(self) -> int:
        """Number of waves, plus two for the polynomial."""
        return self.harmonics + 2

    def grid_factor(self, count: int, derivative: int) -> float:
        """See `constraints.enclosure.chebyshev_nodes`."""
        return node_factor(self.degree, self.nodes_per_instant * count)


@checked
class FourierQuintic(WavesAndQuintic, LinearFamily):
    """Fourier series of ``harmonics`` terms plus a quintic.

    Parameters
    ----------
    period : float
        Period T [s].
    harmonics : int
        Number of harmonics K, at least 1.

    Raises
    ------
    InputError
        An invalid duration or number of harmonics.
    """

    name = "fourier-quintic"
    terms = "{harmonics} harmonics and a quintic"
    nodes_per_instant = 4  # they bound less tightly than equal steps do for a Fourier series
    parts = ("cosine", "sine", "chebyshev")
    form = (
        "q(t) = sum_k cosine_k cos(2 pi k t / period) + sine_k sin(2 pi k t / period) "
        "+ sum_i chebyshev_i T_i(2 t / period - 1)"
    )

    def __init__(self, period: float, harmonics: int) -> None:
        check_size(period, 1, harmonics=harmonics)
        self.duration, self.harmonics = float(period), int(harmonics)
        self.size = 2 * harmonics + 1
        self.omega = 2 * np.pi / self.duration
        self._Z = self._rest_basis()

    def _terms(self, time: Array, derivative: int) -> Array:
        """Cosines, sines and Chebyshev's polynomials of degree 0 to 5 on [0, T], shape (N, 2K + 6)."""
        order = self.omega * np.arange(1, self.harmonics + 1)
        phase = np.outer(time, order) + derivative * np.pi / 2
        values = chebyshev_terms(time, self.duration, _QUINTIC, derivative)
        return np.hstack([order**derivative * np.cos(phase), order**derivative * np.sin(phase), values])

    def _rest_basis(self) -> Array:
        """Coefficients of motions at rest at both ends, scaled to equal velocities, shape (2K + 6, 2K + 1)."""
        times = np.linspace(0.0, self.duration, 16 * self.degree)
        speed = np.sqrt(np.mean(self._terms(times, 1) ** 2, axis=0))
        weight = np.where(speed > 0, speed.max() / np.where(speed > 0, speed, 1.0), 1.0) / self.harmonics
        ends = np.array([0.0, self.duration])
        closed = np.diff(self._terms(ends, 0), axis=0)
        rows = [closed, *(self._terms(ends, d) / self.omega**d for d in (1, 2))]
        return np.asarray(weight[:, None] * null_space(np.vstack(rows) * weight))

    def basis(self, time: Array, derivative: int) -> Array:
        """Values of the free basis functions, shape (N, size)."""
        return np.asarray(self._terms(np.asarray(time, dtype=float), derivative) @ self._Z)

    @property
    def constant(self) -> Array:
        """Coefficients of the motion that rests at position 1."""
        return self.from_coefficients(np.eye(1, 2 * self.harmonics + 6, 2 * self.harmonics)[0])

    def grid(self, count: int) -> Array:
        """Zeros of a Chebyshev polynomial, four per requested instant."""
        return chebyshev_nodes(self.nodes_per_instant * count, 0.0, self.duration)

    def extrema(self, x: Array, derivative: int) -> Extrema:
        """Extrema from the roots of the derivative of the polynomial that equals the motion to rounding."""
        return chebyshev_extrema(lambda time: self.basis(time, derivative) @ x.T, self.degree, self.duration)

    def _split(self, coefficients: Array) -> list[Array]:
        return np.split(coefficients, [self.harmonics, 2 * self.harmonics], axis=1)


@checked
class Cosine(Fourier):
    """Fourier series that are even about the middle of the motion: the second half is the first one reversed.

    Parameters
    ----------
    period : float
        Period T [s].
    harmonics : int
        Number of cosines K, at least 2.
    """

    name = "cosine"
    terms = "{harmonics} cosines"

    def __init__(self, period: float, harmonics: int) -> None:
        super().__init__(period, harmonics)
        self.size = harmonics

    def _rest_basis(self) -> Array:
        """Orthonormal coefficients (c, a_1 .. a_K, 0 .. 0) of motions at rest at t = 0, shape (2K + 1, K)."""
        K = self.harmonics
        order = np.arange(1, K + 1)
        weight = np.concatenate([[1.0], 1.0 / order])
        ends = np.concatenate([[0.0], order**2])[None] * weight
        return np.vstack([weight[:, None] * null_space(ends), np.zeros((K, K))])
