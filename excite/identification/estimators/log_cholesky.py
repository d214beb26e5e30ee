"""Physically possible parameters without constraints: log-Cholesky coordinates of each pseudo-inertia.

``J = T U U' T'`` with U upper triangular, the logarithms of its diagonal and its other entries free, reaches every
positive definite J and no other [Rucker, Wensing 2022]. T is the factor of a reference, ``J0 = T T'``; then the
entropic divergence from the reference is a sum of squares as well:
``tr(J0^-1 J) - log det(J0^-1 J) - 4 = sum_{i<j} U_ij^2 + sum_i (U_ii^2 - 1 - 2 log U_ii)``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.optimize

from excite.identification.estimate import Estimate
from excite.identification.estimators.possible_set import possible_estimate
from excite.identification.estimators.standard import Body, Entropic, Pull, Quadratic, StandardProblem, standard_problem
from excite.identification.observations import Observations
from excite.identification.weights import weighting
from regressors.errors import InputError
from regressors.models.base import Base
from regressors.models.model import RegressorModel
from regressors.robot.inertia import from_pseudo_inertia, pseudo_inertia
from regressors.samples import Array

_UPPER = [(i, j) for i in range(4) for j in range(i + 1, 4)]
_TOLERANCE = 1e-12
_EVALUATIONS = 500
_STRUCTURE = 1e5  # weight of structural zeros and equalities, which enter as residuals


def log_cholesky(
    observations: Observations,
    model: RegressorModel,
    base: Base,
    *,
    pull: Pull | None = None,
    reference: Mapping[str, float] | None = None,
) -> Estimate:
    """Solve the problem of `physical` in coordinates that only reach possible parameters.

    Solved by the Gauss-Newton method in a trust region, with the exact Jacobian. An optimum with a singular
    pseudo-inertia is approached, not reached.
    """
    problem = weighting(observations)
    quadratic = pull if isinstance(pull, Quadratic) else None
    standard = standard_problem(observations, problem, model, base, quadratic, reference)
    charts = _charts(standard, pull if isinstance(pull, Entropic) else None)
    coordinates = _Coordinates(standard, charts)
    minimum = scipy.optimize.least_squares(
        coordinates.residual,
        np.zeros(coordinates.size),
        coordinates.jacobian,
        method="trf",  # logarithms and ratios have scale one, and a trust region keeps their exponentials small
        xtol=_TOLERANCE,
        ftol=_TOLERANCE,
        gtol=_TOLERANCE,
        max_nfev=_EVALUATIONS,
    )
    theta = coordinates.theta(minimum.x)
    theta = standard.S @ np.linalg.lstsq(standard.S, theta, rcond=None)[0]
    ended = "converged" if minimum.status > 0 else "stopped without convergence"
    note = f"{ended} after {minimum.nfev} evaluations in {coordinates.size} coordinates"
    return possible_estimate("log-cholesky", observations, problem, standard, theta, (note,))


@dataclass(frozen=True, eq=False)
class _Chart:
    """Coordinates of one body: four logarithms of the diagonal of U, then its upper entries."""

    body: Body
    T: Array
    weight: float  # of the entropic divergence from T T'

    def factor(self, xi: Array) -> Array:
        U = np.diag(np.exp(xi[:4]))
        for k, (i, j) in enumerate(_UPPER, 4):
            U[i, j] = xi[k]
        return U

    def theta(self, xi: Array) -> Array:
        half = self.T @ self.factor(xi)
        return from_pseudo_inertia(half @ half.T)

    def slope(self, xi: Array) -> Array:
        """Derivative of the ten parameters, shape (10, 10)."""
        half = self.T @ self.factor(xi)
        columns = []
        for k, (i, j) in enumerate([(i, i) for i in range(4)] + _UPPER):
            d = np.zeros((4, 4))
            d[:, j] = self.T[:, i] * (np.exp(xi[k]) if i == j else 1.0)
            columns.append(from_pseudo_inertia(d @ half.T + half @ d.T))
        return np.column_stack(columns)

    def divergence(self, xi: Array) -> Array:
        """Ten residuals, half of whose sum of squares is the weighted divergence."""
        x = xi[:4]
        excess = np.maximum(np.expm1(2 * x) - 2 * x, 0.0)
        return np.asarray(np.sqrt(2 * self.weight) * np.concatenate([np.sign(x) * np.sqrt(excess), xi[4:]]))

    def divergence_slope(self, xi: Array) -> Array:
        """Derivative of `divergence`, its diagonal, shape (10,)."""
        x = xi[:4]
        root = np.sqrt(np.maximum(np.expm1(2 * x) - 2 * x, 0.0))
        near = np.abs(x) < 1e-6  # the quotient tends to sqrt 2
        slope = np.where(near, np.sqrt(2.0), np.abs(np.expm1(2 * x)) / np.where(near, 1.0, root))
        return np.asarray(np.sqrt(2 * self.weight) * np.concatenate([slope, np.ones(6)]))


def _charts(standard: StandardProblem, pull: Entropic | None) -> tuple[_Chart, ...]:
    charts, pulled = [], 0
    for body in standard.bodies:
        J, weight = body.reference, 0.0
        names = [standard.names[k] for k in body.index]
        if pull is not None and all(name in pull.values for name in names):
            J, weight, pulled = pseudo_inertia([pull.values[name] for name in names]), pull.weight, pulled + 1
            if not (np.all(np.isfinite(J)) and np.linalg.eigvalsh(J)[0] > 0):
                raise InputError(f"pull: the parameters of {body.name} are not those of a possible body")
        charts.append(_Chart(body, _upper_factor(J), weight))
    if pull is not None and not pulled:
        raise InputError("pull: expected all ten parameters of at least one body, but none is complete")
    return tuple(charts)


def _upper_factor(J: Array) -> Array:
    """Upper triangular T with ``T T' = J``."""
    return np.asarray(scipy.linalg.cholesky(J[::-1, ::-1], lower=True)[::-1, ::-1])


class _Coordinates:
    """All parameters in free coordinates: bodies by their charts, positive ones by logarithms, the rest as they are."""

    def __init__(self, standard: StandardProblem, charts: tuple[_Chart, ...]) -> None:
        self.standard, self.charts = standard, charts
        in_bodies = np.concatenate([np.zeros(0, dtype=np.intp), *(chart.body.index for chart in charts)])
        self.rest = np.setdiff1d(np.arange(len(standard.names)), in_bodies)
        self.logarithmic = np.isin(self.rest, standard.positive)
        self.size = 10 * len(charts) + self.rest.size
        S = standard.S
        broken = (np.eye(len(S)) - S @ np.linalg.pinv(S)) / standard.scale[:, None]
        weak = np.diag(1 / standard.deviation)
        self.matrix = np.concatenate([standard.G, weak, _STRUCTURE * broken[np.any(broken != 0, axis=1)]])
        self.right = np.zeros(len(self.matrix))
        self.right[: standard.r.size] = standard.r
        self.right[standard.r.size :][: len(S)] = standard.prior / standard.deviation

    def theta(self, xi: Array) -> Array:
        """Standard parameters, shape (t,)."""
        theta = np.empty(len(self.standard.names))
        for chart, part in zip(self.charts, self._parts(xi), strict=True):
            theta[chart.body.index] = chart.theta(part)
        free = xi[10 * len(self.charts) :]
        theta[self.rest] = self.standard.scale[self.rest] * np.where(self.logarithmic, np.exp(free), free)
        return theta

    def residual(self, xi: Array) -> Array:
        divergences = [c.divergence(part) for c, part in zip(self.charts, self._parts(xi), strict=True) if c.weight]
        return np.concatenate([self.matrix @ self.theta(xi) - self.right, *divergences])

    def jacobian(self, xi: Array) -> Array:
        slope = np.zeros((len(self.standard.names), self.size))
        below = []
        for k, (chart, part) in enumerate(zip(self.charts, self._parts(xi), strict=True)):
            columns = np.arange(10 * k, 10 * k + 10)
            slope[np.ix_(chart.body.index, columns)] = chart.slope(part)
            if chart.weight:
                block = np.zeros((10, self.size))
                block[:, columns] = np.diag(chart.divergence_slope(part))
                below.append(block)
        free = xi[10 * len(self.charts) :]
        columns = np.arange(10 * len(self.charts), self.size)
        slope[self.rest, columns] = self.standard.scale[self.rest] * np.where(self.logarithmic, np.exp(free), 1.0)
        return np.concatenate([self.matrix @ slope, *below])

    def _parts(self, xi: Array) -> list[Array]:
        return list(xi[: 10 * len(self.charts)].reshape(-1, 10))
