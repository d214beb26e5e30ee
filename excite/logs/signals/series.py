"""Positions as a Fourier series of a periodic motion, or as quintic splines with as few knots as the noise allows."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import scipy

from excite.logs.signals.method import FilteredMotion, Method, check_positive, cut_motion, spacing
from excite.logs.signals.periods import estimated_period
from regressors.errors import InputError, percent
from regressors.samples import Array, Index

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
        assumed = self._assumed(period, harmonics, q, fitted)
        return cut_motion(time, (fitted, velocity, acceleration), 0, assumed)

    def settled(self, time: Array, q: Array) -> FourierFit:
        """The method with the period that it estimates, and the harmonics that it chooses."""
        return FourierFit(*self._choice(time, q))

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
            f"rad or m, {percent(share)} of the motion{much}"
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
    k = np.arange(1, harmonics + 1)
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


_DEGREE = 5
_FINER = np.sqrt(2.0)
_FEWEST_PER_KNOT = 3.0
_ALIKE = 1.02
_ABOVE_NOISE = 1.05


@dataclass(frozen=True)
class SmoothingSpline(Method):
    """Least-squares quintic spline with uniform knots; their distance is chosen per joint.

    With N samples, p coefficients and the sum of squares R of the residuals: where the noise s is known, the widest
    knots with ``R / (N - p) <= (1.05 s)^2``; where not, the widest whose generalised cross-validation
    ``N R / (N - p)^2`` [Craven, Wahba 1979] is within 2 % of the least. The former suits rounded positions better.
    """

    noise: float | None = None  # standard deviation of the positions [rad or m]
    # distance of the knots [s], of all joints or of each; chosen if not given
    knots: float | tuple[float, ...] | None = None
    cutoff: float | None = None  # instead: highest frequency that the knots resolve, two of them in its period [Hz]

    name: ClassVar[str] = "spline"

    def __post_init__(self) -> None:
        for knots in self.knots if isinstance(self.knots, tuple) else (self.knots,):
            check_positive(self.name, noise=self.noise, knots=knots, cutoff=self.cutoff)
        if self.knots is None and self.cutoff is not None:
            object.__setattr__(self, "knots", 0.5 / self.cutoff)

    def motion(self, time: Array, q: Array, dq: Array | None = None) -> FilteredMotion:
        """Values and derivatives of the splines; see `Method.motion`."""
        h = spacing(time, self.name, 16)
        splines = self._splines(time, q)
        state = tuple(np.empty(q.shape) for _ in range(3))
        for fitted, joints in splines:
            for derivative, values in enumerate(state):
                values[:, joints] = fitted.spline(time, derivative)
        distance = np.array([fitted.distance for fitted, _ in splines])
        residual = np.concatenate([fitted.deviation for fitted, _ in splines])
        edge = min(int(np.ceil(distance.max() / h)), time.size // 10)
        assumed = (
            f"quintic smoothing splines of the positions, assuming white noise; knots every {_each(distance)} s "
            f"({self._reason}), residuals of {_each(residual)} rad or m; {edge * h:.3g} s cut at each end"
        )
        return cut_motion(time, state, edge, assumed)

    @property
    def _reason(self) -> str:
        if self.knots is not None:
            return "given"
        return "by cross-validation" if self.noise is None else f"for noise of {self.noise:g}"

    def settled(self, time: Array, q: Array) -> SmoothingSpline:
        """The method with the distance of the knots that it chooses for each joint."""
        if self.knots is not None:
            return self
        distance = np.empty(q.shape[1])
        for fitted, joints in self._splines(time, q):
            distance[joints] = fitted.distance
        return replace(self, knots=tuple(distance.tolist()))

    def _splines(self, time: Array, q: Array) -> list[tuple[SplineFit, Index]]:
        """Splines of the joints that have the same knots, and which joints these are."""
        if self.knots is not None:
            pieces = np.maximum(1, np.round(float(time[-1] - time[0]) / np.broadcast_to(self.knots, q.shape[1])))
            groups = [(int(count), np.flatnonzero(pieces == count)) for count in np.unique(pieces)]
            return [(fit(time, q[:, joints], count), joints) for count, joints in groups]
        fits = list(self._fits(time, q))
        chosen = self._chosen(fits, q)
        return [(fits[i].of(joints), joints) for i in np.unique(chosen) for joints in [np.flatnonzero(chosen == i)]]

    def _fits(self, time: Array, q: Array) -> Iterator[SplineFit]:
        most, pieces = max(1, int(time.size / _FEWEST_PER_KNOT) - _DEGREE), 1.0
        while pieces < most:
            yield fit(time, q, int(pieces))
            pieces = max(pieces * _FINER, pieces + 1)
        yield fit(time, q, most)

    def _chosen(self, fits: list[SplineFit], q: Array) -> Index:
        """Which fit each joint takes; the fits have ever closer knots."""
        if self.noise is None:
            score = np.array([f.deviation**2 / f.freedom for f in fits])
            least = score.min(axis=0) * _ALIKE + (np.finfo(float).eps * np.abs(q).max(axis=0)) ** 2
            return np.asarray(np.argmax(score <= least, axis=0))
        enough = np.array([f.deviation <= _ABOVE_NOISE * self.noise for f in fits])
        return np.asarray(np.where(enough.any(axis=0), np.argmax(enough, axis=0), len(fits) - 1))


@dataclass(frozen=True, eq=False)
class SplineFit:
    """Splines of all joints with one distance of knots."""

    spline: scipy.interpolate.BSpline  # of n columns
    distance: float  # [s]
    freedom: int  # ``N - p``
    deviation: Array  # (n,) ``sqrt(R / (N - p))``

    def of(self, joints: Index) -> SplineFit:
        """The splines of some joints."""
        spline = scipy.interpolate.BSpline(self.spline.t, self.spline.c[:, joints], self.spline.k)
        return SplineFit(spline, self.distance, self.freedom, self.deviation[joints])


def fit(time: Array, q: Array, pieces: int) -> SplineFit:
    """Least-squares quintic splines of a number of uniform pieces."""  # time (N,); q (N, n)
    inner = np.linspace(time[0], time[-1], pieces + 1)
    knots = np.concatenate([np.repeat(inner[0], _DEGREE), inner, np.repeat(inner[-1], _DEGREE)])
    spline = scipy.interpolate.make_lsq_spline(time, q, knots, _DEGREE, method="norm-eq")  # well conditioned, and fast
    freedom = time.size - (pieces + _DEGREE)
    deviation = np.sqrt(np.sum((q - spline(time)) ** 2, axis=0) / freedom)
    return SplineFit(spline, float(inner[1] - inner[0]), freedom, deviation)


def _each(values: Array) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"
