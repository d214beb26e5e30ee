"""Enclosures of functions of a motion over continuous time, piece by piece.

Around the middle m of a time interval of half length h, ``g(t)`` lies in ``g(m) + [dg/dt] [-h, h]`` with dg/dt enclosed
over all states that the motion can have in that interval (mean value form). Undecided intervals are split.

On a piece of length h a polynomial ``sum_i p_i s^i`` of degree d in ``s = t / h`` stays between the least and the
largest of its Bernstein coefficients ``b_j = sum_{i <= j} C(j, i) / C(d, i) p_i`` [Farouki 2012, eq. 15]. Pieces whose
coefficients do not pass what is reached at the ends of the others need no roots.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import comb
from typing import Protocol

import numpy as np
import numpy.polynomial.chebyshev as chebyshev
from numpy.typing import NDArray

from constraints.certificate import Extrema, LimitUse, limit_uses
from constraints.linear import LinearConstraint
from constraints.nonlinear import NonlinearConstraint
from regressors.samples import Array, Samples

_INTERVALS = 1024
_PARTS = 4
_DEPTH = 9
_CLOSE = 1e-3  # of a function's scale: near a limit, bounds this close to values that occur are accepted
_LOOSE = 1e-2  # the same where no limit is near
_ROUNDING = 1e-12  # of a function's scale and value: the rounding error of a value
_MOST = 200_000


def enclose(
    constraint: NonlinearConstraint, motion: Callable[[Array], Samples], duration: float, jerk: Array
) -> Extrema:
    """Bounds of a constraint's functions that hold at every instant of a motion, and instants near which they are met.

    Within a function's scale of a limit they exceed values that occur by at most 0.01 of that scale, and near or beyond
    the limit by at most 0.001; by more only where a motion varies so fast that 9 splits do not decide.
    """  # jerk (n,)
    if not np.all(np.isfinite(jerk)):  # nothing is known between instants
        none, at = np.full(len(constraint.lower), np.inf), np.zeros(len(constraint.lower))
        return Extrema(-none, none, at, at)
    half = np.full(_INTERVALS, 0.5 * duration / _INTERVALS)
    middle = (np.arange(_INTERVALS) + 0.5) * duration / _INTERVALS
    limit, scale = np.concatenate([constraint.upper, -constraint.lower]), np.tile(constraint.scale, 2)
    # of the functions, then of these with the other sign
    bound, reached, time = np.full(limit.size, -np.inf), np.full(limit.size, -np.inf), np.zeros(limit.size)
    for depth in range(_DEPTH + 1):
        value, slack = _mean_value(constraint, motion(middle), half, jerk)
        both = np.hstack([value, -value])
        best = both.argmax(axis=0)
        time = np.where(both[best, np.arange(limit.size)] > reached, middle[best], time)
        reached = np.maximum(reached, both.max(axis=0))
        beyond = both + np.hstack([slack, slack])
        split = np.any(_undecided(beyond, reached, limit, scale), axis=1)
        if depth == _DEPTH or split.sum() * _PARTS > _MOST:
            split[:] = False
        bound = np.maximum(bound, beyond[~split].max(axis=0, initial=-np.inf))
        if not np.any(split):
            break
        offsets = (2 * np.arange(_PARTS) + 1) / _PARTS - 1.0
        middle = (middle[split, None] + half[split, None] * offsets).ravel()
        half = np.repeat(half[split] / _PARTS, _PARTS)
    (high, low), (high_time, low_time) = np.split(bound, 2), np.split(time, 2)
    return Extrema(0.0 - low, high, low_time, high_time)


def _undecided(bound: Array, reached: Array, limit: Array, scale: Array) -> NDArray[np.bool_]:
    """Select the bounds that are too far above values that occur; far from a limit no accuracy is required."""
    beyond = (bound - reached) / scale
    left = np.subtract(limit, bound, out=np.full_like(bound, np.inf), where=np.isfinite(limit)) / scale
    loose, close = (beyond > _LOOSE) & (left < 1.0), (beyond > _CLOSE) & (left < _CLOSE)
    return np.asarray(loose | close, dtype=bool)


def _mean_value(constraint: NonlinearConstraint, samples: Samples, half: Array, jerk: Array) -> tuple[Array, Array]:
    """Values in the middle of intervals, and the largest deviations from them inside, shape (N, k) each."""
    h = half[:, None]
    third = np.broadcast_to(jerk, samples.q.shape)
    second = third * h
    first = np.abs(samples.ddq) * h + third * h**2 / 2
    zeroth = np.abs(samples.dq) * h + np.abs(samples.ddq) * h**2 / 2 + third * h**3 / 6
    spread = (zeroth, first, second)
    centre = (samples.q, samples.dq, samples.ddq)
    low = [np.ascontiguousarray((x - s).T) for x, s in zip(centre, spread, strict=True)]
    high = [np.ascontiguousarray((x + s).T) for x, s in zip(centre, spread, strict=True)]
    slow, fast = constraint.rate([*low, np.ascontiguousarray(-third.T)], [*high, np.ascontiguousarray(third.T)])
    steepest = np.maximum(np.abs(slow), np.abs(fast)).T
    value = constraint.values(samples)
    return value, steepest * h + _ROUNDING * (constraint.scale + np.abs(value))


def hulled_extrema(breaks: Array, coefficients: Array) -> Extrema:
    """Extrema of piecewise polynomials, to 1e-12 of the largest value; see `piecewise_extrema`."""
    # breaks (m + 1,); coefficients (d + 1, m, k)
    hull = _bernstein(np.diff(breaks), coefficients)
    ends = np.concatenate([hull[0], hull[-1][-1:]])  # values at all breaks, shape (m + 1, k)
    slack = _ROUNDING * np.abs(ends).max(axis=0)
    beyond = (hull.max(axis=0) > ends.max(axis=0) + slack) | (hull.min(axis=0) < ends.min(axis=0) - slack)
    values, times = [[value] for value in ends.T], [[breaks] for _ in ends.T]
    for i, k in zip(*np.nonzero(beyond), strict=True):
        value, time = _candidates(coefficients[:, i, k], breaks[i], breaks[i + 1] - breaks[i])
        values[k].append(value)
        times[k].append(time)
    return Extrema.among(map(np.concatenate, values), map(np.concatenate, times))


def _bernstein(length: Array, coefficients: Array) -> Array:
    """Bernstein coefficients of every piece, shape (d + 1, m, k)."""
    d = coefficients.shape[0] - 1
    powers = length[None] ** np.arange(d + 1.0)[:, None]  # (d + 1, m)
    p = coefficients[::-1] * powers[:, :, None]  # of s^i
    B = np.array([[comb(j, i) / comb(d, i) if i <= j else 0.0 for i in range(d + 1)] for j in range(d + 1)])
    return np.asarray(np.einsum("ji,imk->jmk", B, p))


def piecewise_extrema(breaks: Array, coefficients: Array) -> Extrema:
    """Extrema of piecewise polynomials, from the roots of their derivatives and both ends of every piece."""
    # breaks (m + 1,); coefficients (d + 1, m, k)
    values, times = [], []
    for pieces in coefficients.transpose(2, 1, 0):  # of one function
        parts = [_candidates(*each) for each in zip(pieces, breaks[:-1], np.diff(breaks), strict=True)]
        values.append(np.concatenate([value for value, _ in parts]))
        times.append(np.concatenate([time for _, time in parts]))
    return Extrema.among(values, times)


def _candidates(piece: Array, start: float, length: float) -> tuple[Array, Array]:
    """Values of a piece at both ends and where its derivative vanishes, and these instants."""
    local = np.concatenate([[0.0, length], _stationary(piece, length)])
    return np.polyval(piece, local), start + local


def _stationary(piece: Array, length: float) -> Array:
    """Instants inside a piece where its derivative vanishes, in a scaled variable for good conditioning."""
    slope = np.polyder(piece * length ** np.arange(piece.size - 1, -1.0, -1.0))
    roots = np.roots(np.where(np.abs(slope) > 1e-15 * np.abs(slope).max(initial=0.0), slope, 0.0))
    inside = roots[(np.abs(roots.imag) < 1e-6) & (roots.real > 0.0) & (roots.real < 1.0)]
    return np.asarray(inside.real * length)


def chebyshev_extrema(functions: Callable[[Array], Array], degree: int, duration: float) -> Extrema:
    """Extrema of k smooth functions over [0, T], whose values at N + 1 instants have the shape (N + 1, k).

    Through the points at ``T/2 (1 - cos(pi k / N))`` passes one polynomial of degree N; the roots of its derivative are
    the eigenvalues of a colleague matrix. It equals the function where the Chebyshev coefficients vanish before degree
    N.
    """
    angle = np.pi * np.arange(degree + 1) / degree
    values = functions(np.asarray(0.5 * duration * (1.0 - np.cos(angle))))
    weights = np.full(degree + 1, 2.0 / degree)
    weights[[0, -1]] /= 2
    found, times = [], []
    for column in values.T[:, ::-1]:  # from t = T, where the cosine is one, back to 0
        series = np.cos(np.outer(np.arange(degree + 1), angle)) @ (weights * column)
        series[[0, -1]] /= 2
        kept = chebyshev.chebtrim(np.where(np.abs(series) > 1e-15 * np.abs(series).max(), series, 0.0))
        points = np.concatenate([[-1.0, 1.0], np.cos(angle), _roots(np.asarray(chebyshev.chebder(kept), dtype=float))])
        found.append(chebyshev.chebval(points, kept))
        times.append(0.5 * duration * (1.0 + points))
    return Extrema.among(found, times)


def _roots(series: Array) -> Array:
    roots = np.asarray(chebyshev.chebroots(series), dtype=complex)
    return np.asarray(np.clip(roots[np.abs(roots.imag) < 1e-6].real, -1.0, 1.0))


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


class BoundedMotion(Protocol):
    """A motion whose extrema over continuous time are known: that of a trajectory, or an approach."""

    @property
    def duration(self) -> float:
        """Duration from start to end [s]."""

    @property
    def jerk(self) -> Array:
        """Largest magnitude of every joint's jerk [rad/s^3 or m/s^3]."""

    def samples(self, time: Array) -> Samples:
        """Motion at given instants [s]."""

    def extrema(self, constraint: LinearConstraint, /) -> Extrema:
        """Extrema of a linear constraint's functions."""


def uses_of(
    motion: BoundedMotion, linear: Iterable[LinearConstraint], nonlinear: Iterable[NonlinearConstraint] = ()
) -> tuple[LimitUse, ...]:
    """Certificate of every limit for a motion: exact extrema of linear ones, enclosures of the others."""
    exact = (use for limit in linear for use in limit_uses(limit, motion.extrema(limit)))
    enclosures = ((limit, enclose(limit, motion.samples, motion.duration, motion.jerk)) for limit in nonlinear)
    return (*exact, *(use for limit, enclosure in enclosures for use in enclosure.uses(limit)))
