"""Sums of sines of free frequencies and phases, as in [KD96] section 5.4, at rest at both ends at the same pose.

``y_j(t) = c_j + sum_i A_ij sin(w_ij t + phi_ij) - p_j(t)``: the polynomial p of fifth order satisfies the conditions at
the ends, ``dy = ddy = 0`` at 0 and T and ``y(0) = y(T)``. Frequencies stay between half a period in T and K periods,
``w = (w_max + w_min + (w_max - w_min) sin s) / 2``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from constraints.certificate import Extrema
from constraints.enclosure import chebyshev_extrema, chebyshev_nodes
from excite.trajectories.family import check_size
from excite.trajectories.fourier import WavesAndQuintic
from excite.trajectories.nonlinear import NonlinearFamily
from excite.trajectories.polynomial import quintic_hermite
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.samples import Array

_LOWEST = 0.5  # periods in T


@checked
class Sines(WavesAndQuintic, NonlinearFamily):
    """Sums of ``harmonics`` sines of free frequencies, plus a quintic.

    Parameters
    ----------
    period : float
        T [s].
    harmonics : int
        Number of sines of each coordinate, and the largest number of periods of a sine in T; at least 1.

    Raises
    ------
    InputError
        An invalid duration or number of sines.
    """

    name = "sines"
    terms = "{harmonics} sines of free frequency and a quintic"
    nodes_per_instant = 2

    def __init__(self, period: float, harmonics: int) -> None:
        check_size(period, 1, harmonics=harmonics)
        self.duration, self.harmonics = float(period), int(harmonics)
        self.size = 2 * harmonics + 1
        unit = 2 * np.pi / self.duration
        self.lowest, self.highest = _LOWEST * unit, harmonics * unit
        self._turn = 0.5 * self.duration * (self.highest - self.lowest)  # phase shift of a sine per unit of s
        self._weight = 1.0 / np.arange(1, harmonics + 1)  # equal coefficients mean about equal velocities

    @property
    def constant(self) -> Array:
        """Coefficients of rest at position 1: the first one is 1."""
        return np.asarray(np.eye(1, self.size)[0])

    def shape(self, count: int, rng: np.random.Generator | None = None) -> Array:
        """Evenly spaced frequencies between the bounds, or each random within its part of the range."""
        K = self.harmonics
        inside = np.full((count, K), 0.5) if rng is None else rng.uniform(0.1, 0.9, (count, K))
        return np.asarray(self._turn * np.arcsin(2.0 * (np.arange(K) + inside) / K - 1.0).ravel())

    def coordinates(self, x: Array) -> int:
        """Number of coordinates that x moves."""
        return x.size // (self.size + self.harmonics)

    def frequencies(self, x: Array) -> Array:
        """Frequencies of every coordinate [rad/s], shape (k, K)."""
        s = self.split(x)[1].reshape(-1, self.harmonics) / self._turn
        return np.asarray(self.lowest + (self.highest - self.lowest) * 0.5 * (1.0 + np.sin(s)))

    def _polynomials(self, time: Array, derivative: int) -> Array:
        return quintic_hermite(time / self.duration, np.full(time.size, self.duration), derivative)

    def _ends(self, w: Array) -> Array:
        """States of ``exp(i w t) - 1`` at both ends, with position 0 at the first, shape (k, 6, K)."""
        at_end, ones = np.exp(1j * w * self.duration), np.ones_like(w)
        states = [0.0 * ones, 1j * w * ones, -(w**2) * ones, at_end - 1.0, 1j * w * at_end, -(w**2) * at_end]
        return np.stack(states, axis=1)

    def _waves(self, w: Array, time: Array, derivative: int) -> Array:
        """``exp(i w t)`` minus the polynomial with its states at the ends, shape (k, N, K); begins at 1."""
        wave = (1j * w[:, None, :]) ** derivative * np.exp(1j * w[:, None, :] * time[:, None])
        return np.asarray(wave - self._polynomials(time, derivative) @ self._ends(w))

    def _wave_slopes(self, w: Array, time: Array, derivative: int) -> Array:
        """Derivative of `_waves` with respect to w."""
        T, at_end = self.duration, np.exp(1j * w * self.duration)
        turn = 1j * T * at_end
        zero = 0.0 * turn
        last = [turn, 1j * at_end + 1j * w * turn, -2.0 * w * at_end - w**2 * turn]
        ends = np.stack([zero, zero + 1j, zero - 2.0 * w, *last], axis=1)
        iw = 1j * w[:, None, :]
        factor = iw**derivative * 1j * time[:, None] + derivative * 1j * iw ** max(derivative - 1, 0)
        wave = factor * np.exp(iw * time[:, None])
        return np.asarray(wave - self._polynomials(time, derivative) @ ends)

    def bases(self, x: Array, time: Array, derivative: int) -> Array:
        """Constant, cosines and sines of every coordinate, shape (k, N, size)."""
        waves = self._waves(self.frequencies(x), time, derivative) * self._weight
        constant = np.full((*waves.shape[:2], 1), 1.0 if derivative == 0 else 0.0)
        return np.concatenate([constant, waves.real, waves.imag], axis=2)

    def _amplitudes(self, x: Array) -> Array:
        """``cosine - i sine``, whose product with the waves has the motion as its real part, shape (k, K)."""
        linear, K = self.split(x)[0], self.harmonics
        return np.asarray((linear[:, 1 : K + 1] - 1j * linear[:, K + 1 :]) * self._weight)

    def coordinate_motion(self, x: Array, time: Array, derivative: int) -> Array:
        """Motion of the coordinates, shape (N, k)."""
        w, amplitudes = self.frequencies(x), self._amplitudes(x)
        motion = -self._polynomials(time, derivative) @ (self._ends(w) @ amplitudes[:, :, None])[:, :, 0].real.T
        turned = amplitudes * (1j * w) ** derivative
        for j, (own, by) in enumerate(zip(w, turned, strict=True)):
            phase = np.outer(time, own)
            motion[:, j] += np.cos(phase) @ by.real - np.sin(phase) @ by.imag
        return np.asarray(motion + self.split(x)[0][:, 0] if derivative == 0 else motion)

    def shape_slopes(self, x: Array, time: Array, derivative: int) -> Array:
        """Derivative with respect to the frequencies of every coordinate's own sines, shape (N, k, k K)."""
        linear, s = self.split(x)
        k, K = len(linear), self.harmonics
        rate = 0.5 * (self.highest - self.lowest) * np.cos(s.reshape(k, K) / self._turn) / self._turn
        slopes = self._wave_slopes(self.frequencies(x), time, derivative)
        own = (slopes * (self._amplitudes(x) * rate)[:, None, :]).real
        J = np.zeros((time.size, k, k, K))
        J[:, np.arange(k), np.arange(k)] = own.transpose(1, 0, 2)
        return J.reshape(time.size, k, k * K)

    def nodes(self, x: Array, count: int) -> tuple[Array, None]:
        """Zeros of a Chebyshev polynomial, two per requested instant."""
        return chebyshev_nodes(self.nodes_per_instant * count, 0.0, self.duration), None

    def combined_extrema(self, x: Array, matrix: Array, offset: Array, derivative: int) -> Extrema:
        """Extrema from the roots of the derivative of the polynomial that equals the motion to rounding."""
        first, held = self._carrying(x)
        constant = matrix @ held + offset if derivative == 0 else 0.0

        def functions(time: Array) -> Array:
            return np.asarray(self.coordinate_motion(x, time, derivative) @ (matrix @ first).T + constant)

        return chebyshev_extrema(functions, self.degree, self.duration)

    def to_dict(self, x: Array) -> dict[str, object]:
        """Family, period, amplitudes, frequencies and phases of the sines."""
        amplitudes = self._amplitudes(x)
        return {
            "family": self.name,
            "period": self.duration,
            "harmonics": self.harmonics,
            "form": "q = matrix y + rest; y(t) = offset + sum_i amplitude_i sin(frequency_i t + phase_i) - p(t), p the "
            "polynomial of fifth order with the sum's velocity and acceleration at 0 and period, 0 at the start at 0, "
            "and at the end what the sum has gained",
            **self.carrying(x),
            "offset": self.split(x)[0][:, 0].tolist(),
            "amplitude": np.abs(amplitudes).tolist(),
            "frequency": self.frequencies(x).tolist(),
            "phase": np.angle(1j * amplitudes).tolist(),
        }

    def restored(self, series: Mapping[str, Any]) -> Array:
        """The x from the entries of `to_dict`."""
        offset = np.array(series["offset"], dtype=float)
        A, w, phase = (np.array(series[part], dtype=float) for part in ("amplitude", "frequency", "phase"))
        expected = (offset.size, self.harmonics)
        if not all(part.shape == expected for part in (A, w, phase)):
            raise InputError(f"trajectory: expected {self.harmonics} sines for each of {offset.size} coordinates")
        middle, half = 0.5 * (self.highest + self.lowest), 0.5 * (self.highest - self.lowest)
        s = (w - middle) / half
        if np.any(np.abs(s) > 1.0 + 1e-9):
            raise InputError(f"trajectory: frequencies must be from {self.lowest:g} to {self.highest:g} rad/s")
        cosine, sine = A * np.sin(phase) / self._weight, A * np.cos(phase) / self._weight
        shape = self._turn * np.arcsin(np.clip(s, -1.0, 1.0))
        return np.concatenate([np.hstack([offset[:, None], cosine, sine]).ravel(), shape.ravel()])
