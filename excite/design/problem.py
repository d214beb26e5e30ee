"""A design problem for solvers: a smooth objective with its gradient, limits on a grid, and an initial guess.

Every family is linear in its coefficients for a given shape, so that a motion can be scaled towards rest in the middle
of the limits until it keeps those that are linear in it. Where all of x are coefficients, a step within the limits'
rows stays feasible by itself; elsewhere the result is scaled into the limits whatever the curvature of the step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from excite.design.grid_limits import GridLimits
from excite.information.matrix import Evaluation, Information
from excite.tasks.criteria import Criterion
from excite.trajectories.family import Family
from regressors.samples import Array

_WITHIN = 1.0 - 1e-9  # of what the limits allow, against rounding
# seconds of an evaluation; by instructions of the regressor; by the root of those of limits, of which few are near; by
# limits that motions may come to break; by joints that follow others, for whose positions the loops are solved; by
# joints beyond those of an arm, since programmes grow
_CALL, _OF_REGRESSOR, _OF_LIMITS, _OF_STATED, _OF_FOLLOWING, _OF_JOINTS = 4.2e-4, 8.4e-7, 3.36e-5, 5.6e-5, 2e-3, 1.2e-3
_ARM = 7  # joints


@dataclass(frozen=True, eq=False)
class Problem:
    """Minimise an objective over the x of a family, within limits."""

    family: Family  # family of the moving coordinates
    objective: SmoothObjective
    limits: GridLimits
    centre: Array  # (n,) a pose of the moving coordinates strictly inside the position limits [rad or m]
    # of the initial motion, see `excite.design.initial_guesses`: ``random``, or one for all coordinates, or one each
    shapes: tuple[str, ...] = ("random",)
    # (N, n) positions of an initial motion, at equal steps from 0 to the duration [rad or m]
    initial: Array | None = None

    @property
    def information(self) -> Information:
        """M(x) in the reference base columns."""
        return self.objective.information

    @property
    def criterion(self) -> Criterion:
        """Criterion of M that the objective smooths."""
        return self.objective.criterion

    def point(self, x: Array, sharpness: float) -> ObjectivePoint:
        """Smooth objective at x."""
        return self.points([x], [sharpness])[0]

    def points(self, xs: Sequence[Array], sharpness: Sequence[float]) -> list[ObjectivePoint]:
        """Smooth objective at several x, each with a sharpness of its own; the same as one by one."""
        return self.objective.points(xs, sharpness)

    def gradient(self, point: ObjectivePoint) -> Array:
        """Gradient of the smooth objective at a point, of the shape of x."""
        return self.gradients([point])[0]

    def gradients(self, points: Sequence[ObjectivePoint]) -> list[Array]:
        """Gradients at several points; the same as one by one."""
        return self.information.gradients([point.evaluation for point in points], [point.G for point in points])

    def criterion_value(self, point: ObjectivePoint) -> float:
        """The criterion itself at a point."""
        return point.criterion

    def exact_value(self, x: Array) -> float:
        """The criterion at x as results report it."""
        return self.criterion.value(self.objective.matrix(self.objective.exact_matrix(x)))

    @property
    def shape(self) -> tuple[int, int]:
        """Shape (n, size) of the coefficients in which motions are linear."""
        return len(self.centre), self.family.size

    @property
    def seconds(self) -> float:
        """Typical processor time of an evaluation, with its step, by the size of the equations; right within two."""
        return (
            _CALL
            + _OF_REGRESSOR * self.information.instructions
            + _OF_LIMITS * float(np.sqrt(self.limits.instructions))
            + _OF_STATED * len(self.limits.stated)
            + _OF_FOLLOWING * self.information.following
            + _OF_JOINTS * max(len(self.centre) + self.information.following - _ARM, 0)
        )

    @cached_property
    def rest(self) -> Array:
        """The x of rest in the centre pose."""
        return self.family.resting(self.centre)

    @cached_property
    def _at_rest(self) -> list[Array]:
        return self.limits.linear_values(self.rest)

    def longest_step(self, x: Array, step: Array) -> float:
        """Largest s >= 0 for which x + s step stays within the linear limits; x must, and its shape not change."""
        return self.limits.largest_part(self.limits.linear_values(x), step, x + step)

    def nonlinear_hold(self, x: Array) -> bool:
        """True if every nonlinear limit holds on the grid."""
        return all(limit.holds(x) for limit in self.limits.together)

    def with_broken(self, x: Array) -> Problem:
        """The problem with the limits that hold by default, but not for this x; itself if there are none."""
        limits = self.limits.with_broken(x)
        return self if limits is self.limits else replace(self, limits=limits)

    def with_near(self, motions: Sequence[Array]) -> Problem:
        """The problem with the limits that hold by default, and that some motions use almost whole."""
        limits = self.limits.with_near(motions)
        return self if limits is self.limits else replace(self, limits=limits)

    def violation(self, x: Array) -> float:
        """Largest excess over a linear limit, relative to half its range; <= 0 inside."""
        return max((limit.excess(limit.values(x)) for limit in self.limits.linear), default=-np.inf)

    def drawn(self, x: Array, part: float) -> Array:
        """The motion scaled towards the centre, to a fraction of its distance from it at every instant."""
        return self.family.drawn(x, self.centre, part)

    def reach(self, x: Array) -> float:
        """Largest fraction to which a motion can be scaled, see `drawn`, within the limits that are linear in it."""
        return self.limits.largest_part(self._at_rest, x - self.rest, x)

    def enlarged(self, wanted: Array, part: float, unbounded: float) -> Array:
        """A motion about zero, moved to the centre and scaled to a part of what the limits allow, if they bound it."""
        end = self.family.moved(wanted, self.centre)
        reach = self.limits.largest_part(self._at_rest, wanted, end)
        part *= reach if np.isfinite(reach) else unbounded
        return np.asarray(self.rest + part * wanted) if self.family.linear else self.drawn(end, part)

    def inside(self, x: Array) -> Array:
        """The motion, scaled towards the centre as far as the linear limits require."""
        if self.family.linear:  # a step within the limits' rows cannot leave the limits
            return x
        reach = self.reach(x)
        return x if reach >= 1.0 else self.drawn(x, _WITHIN * reach)


@dataclass(frozen=True, eq=False)
class ObjectivePoint:
    """The objective at one x."""

    value: float  # smooth objective
    G: Array  # gradient of the objective with respect to the information matrix
    evaluation: Evaluation
    criterion: float  # the criterion itself


@dataclass(frozen=True, eq=False)
class SmoothObjective:
    """``f(T' (unit^2 M(x) + P) T)`` for a criterion f."""

    information: Information  # M(x) in the reference base columns
    transform: Array  # (b, b) ``T``; in the chosen convention M is ``T' M T``
    criterion: Criterion
    prior: Array | float  # (b, b) ``P``, prior knowledge per instant, added to M before the transform
    unit: float  # factor from the rows of the information to those of results
    exact_matrix: Callable[[Array], Array]  # M(x) as results report it, (b, b), without smoothing for the optimiser

    @cached_property
    def _same_columns(self) -> bool:
        return np.array_equal(self.transform, np.eye(len(self.transform)))

    def matrix(self, M: Array) -> Array:
        """The information matrix M with prior knowledge in the chosen convention."""
        M = M + self.prior
        return M if self._same_columns else np.asarray(self.transform.T @ M @ self.transform)

    def points(self, xs: Sequence[Array], sharpness: Sequence[float]) -> list[ObjectivePoint]:
        """Smooth objective at several x; the same as one by one."""
        evaluations = self.information.evaluations(xs)
        matrices, T = (self.matrix(self.unit**2 * at.M) for at in evaluations), self.transform
        smooth = [self.criterion.smooth_and_value(M, p) for M, p in zip(matrices, sharpness, strict=True)]
        return [
            ObjectivePoint(value, self.unit**2 * (G if self._same_columns else T @ G @ T.T), at, criterion)
            for at, (value, G, criterion) in zip(evaluations, smooth, strict=True)
        ]
