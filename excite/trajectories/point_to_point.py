"""Moves between poses in which the robot rests, quick and slow ones in turn.

On each of m equal intervals every joint moves from one pose to the next by a polynomial of fifth order, and rests there:
``q = p_k + (p_{k+1} - p_k) (10 u^3 - 15 u^4 + 6 u^5)`` with u the elapsed part of the move. Moves last 1/4, 1/2 and 3/4
of an interval, in turn. The poses are free, the last is the first. Servos that follow such commands show their delay and
inertia in the quick moves, friction in slow ones and near rest, and what gravity makes of their stiffness at rest.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

from constraints.certificate import Extrema
from constraints.enclosure import chebyshev_nodes, node_factor, piecewise_extrema
from excite.trajectories.family import check_size
from excite.trajectories.linear import LinearFamily
from regressors.arguments import checked
from regressors.samples import Array

_MOVES = (0.25, 0.75, 0.5)  # of an interval
_LAW = np.array([6.0, -15.0, 10.0, 0.0, 0.0, 0.0])  # from the highest power
_FEWEST = 48  # nodes per move


@checked
class PointToPoint(LinearFamily):
    """Moves of different durations between poses, with a rest after each.

    Parameters
    ----------
    period : float
        T [s].
    intervals : int
        Number m of moves, at least 3.

    Raises
    ------
    InputError
        An invalid duration or number of moves.
    """

    name = "point-to-point"
    options = ("intervals",)
    richness_option = "intervals"
    samples_per_term = 4
    parts = ("pose",)
    form = (
        "on each of the equal intervals a move from a pose to the next, of 1/4, 3/4, 1/2 of the interval in turn, by "
        "10 u^3 - 15 u^4 + 6 u^5, and rest"
    )

    def __init__(self, period: float, intervals: int) -> None:
        check_size(period, 3, intervals=intervals)
        self.duration, self.intervals, self.size = float(period), int(intervals), int(intervals)
        self._begins = np.arange(intervals) * self.duration / intervals
        self._lengths = np.resize(_MOVES, intervals) * self.duration / intervals
        self._Z = self._pose_basis()

    @property
    def richness(self) -> int:
        """Two for a move: the shortest are half a wave in a quarter of their interval."""
        return 2 * self.intervals

    @property
    def described(self) -> str:
        """Number of moves, as text."""
        return f"{self.intervals} moves between poses"

    def breaks(self, x: Array) -> Array:
        """Ends of moves and of rests."""
        return np.sort(np.concatenate([self._begins[1:], self._begins + self._lengths, [self.duration]]))

    def _pose_basis(self) -> Array:
        """Poses of a level and of moves that lead back, weighted such that equal coefficients mean equal velocities."""
        closed = scipy.linalg.null_space(self._lengths[None])  # (m, m - 1)
        poses = np.cumsum(np.vstack([np.zeros(closed.shape[1]), self._lengths[:-1, None] * closed[:-1]]), axis=0)
        return np.column_stack([np.ones(self.intervals), poses - poses.mean(axis=0)])

    @property
    def constant(self) -> Array:
        """Coefficients of the motion that rests at position 1."""
        return np.asarray(np.eye(1, self.size)[0])

    def basis(self, time: Array, derivative: int) -> Array:
        """Values of the free basis functions, shape (N, size)."""
        time = np.asarray(time, dtype=float)
        k = np.clip(np.searchsorted(self._begins, time, side="right") - 1, 0, self.intervals - 1)
        u = (time - self._begins[k]) / self._lengths[k]
        moving = u < 1.0
        law = np.polyval(np.polyder(_LAW, derivative), np.minimum(u, 1.0)) / self._lengths[k] ** derivative
        share = np.where(moving, law, 1.0 if derivative == 0 else 0.0)[:, None]
        before, after = self._Z[k], self._Z[(k + 1) % self.intervals]
        return np.asarray((before if derivative == 0 else 0.0) + share * (after - before))

    def _nodes(self, count: int) -> int:
        return max(_FEWEST, -(-count // self.intervals))

    def grid(self, count: int) -> Array:
        """Zeros of a Chebyshev polynomial on every move, which begins and ends at the rests beside it."""
        nodes = chebyshev_nodes(self._nodes(count), 0.0, 1.0)
        return np.asarray((self._begins[:, None] + self._lengths[:, None] * nodes).ravel())

    def grid_factor(self, count: int, derivative: int) -> float:
        """See `constraints.enclosure.chebyshev_nodes`, for the polynomial of one move."""
        return node_factor(max(5 - derivative, 0), self._nodes(count))

    def extrema(self, x: Array, derivative: int) -> Extrema:
        """Extrema from the roots of the derivative on every move."""
        poses = self.coefficients(x)  # (k, m)
        steps = np.roll(poses, -1, axis=1) - poses
        law = np.polyder(_LAW, derivative)[:, None] / self._lengths ** np.arange(5, derivative - 1, -1)[:, None]
        pieces = law[:, :, None] * steps.T[None]
        if derivative == 0:
            pieces[-1] += poses.T
        breaks, coefficients = self._with_rests(pieces, poses if derivative == 0 else 0.0 * poses)
        return piecewise_extrema(breaks, coefficients)

    def _with_rests(self, pieces: Array, poses: Array) -> tuple[Array, Array]:
        """Ends of moves and rests, and polynomials between them."""
        whole = np.zeros((len(pieces), 2 * self.intervals, pieces.shape[2]))
        whole[:, ::2] = pieces
        whole[-1, 1::2] = np.roll(poses, -1, axis=1).T
        return np.concatenate([[0.0], self.breaks(poses)]), whole
