"""Uniform B-splines, at rest at both ends at the same pose.

``q(t) = sum_i c_i B_i(t)`` of degree 3 to 5 on equal intervals of [0, T] with clamped ends. ``dq = ddq = 0`` at an end
where the three control points next to it are equal, and ``q(0) = q(T)`` where those of both ends are.
"""

from __future__ import annotations

import numpy as np
import scipy

from constraints.certificate import Extrema
from constraints.enclosure import chebyshev_nodes, node_factor, piecewise_extrema
from excite.trajectories.family import check_size
from excite.trajectories.linear import LinearFamily
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.samples import Array

ORDERS = (4, 5, 6)
_FEWEST = 96  # nodes per interval


@checked
class BSpline(LinearFamily):
    """B-splines of some order on equal intervals.

    Parameters
    ----------
    period : float
        T [s].
    intervals : int
        Number of equal intervals, at least 3.
    order : int
        4 (cubic, acceleration continuous) to 6 (quintic, jerk and its slope continuous).

    Raises
    ------
    InputError
        An invalid duration, number of intervals or order.
    """

    name = "bspline"
    terms = "B-splines of order {order} on {intervals} intervals"
    options = ("intervals", "order")
    richness_option = "intervals"
    samples_per_term = 1
    parts = ("control",)
    form = "q(t) = sum_i control_i B_i(t), clamped B-splines on equal intervals of [0, period]"

    def __init__(self, period: float, intervals: int, order: int = 6) -> None:
        if order not in ORDERS:
            raise InputError(f"order of the spline must be one of {', '.join(map(str, ORDERS))}, given {order}")
        check_size(period, 3, intervals=intervals)
        self.duration, self.intervals, self.order = float(period), int(intervals), int(order)
        self.knots = np.concatenate(
            [np.zeros(order - 1), np.linspace(0.0, self.duration, intervals + 1), np.full(order - 1, self.duration)]
        )
        self._control = intervals + order - 1
        self.size = self._control - 5
        self._Z = self._rest_basis()

    @property
    def richness(self) -> int:
        """Half the number of intervals: a rise and a fall per harmonic."""
        return -(-self.intervals // 2)

    def breaks(self, x: Array) -> Array:
        """Ends of the intervals."""
        return np.linspace(0.0, self.duration, self.intervals + 1)

    def _rest_basis(self) -> Array:
        """Control points of motions at rest at both ends, shape (control points, size)."""
        Z = np.zeros((self._control, self.size))
        Z[:3, 0] = Z[-3:, 0] = 1.0
        Z[3:-3, 1:] = np.eye(self.size - 1)
        return Z

    def _spline(self, x: Array, derivative: int) -> scipy.interpolate.BSpline:
        spline = scipy.interpolate.BSpline(self.knots, (x @ self._Z.T).T, self.order - 1)
        return spline.derivative(derivative) if derivative else spline

    def basis(self, time: Array, derivative: int) -> Array:
        """Values of the free basis functions, shape (N, size)."""
        return np.asarray(self._spline(np.eye(self.size), derivative)(np.asarray(time, dtype=float)))

    @property
    def constant(self) -> Array:
        """Coefficients of the motion that rests at position 1."""
        return np.ones(self.size)

    def _nodes(self, count: int) -> int:
        return max(_FEWEST, -(-count // self.intervals))

    def grid(self, count: int) -> Array:
        """Zeros of a Chebyshev polynomial on every interval."""
        ends = np.linspace(0.0, self.duration, self.intervals + 1)
        nodes = chebyshev_nodes(self._nodes(count), 0.0, ends[1])
        return np.asarray((ends[:-1, None] + nodes).ravel())

    def grid_factor(self, count: int, derivative: int) -> float:
        """See `constraints.enclosure.chebyshev_nodes`, for the polynomial on one interval."""
        return node_factor(max(self.order - 1 - derivative, 0), self._nodes(count))

    def extrema(self, x: Array, derivative: int) -> Extrema:
        """Extrema from the roots of the derivative on every interval."""
        spline = self._spline(x, derivative)
        pieces = [scipy.interpolate.PPoly.from_spline((spline.t, column, spline.k)) for column in spline.c.T]
        inside = np.flatnonzero(np.diff(pieces[0].x) > 0)
        breaks = np.append(pieces[0].x[inside], self.duration)
        return piecewise_extrema(breaks, np.stack([piece.c[:, inside] for piece in pieces], axis=2))
