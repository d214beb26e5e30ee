"""A design problem as solvers see it: a smooth objective and its gradient, and linear limits on a grid.

The limits on the grid are tightened by the family's factor, so that what holds on the grid holds at all times.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from constraints.linear import LinearConstraint
from excite.design.grid_limits import CurvedLimit
from excite.information.criteria import Criterion
from excite.information.matrix import Evaluation, Information
from excite.trajectories.family import Family, LinearFamily
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
    family : Family
        A linear one; `excite.design.nonlinear_problem` has the problem of the others.
    limits : sequence of LinearConstraint
    centre : ndarray, shape (n,)
        A pose of the moving coordinates strictly inside the position limits.
    grid : int
        Number of instants at which the limits are imposed.
    start : tuple of str
        Shapes of motion to start from, see `excite.design.initial_guesses`.
    nonlinear : tuple of CurvedLimit
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
        family: Family,
        limits: tuple[LinearConstraint, ...],
        centre: Array,
        grid: int = 512,
        exact: Callable[[Array], Array] | None = None,
        start: tuple[str, ...] = ("random",),
        nonlinear: tuple[CurvedLimit, ...] = (),
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
        self.centre = centre
        self.rest = family.resting(centre)
        self.grid_limits, self.curved = self._imposed(grid)

    def _imposed(self, grid: int) -> tuple[tuple[GridLimit, ...], tuple[CurvedLimit, ...]]:
        """Limits that are linear in x, and those that are not."""
        assert isinstance(self.family, LinearFamily)
        family = self.family
        return tuple(GridLimit.of(limit, family, grid) for limit in self.limits), self.nonlinear

    @property
    def shape(self) -> tuple[int, int]:
        """Shape (n, size) of the coefficients in which motions are linear."""
        return len(self.centre), self.family.size

    def resting(self, rng: np.random.Generator) -> Array:
        """Rest in the centre, to be moved away from."""
        return self.rest.copy()

    def direction(self, joint: int, coefficients: Array) -> Array:
        """The direction in which one coordinate's coefficients grow by given ones."""
        found = np.zeros(self.shape)
        found[joint] = coefficients
        return found

    def drawn(self, x: Array, part: float) -> Array:
        """The motion drawn towards the centre, to a part of its distance from it."""
        return np.asarray(self.rest + part * (x - self.rest))

    def reach(self, x: Array) -> float:
        """Largest part to which a motion can be `drawn` within the limits that are linear in it."""
        return self.longest_step(self.rest, x - self.rest)

    def first_length(self, x: Array, direction: Array) -> float:
        """Part of a step, at most 1, that a line search begins with: no longer than the grid limits allow."""
        return min(1.0, self.longest_step(x, direction))

    def inside(self, x: Array) -> Array:
        """The motion itself, where no step within the grid limits can leave them."""
        return x

    def enlarged(self, wanted: Array, part: float, unbounded: float) -> Array:
        """A motion about zero put about the centre, as large as a part of what the limits allow.

        Parameters
        ----------
        wanted : ndarray
            Its x.
        part : float
        unbounded : float
            What counts as allowed where no limit bounds it.
        """
        step = self.longest_step(self.rest, wanted)
        reach = part * (step if np.isfinite(step) else unbounded)
        return np.asarray(self.rest + reach * wanted)

    def matrix(self, M: Array) -> Array:
        """The information matrix M with prior knowledge in the wanted convention."""
        return np.asarray(self.transform.T @ (M + self.prior) @ self.transform)

    def point(self, x: Array, sharpness: float) -> Point:
        """Smooth objective at x."""
        at = self.information.evaluate(x)
        value, G = self.criterion.smooth(self.matrix(self.unit**2 * at.M), sharpness)
        return Point(value, self.unit**2 * self.transform @ G @ self.transform.T, at)

    def gradient(self, point: Point) -> Array:
        """Gradient of the smooth objective at a point, of the shape of x."""
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
