"""A design problem as solvers see it: a smooth objective and its gradient, and linear limits on a grid.

The limits on the grid are tightened by the family's factor, so that what holds on the grid holds at all times.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from constraints.linear import LinearConstraint
from excite.criteria import Criterion
from excite.information import Evaluation, Information
from excite.nonlinear_grid import NonlinearGrid
from excite.trajectories.family import LinearFamily
from regressors.samples import Array, Index


@dataclass(frozen=True, eq=False)
class GridLimit:
    """One linear constraint on the grid: ``lower <= (A x) B' <= upper`` for each of k functions at N instants.

    Parameters
    ----------
    matrix : ndarray, shape (k, n)
        ``A``.
    basis : ndarray, shape (N, size)
        ``B``, the derivative of the basis that is limited.
    lower, upper : ndarray, shape (k,)
        Tightened bounds, less the constraint's offset.
    """

    matrix: Array
    basis: Array
    lower: Array
    upper: Array

    @classmethod
    def of(cls, constraint: LinearConstraint, family: LinearFamily, count: int) -> GridLimit:
        """Constraint on ``count`` equal steps of a family's duration."""
        middle = 0.5 * (constraint.lower + constraint.upper)
        half = 0.5 * (constraint.upper - constraint.lower) * family.grid_factor(count, constraint.derivative)
        basis = family.basis(family.grid(count), constraint.derivative)
        centre = middle - constraint.offset
        return cls(constraint.matrix, basis, centre - half, centre + half)

    def values(self, x: Array) -> Array:
        """Values of the k functions at the N instants, shape (k, N)."""
        return np.asarray((self.matrix @ x) @ self.basis.T)

    def rows(self, function: Index, instant: Index) -> Array:
        """Jacobian rows with respect to the flat x, shape (len(function), n * size)."""
        rows = self.matrix[function][:, :, None] * self.basis[instant][:, None, :]
        return np.asarray(rows.reshape(function.size, self.matrix.shape[1] * self.basis.shape[1]))


@dataclass(frozen=True, eq=False)
class Point:
    """The objective at one x.

    Parameters
    ----------
    value : float
        Smooth objective.
    G : ndarray
        Its gradient with respect to the information matrix.
    evaluation : Evaluation
    """

    value: float
    G: Array
    evaluation: Evaluation


class Problem:
    """Minimise a criterion of the information matrix over a family's coefficients, within linear limits.

    Parameters
    ----------
    information : Information
        M(x) in the reference base columns.
    transform : ndarray, shape (b, b)
        ``T`` with M of the wanted convention ``T' M T``.
    criterion : Criterion
    family : LinearFamily
    limits : sequence of LinearConstraint
    centre : ndarray, shape (n,)
        A pose of the moving coordinates strictly inside the position limits.
    grid : int
        Number of instants at which the limits are imposed.
    start : tuple of str
        Shapes of motion to start from, see `excite.starts`.
    nonlinear : tuple of NonlinearGrid
        Limits that are not linear in the motion.
    initial : ndarray, shape (N, n), optional
        Positions of a motion to begin with, at equal steps from 0 to the duration [rad or m].
    exact : callable, optional
        M(x) as results report it, without what was softened for the optimiser; the same if not given.
    prior : ndarray, shape (b, b), optional
        What is added to M before it is brought to the wanted convention: prior knowledge per instant.
    unit : float
        Rows of results are those of the information times so much.
    """

    def __init__(
        self,
        information: Information,
        transform: Array,
        criterion: Criterion,
        family: LinearFamily,
        limits: tuple[LinearConstraint, ...],
        centre: Array,
        grid: int = 512,
        exact: Callable[[Array], Array] | None = None,
        start: tuple[str, ...] = ("random",),
        nonlinear: tuple[NonlinearGrid, ...] = (),
        initial: Array | None = None,
        prior: Array | None = None,
        unit: float = 1.0,
    ) -> None:
        self.information = information
        self.exact = exact if exact is not None else lambda x: information.evaluate(x).M
        self.transform = transform
        self.prior = np.zeros(2 * (transform.shape[0],)) if prior is None else prior
        self.unit = unit
        self.criterion = criterion
        self.family = family
        self.start = start
        self.nonlinear = nonlinear
        self.initial = initial
        self.limits = limits
        self.grid_limits = tuple(GridLimit.of(limit, family, grid) for limit in limits)
        self.rest = np.outer(centre, family.constant)

    @property
    def shape(self) -> tuple[int, int]:
        """Shape (n, size) of the coefficients."""
        return int(self.rest.shape[0]), int(self.rest.shape[1])

    def matrix(self, M: Array) -> Array:
        """The information matrix M with prior knowledge in the wanted convention."""
        return np.asarray(self.transform.T @ (M + self.prior) @ self.transform)

    def point(self, x: Array, sharpness: float) -> Point:
        """Smooth objective at x, shape (n, size)."""
        at = self.information.evaluate(x)
        value, G = self.criterion.smooth(self.matrix(self.unit**2 * at.M), sharpness)
        return Point(value, self.unit**2 * self.transform @ G @ self.transform.T, at)

    def gradient(self, point: Point) -> Array:
        """Gradient of the smooth objective at a point, shape (n, size)."""
        return self.information.gradient(point.evaluation, point.G)

    def criterion_value(self, point: Point) -> float:
        """The criterion itself at a point."""
        return self.criterion.value(self.matrix(self.unit**2 * point.evaluation.M))

    def exact_value(self, x: Array) -> float:
        """The criterion at x as results report it."""
        return self.criterion.value(self.matrix(self.exact(x)))

    def longest_step(self, x: Array, direction: Array) -> float:
        """Largest s >= 0 for which x + s direction stays within the grid limits; x must be inside."""
        step = np.inf
        for limit in self.grid_limits:
            value, slope = limit.values(x), limit.values(direction)
            room = np.where(slope > 0, limit.upper[:, None] - value, limit.lower[:, None] - value)
            ratio = np.divide(room, slope, out=np.full_like(room, np.inf), where=slope != 0)
            step = min(step, float(ratio.min(initial=np.inf)))
        return max(step, 0.0)

    def nonlinear_hold(self, x: Array) -> bool:
        """True if every nonlinear limit holds on its grid."""
        return all(limit.holds(x) for limit in self.nonlinear)

    def violation(self, x: Array) -> float:
        """Largest excess over a grid limit, as part of half its range; <= 0 inside."""
        worst = -np.inf
        for limit in self.grid_limits:
            value, half = limit.values(x), 0.5 * (limit.upper - limit.lower)[:, None]
            excess = np.maximum(value - limit.upper[:, None], limit.lower[:, None] - value) / half
            worst = max(worst, float(excess.max(initial=-np.inf)))
        return worst
