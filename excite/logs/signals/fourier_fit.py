"""Fourier series fitted to periodic motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from excite.logs.signals.method import FilteredMotion, Method, check_positive, cut_motion, spacing
from excite.logs.signals.periods import estimated_period
from regressors.errors import InputError
from regressors.samples import Array

_MOST = 60
_LARGE = 0.05


@dataclass(frozen=True)
class FourierFit(Method):
    """Least squares on ``q(t) = a_0 + sum_k a_k cos(k w t) + b_k sin(k w t)``, ``w = 2 pi / period``.

    Velocity and acceleration are the exact derivatives of the series.
    """

    # [s]; estimated where the motion repeats itself, see `excite.logs.signals.periods.estimated_period`, if not given
    period: float | None = None
    # number of k; if not given, the one with the least Bayesian information criterion, 60 at most
    harmonics: int | None = None

    name: ClassVar[str] = "fourier"

    def __post_init__(self) -> None:
        check_positive(self.name, period=self.period, harmonics=self.harmonics)

    @property
    def table_width(self) -> int:
        """The series, its derivatives, and the orthonormal basis with its copy."""
        return 5 * (2 * (_MOST if self.harmonics is None else self.harmonics) + 1)

    def motion(self, time: Array, q: Array, dq: Array | None = None) -> FilteredMotion:
        """The series at the sample times, no end cut; see `Method.motion`."""
        period, harmonics = self._choice(time, q)
        part = fourier_basis(time - time[0], period, harmonics)
        coefficients = np.linalg.lstsq(part[0], q, rcond=None)[0]
        fitted, velocity, acceleration = (matrix @ coefficients for matrix in part)
        state = (fitted, velocity, acceleration)
        return cut_motion(time, state, 0, self._assumed(period, harmonics, q, fitted))

    def settled(self, time: Array, q: Array) -> FourierFit:
        """The method with the period that it estimates, and the harmonics that it chooses."""
        period, harmonics = self._choice(time, q)
        return FourierFit(period, harmonics)

    def operator(self, time: Array, q: Array) -> Callable[[Array], FilteredMotion]:
        """The fit with the series that it would choose, through one orthonormal basis of it.

        With the basis ``B = Q R`` and ``dB/dt = B D`` the derivatives of the fit are ``Q (R D^d R^-1) Q' q``.
        """
        period, harmonics = self._choice(time, q)
        Q, R = np.linalg.qr(fourier_basis(time - time[0], period, harmonics)[0])
        D = _differentiation(period, harmonics)
        first, second = (R @ power @ np.linalg.inv(R) for power in (D, D @ D))

        def fitted_to(positions: Array) -> FilteredMotion:
            c = Q.T @ positions
            state = (Q @ c, Q @ (first @ c), Q @ (second @ c))
            return cut_motion(time, state, 0, self._assumed(period, harmonics, positions, state[0]))

        return fitted_to

    def _choice(self, time: Array, q: Array) -> tuple[float, int]:
        """Period and harmonics, determined from the motion where they are not given."""
        h = spacing(time, self.name, 16)
        period = estimated_period(time, q) if self.period is None else self.period
        if time.size * h < 0.999 * period:
            raise InputError(f"{self.name}: {time.size * h:.4g} s do not hold one period of {period:.4g} s")
        most = int(min(_MOST, (period / h - 1) / 4, (time.size - 1) / 4)) if self.harmonics is None else self.harmonics
        if 2 * most + 1 > min(time.size, period / h):
            raise InputError(
                f"{self.name}: {most} harmonics need {2 * most + 1} samples per period, there are {period / h:.4g}"
            )
        if self.harmonics is not None:
            return period, self.harmonics
        return period, best_harmonics(fourier_basis(time - time[0], period, most)[0], q)

    def _assumed(self, period: float, harmonics: int, q: Array, fitted: Array) -> str:
        residual = np.sqrt(np.mean((q - fitted) ** 2, axis=0))
        share = float(np.sqrt(np.sum(residual**2) / max(np.sum(q.var(axis=0)), np.finfo(float).tiny)))
        much = ", a large part; check that the motion is periodic with this period" if share > _LARGE else ""
        return (
            f"periodic motion of {period:.6g} s ({'estimated' if self.period is None else 'given'}) with {harmonics} "
            f"harmonics ({'chosen' if self.harmonics is None else 'given'}); residual of at most {residual.max():.3g} "
            f"rad or m, {100 * share:.2g} % of the motion{much}"
        )


def fourier_basis(time: Array, period: float, harmonics: int) -> Array:
    """Columns 1, cos, sin, cos, sin, ... of the series and of its first and second derivative."""  # time (N,)
    w = 2 * np.pi / period * np.arange(1, harmonics + 1)
    angle = time[:, None] * w
    cos, sin = np.cos(angle), np.sin(angle)
    basis = np.zeros((3, time.size, 2 * harmonics + 1))
    basis[0, :, 0] = 1.0
    basis[:, :, 1::2] = cos, -w * sin, -(w**2) * cos
    basis[:, :, 2::2] = sin, w * cos, -(w**2) * sin
    return basis


def _differentiation(period: float, harmonics: int) -> Array:
    """Matrix D of ``dB/dt = B D`` for the columns B of `fourier_basis`, shape (2 H + 1, 2 H + 1)."""
    D = np.zeros((2 * harmonics + 1, 2 * harmonics + 1))
    for k in range(1, harmonics + 1):
        w = 2 * np.pi / period * k
        D[2 * k, 2 * k - 1], D[2 * k - 1, 2 * k] = -w, w
    return D


def best_harmonics(basis: Array, q: Array) -> int:
    """Number of harmonics of the least ``sum_j N log(R_j / N) + n p log N``, R the residuals' sum of squares."""
    # basis (N, 2 H + 1); q (N, n)
    count, n = q.shape
    Q = np.linalg.qr(basis)[0]
    shown = (Q.T @ q) ** 2
    rest = np.sum((q - Q @ (Q.T @ q)) ** 2, axis=0) + np.cumsum(shown[::-1], axis=0)[::-1] - shown  # with p columns
    rounding = count * (8 * np.finfo(float).eps * np.abs(q).max(axis=0)) ** 2 + np.finfo(float).tiny
    columns = np.arange(1, basis.shape[1] + 1)
    criterion = count * np.log(np.maximum(rest, rounding)).sum(axis=1) + n * columns * np.log(count)
    return 1 + int(np.argmin(criterion[2::2]))
