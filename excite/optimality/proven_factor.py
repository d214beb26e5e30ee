"""A factor that holds for all states, with a proof: positions by a grid, velocities and accelerations by polynomials.

In a cell of the grid ``Q(p)`` is the interpolation between the cell's corners, a convex combination, to within
``sum_i w_i^2 / 8 max |d2Q / dp_i2|``. So certificates at the corners, with that error added, prove the whole cell.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from excite.optimality.cutting_planes import DualCertificate
from excite.optimality.limited_states import LimitedStates
from excite.optimality.sum_of_squares import NotPolynomial, SignPattern, SumOfSquares
from regressors.samples import Array, Index

_MOST_COORDINATES, _MOST_POSITIONS = 3, 2
_CELLS = 18  # along each position; finer towards its limits, where velocities are low
_MOST_CERTIFICATES = 4000
_LOWEST = 1e-3  # of the highest velocity, where none is possible


@dataclass(frozen=True, eq=False)
class _Grid:
    """Corners of cells, shape (N, c) in positions that count, and what holds in all cells around each."""

    corners: Array  # (N, c)
    widths: Array  # (N, c) largest width of the cells around, along the axes
    highest: Array  # (N, k) highest velocities around, as parts of their limits
    axes: Array  # (c, c) the steps of the positions along each axis, in its columns


@dataclass(frozen=True, eq=False)
class ProvenFactor:
    """Proof of the dual inequality for all states of a problem of few coordinates."""

    certificate: DualCertificate
    states: LimitedStates

    def run(self, guess: float, seed: int, tell: Callable[[str], None]) -> float | None:
        """Factor that is proven for all states; None where this problem is not of the kind that can be proven."""
        chosen = self._functions()
        if chosen is None:
            return None
        functions, positions = chosen
        grid = self._grid(functions, positions)
        patterns = list(product((1.0, -1.0), repeat=functions.size))
        if len(grid.corners) * len(patterns) > _MOST_CERTIFICATES:
            return None
        largest = 0.0
        for number, signs in enumerate(patterns):
            tell(f"proof: {number} of {len(patterns)} sign patterns of the velocities")
            pattern = SignPattern(self.certificate, self.states, functions, np.array(signs))
            try:
                largest = max(largest, self._of_pattern(pattern, grid, 2.0 * guess, seed))
            except NotPolynomial:
                return None
        return largest if largest <= 2.0 * guess else None

    def _functions(self) -> tuple[Index, Index] | None:
        """The limited functions that serve as coordinates, and those of them with positions; None without as many."""
        states, counted = self.states, self.certificate.conditions.counted
        (functions,) = np.nonzero(states.speeds & np.isfinite(states.acceleration))
        k = states.n
        if k > _MOST_COORDINATES or functions.size != k or int(counted.sum()) > _MOST_POSITIONS:
            return None
        if np.any(self.certificate.rows.positions_that_count() & ~counted):
            return None
        if np.linalg.matrix_rank(states.directions[functions]) < k:
            return None
        of_counted = ~np.any(states.directions[:, ~counted] != 0.0, axis=1) & np.isfinite(states.radius)
        positions = functions[of_counted[functions]]
        return (functions, positions) if positions.size == int(counted.sum()) else None

    def _of_pattern(self, pattern: SignPattern, grid: _Grid, most: float, seed: int) -> float:
        rng = np.random.default_rng(seed)
        of_Q, of_D = pattern.curvature(grid.axes, rng)
        # |m' E m| <= sum_i e_i m_i^2 with e the sums of rows, since E is symmetric
        errors = np.einsum("na,aij->ni", grid.widths**2 / 8, of_Q + most * of_D)
        lower, upper, of_h = pattern.matrices(grid.corners, rng)
        V, A = (each[pattern.functions] for each in (self.states.velocity, self.states.acceleration))
        bandwidth = self.states.bandwidth
        linked = np.full(V.size, np.inf) if bandwidth is None else (bandwidth * V / A) ** 2
        certificates = SumOfSquares(pattern.signs, linked)
        largest = 0.0
        for Q, D, error, fastest in zip(lower + of_h, upper, errors, grid.highest, strict=True):
            largest = max(largest, certificates.factor(Q + np.diag(error), D, fastest))
            if largest > most:
                break
        return largest

    def _grid(self, functions: Index, positions: Index) -> _Grid:
        """Corners of all cells that hold positions within the limits."""
        states, counted = self.states, self.certificate.conditions.counted
        axes = [states.middle[i] - states.radius[i] * np.cos(np.linspace(0.0, np.pi, _CELLS + 1)) for i in positions]
        if not axes:
            return _Grid(np.zeros((1, 0)), np.zeros((1, 0)), np.ones((1, functions.size)), np.zeros((0, 0)))
        beside = [np.maximum(*(np.pad(np.diff(axis), ends) for ends in ((0, 1), (1, 0)))) for axis in axes]
        z = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
        widths = np.stack(np.meshgrid(*beside, indexing="ij"), axis=-1).reshape(-1, len(axes))
        inverse = np.asarray(np.linalg.inv(states.directions[positions][:, counted]), dtype=float)
        known = np.isfinite(states.radius) & ~np.any(states.directions[:, ~counted] != 0.0, axis=1)
        of_z = states.directions[:, counted] @ inverse
        distance = np.abs(z @ of_z.T - states.middle) - widths @ np.abs(of_z).T
        nearest = np.maximum(distance, 0.0) / states.radius
        inside = np.all(nearest[:, known] <= 1.0, axis=1)
        highest = self._highest(nearest[inside], known, functions)
        return _Grid((z @ inverse.T)[inside], widths[inside], highest, inverse)

    def _highest(self, nearest: Array, known: NDArray[np.bool_], functions: Index) -> Array:
        """``|dz| / V`` that is possible at a fraction ``nearest`` of the positions' range from its middle."""
        states = self.states
        highest = np.ones((len(nearest), functions.size))
        if states.bandwidth is None:
            return highest
        for column, index in enumerate(functions):
            if known[index]:
                possible = states.bandwidth * states.radius[index] / states.velocity[index]
                highest[:, column] = np.minimum(1.0, possible * np.sqrt(np.maximum(1.0 - nearest[:, index] ** 2, 0.0)))
        return np.maximum(highest, _LOWEST)
