"""Quintic splines through free waypoints at free times, at rest at both ends at the same pose.

On each of m intervals every coordinate is the polynomial of fifth order with given position, velocity and acceleration
at both ends. Those at the m - 1 inner waypoints are free, as is the pose of the ends; the intervals' durations are free
too, the same for all coordinates: ``h_i = T (f + (1 - m f) exp(s_i) / sum exp(s))`` with f the smallest fraction of T.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from constraints.certificate import Extrema
from constraints.enclosure import chebyshev_nodes, node_factor, piecewise_extrema
from excite.trajectories.family import check_size
from excite.trajectories.nonlinear import NonlinearFamily
from excite.trajectories.polynomial import ORDERS, QUINTIC, quintic_hermite
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.samples import Array, Index

_SHORTEST = 0.25  # of an equal interval
_UNEVEN = 0.5  # deviation of s in random motions
_SLOW = 2.0  # x holds s times this, so that steps in both s and positions move waypoints by about as much
_FEWEST = 64  # nodes per interval


@checked
class Waypoints(NonlinearFamily):
    """Quintic splines on free intervals.

    Parameters
    ----------
    period : float
        T [s].
    intervals : int
        Number of intervals m, at least 2.

    Raises
    ------
    InputError
        An invalid duration or number of intervals.
    """

    name = "waypoints"
    terms = "quintic splines on {intervals} intervals of free duration"
    options = ("intervals",)
    richness_option = "intervals"
    samples_per_term = 1

    def __init__(self, period: float, intervals: int) -> None:
        if intervals < 2:
            raise InputError(
                f"intervals: expected 2 or more, so that the motion can return to its start, given {intervals}"
            )
        check_size(period, 2, intervals=intervals)
        self.duration, self.intervals = float(period), int(intervals)
        self.size = 3 * intervals - 2
        self._least = _SHORTEST / intervals
        self._S = self._knot_states()

    def _knot_states(self) -> Array:
        """Position, velocity and acceleration at every knot, from coefficients in units of position."""
        m = self.intervals
        equal = self.duration / m
        S = np.zeros((m + 1, 3, self.size))
        S[np.arange(m), 0, np.arange(m)] = S[m, 0, 0] = 1.0
        inner = np.arange(1, m)
        for order in (1, 2):
            S[inner, order, order * (m - 1) + inner] = equal**-order
        return S.reshape(3 * (m + 1), self.size)

    @property
    def constant(self) -> Array:
        """All positions 1, all velocities and accelerations 0."""
        return np.repeat([1.0, 0.0], [self.intervals, 2 * (self.intervals - 1)])

    def shape(self, count: int, rng: np.random.Generator | None = None) -> Array:
        """Equal intervals, or random ones."""
        return np.zeros(self.intervals) if rng is None else rng.normal(0.0, _UNEVEN * _SLOW, self.intervals)

    def coordinates(self, x: Array) -> int:
        """Number of coordinates that x moves."""
        return (x.size - self.intervals) // self.size

    def durations(self, x: Array) -> Array:
        """Durations of the intervals [s]."""
        parts = self._parts(x)
        return np.asarray(self.duration * (self._least + (1.0 - self.intervals * self._least) * parts))

    def breaks(self, x: Array) -> Array:
        """Ends of the intervals."""
        return np.cumsum(self.durations(x))

    def _parts(self, x: Array) -> Array:
        s = x[-self.intervals :] / _SLOW
        weights = np.exp(s - s.max())
        return np.asarray(weights / weights.sum())

    def _slopes(self, x: Array) -> tuple[Array, Array]:
        """Derivatives of the intervals' durations and beginnings with respect to s, each (m, m)."""
        parts = self._parts(x)
        span = self.duration * (1.0 - self.intervals * self._least) / _SLOW
        lengths = span * (np.diag(parts) - np.outer(parts, parts))
        return lengths, np.cumsum(lengths, axis=0) - lengths

    def _places(self, x: Array, time: Array) -> tuple[Index, Array, Array]:
        """Interval of every instant, elapsed fraction of it, and its duration."""
        h = self.durations(x)
        begins = np.cumsum(h) - h
        interval = np.clip(np.searchsorted(begins, time, side="right") - 1, 0, self.intervals - 1)
        return interval, (time - begins[interval]) / h[interval], h[interval]

    def bases(self, x: Array, time: Array, derivative: int) -> Array:
        """One basis for all coordinates, shape (1, N, size)."""
        interval, u, h = self._places(x, time)
        knots = np.zeros((time.size, 3 * (self.intervals + 1)))
        columns = 3 * interval[:, None] + np.arange(6)
        np.put_along_axis(knots, columns, quintic_hermite(u, h, derivative), axis=1)
        return (knots @ self._S)[None]

    def shape_slopes(self, x: Array, time: Array, derivative: int) -> Array:
        """Derivative with respect to s at fixed instants, by longer and later intervals, shape (N, k, m)."""
        interval, u, h = self._places(x, time)
        states = self._states(x)
        at_ends = np.concatenate([states[:, interval], states[:, interval + 1]], axis=2)  # (k, N, 6)
        weights = quintic_hermite(u, h, derivative) * (ORDERS - derivative) / h[:, None]
        longer = np.einsum("kne,ne->nk", at_ends, weights)
        rate = np.einsum("kne,ne->nk", at_ends, quintic_hermite(u, h, derivative + 1))
        lengths, begins = self._slopes(x)
        drift = begins[interval] + u[:, None] * lengths[interval]
        return np.asarray(longer[:, :, None] * lengths[interval][:, None, :] - rate[:, :, None] * drift[:, None, :])

    def _states(self, x: Array) -> Array:
        """Position, velocity and acceleration of every coordinate at every knot, shape (k, m + 1, 3)."""
        linear, _ = self.split(x)
        return np.asarray((linear @ self._S.T).reshape(-1, self.intervals + 1, 3))

    def _count(self, count: int) -> int:
        return max(_FEWEST, -(-count // self.intervals))

    def nodes(self, x: Array, count: int) -> tuple[Array, Array]:
        """Zeros of a Chebyshev polynomial on every interval, with their derivatives."""
        h, u = self.durations(x), chebyshev_nodes(self._count(count), 0.0, 1.0)
        lengths, begins = self._slopes(x)
        time = (np.cumsum(h) - h)[:, None] + h[:, None] * u
        drift = begins[:, None, :] + u[:, None] * lengths[:, None, :]
        return time.ravel(), drift.reshape(-1, self.intervals)

    def grid_factor(self, count: int, derivative: int) -> float:
        """See `constraints.enclosure.chebyshev_nodes`, for the polynomial on one interval."""
        return node_factor(max(5 - derivative, 0), self._count(count))

    def combined_extrema(self, x: Array, matrix: Array, offset: Array, derivative: int) -> Extrema:
        """Extrema from the roots of the derivative on every interval."""
        h, states = self.durations(x), self._states(x)
        first, held = self._carrying(x)
        at_ends = np.concatenate([states[:, :-1], states[:, 1:]], axis=2)  # (k, m, 6)
        scaled = at_ends * h[:, None] ** ORDERS
        powers = np.einsum("kme,ep->pmk", scaled, QUINTIC) / h[:, None] ** np.arange(6)[:, None, None]
        pieces = np.polynomial.polynomial.polyder(powers, derivative, axis=0)[::-1] @ (matrix @ first).T
        if derivative == 0:
            pieces[-1] += matrix @ held + offset
        return piecewise_extrema(np.concatenate([[0.0], np.cumsum(h)]), pieces)

    def to_dict(self, x: Array) -> dict[str, object]:
        """Family, period, durations, and position, velocity and acceleration at every knot."""
        states = self._states(x)
        return {
            "family": self.name,
            "period": self.duration,
            "intervals": self.intervals,
            "form": "q = matrix y + rest; on each interval y is the polynomial of fifth order that has the given "
            "position, velocity and acceleration at both ends",
            **self.carrying(x),
            "durations": self.durations(x).tolist(),
            "position": states[:, :, 0].tolist(),
            "velocity": states[:, :, 1].tolist(),
            "acceleration": states[:, :, 2].tolist(),
        }

    def restored(self, series: Mapping[str, Any]) -> Array:
        """The x from the entries of `to_dict`."""
        m = self.intervals
        given = [np.array(series[part], dtype=float) for part in ("position", "velocity", "acceleration")]
        expected = (given[0].shape[0], m + 1)
        if any(part.shape != expected for part in given) or np.shape(series["durations"]) != (m,):
            raise InputError(f"trajectory: expected states at {m + 1} knots and {m} durations")
        knots = np.stack(given, axis=2).reshape(len(given[0]), -1)
        parts = np.array(series["durations"]) / self.duration - self._least
        if not np.all(parts > 0.0) or abs(parts.sum() - 1.0 + m * self._least) > 1e-9:
            raise InputError(
                f"trajectory: durations must add up to {self.duration:g} s, each at least "
                f"{self._least * self.duration:.3g} s"
            )
        shape = _SLOW * (np.log(parts) - np.log(parts).mean())
        return np.concatenate([(knots @ np.linalg.pinv(self._S).T).ravel(), shape])
