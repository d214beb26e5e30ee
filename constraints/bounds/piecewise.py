"""Exact extrema of functions of time that are piecewise polynomial, or polynomial as a whole (to rounding)."""

from __future__ import annotations

import numpy as np
import numpy.polynomial.chebyshev as chebyshev

from constraints.bounds.extrema import Extrema
from regressors.samples import Array


def piecewise_extrema(breaks: Array, coefficients: Array) -> Extrema:
    """Extrema of piecewise polynomials, from the roots of their derivatives and both ends of every piece."""
    # breaks (m + 1,); coefficients (d + 1, m, k)
    length = np.diff(breaks)
    count = coefficients.shape[2]
    low, high = np.full(count, np.inf), np.full(count, -np.inf)
    low_time, high_time = np.zeros(count), np.zeros(count)
    for i, h in enumerate(length):
        for k in range(count):
            piece = coefficients[:, i, k]
            local = np.concatenate([[0.0, h], _stationary(piece, h)])
            value = np.polyval(piece, local)
            least, most = int(np.argmin(value)), int(np.argmax(value))
            if value[least] < low[k]:
                low[k], low_time[k] = value[least], breaks[i] + local[least]
            if value[most] > high[k]:
                high[k], high_time[k] = value[most], breaks[i] + local[most]
    return Extrema(low, high, low_time, high_time)


def _stationary(piece: Array, length: float) -> Array:
    """Instants inside a piece where its derivative vanishes, in a scaled variable for good conditioning."""
    degree = piece.size - 1
    slope = np.polyder(piece * length ** np.arange(degree, -1.0, -1.0)) if degree > 0 else np.zeros(1)
    size = np.abs(slope).max(initial=0.0)
    if size == 0.0:
        return np.zeros(0)
    roots = np.roots(np.where(np.abs(slope) > 1e-15 * size, slope, 0.0))
    inside = roots[(np.abs(roots.imag) < 1e-6) & (roots.real > 0.0) & (roots.real < 1.0)]
    return np.asarray(inside.real * length)


def chebyshev_extrema(values: Array, duration: float) -> Extrema:
    """Extrema of smooth functions over [0, T] from their values at Chebyshev points.

    Through N + 1 points ``T/2 (1 - cos(pi k / N))`` passes one polynomial of degree N; the roots of its derivative are
    the eigenvalues of a colleague matrix. It equals the function where the Chebyshev coefficients vanish before degree
    N.
    """  # values (N + 1, k)
    degree = values.shape[0] - 1
    angle = np.pi * np.arange(degree + 1) / degree
    weights = np.full(degree + 1, 2.0 / degree)
    weights[[0, -1]] /= 2
    low, high, low_time, high_time = [], [], [], []
    for column in values.T[:, ::-1]:  # from t = T, where the cosine is one, back to 0
        series = np.cos(np.outer(np.arange(degree + 1), angle)) @ (weights * column)
        series[[0, -1]] /= 2
        size = np.abs(series).max(initial=0.0)
        kept = chebyshev.chebtrim(np.where(np.abs(series) > 1e-15 * size, series, 0.0)) if size > 0 else np.zeros(1)
        points = np.concatenate([[-1.0, 1.0], np.cos(angle), _roots(np.asarray(chebyshev.chebder(kept), dtype=float))])
        extrema = chebyshev.chebval(points, kept)
        least, most = int(np.argmin(extrema)), int(np.argmax(extrema))
        low.append(extrema[least])
        high.append(extrema[most])
        low_time.append(points[least])
        high_time.append(points[most])
    seconds = [0.5 * duration * (1.0 + np.array(x)) for x in (low_time, high_time)]
    return Extrema(np.array(low), np.array(high), *seconds)


def _roots(series: Array) -> Array:
    if series.size < 2:
        return np.zeros(0)
    roots = np.asarray(chebyshev.chebroots(series), dtype=complex)
    return np.asarray(np.clip(roots[np.abs(roots.imag) < 1e-6].real, -1.0, 1.0))


def chebyshev_points(count: int, duration: float) -> Array:
    """Points ``T/2 (1 - cos(pi k / N))``, k = 0 ... N = count - 1, from 0 to T [s]."""
    return np.asarray(0.5 * duration * (1.0 - np.cos(np.pi * np.arange(count) / (count - 1))))


def chebyshev_nodes(count: int, start: float, end: float) -> Array:
    """Zeros of Chebyshev's polynomial of degree ``count`` on an interval, in ascending order.

    A polynomial of degree n that stays within a bound on them stays within ``1 / cos(pi n / (2 count))`` times the
    bound on the whole interval [Ehlich, Zeller 1964].
    """
    angle = np.pi * (np.arange(count) + 0.5) / count
    return np.asarray(start + 0.5 * (end - start) * (1.0 - np.cos(angle)))


def node_factor(degree: int, count: int) -> float:
    """``cos(pi n / (2 count))`` of `chebyshev_nodes`; `ValueError` where the nodes do not bound that degree."""
    if degree >= count:
        raise ValueError(f"{count} nodes are too few for polynomials of degree {degree}; expected {degree + 1} or more")
    return float(np.cos(np.pi * degree / (2 * count)))
