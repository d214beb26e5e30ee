"""Objective of a design as a function of x: a criterion of the information matrix in the chosen convention."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from excite.information.criteria import Criterion
from excite.information.matrix import Evaluation, Information
from regressors.samples import Array


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
    prior: Array | float = 0.0  # (b, b) ``P``, prior knowledge per instant, added to M before the transform
    unit: float = 1.0  # factor from the rows of the information to those of results
    # M(x) as results report it, without smoothing for the optimiser; the same if not given
    exact: Callable[[Array], Array] | None = None

    @cached_property
    def _same_columns(self) -> bool:
        return np.array_equal(self.transform, np.eye(len(self.transform)))

    def matrix(self, M: Array) -> Array:
        """The information matrix M with prior knowledge in the chosen convention."""
        M = M + self.prior
        return M if self._same_columns else np.asarray(self.transform.T @ M @ self.transform)

    def exact_matrix(self, x: Array) -> Array:
        """M(x) as results report it, shape (b, b)."""
        return self.information.evaluate(x).M if self.exact is None else self.exact(x)

    def points(self, xs: Sequence[Array], sharpness: Sequence[float]) -> list[ObjectivePoint]:
        """Smooth objective at several x; the same as one by one."""
        evaluations = self.information.evaluations(xs)
        matrices = [self.matrix(self.unit**2 * at.M) for at in evaluations]
        smooth = self.criterion.smooth_and_values(matrices, sharpness)
        return [
            ObjectivePoint(value, self.unit**2 * self._back(G), at, criterion)
            for at, (value, G, criterion) in zip(evaluations, smooth, strict=True)
        ]

    def gradients(self, points: Sequence[ObjectivePoint]) -> list[Array]:
        """Gradients of the smooth objective at several points, each of the shape of x."""
        return self.information.gradients([point.evaluation for point in points], [point.G for point in points])

    def _back(self, G: Array) -> Array:
        return G if self._same_columns else np.asarray(self.transform @ G @ self.transform.T)

    def criterion_value(self, point: ObjectivePoint) -> float:
        """The criterion itself at a point."""
        return point.criterion

    def exact_value(self, x: Array) -> float:
        """The criterion at x as results report it."""
        return self.criterion.value(self.matrix(self.exact_matrix(x)))
