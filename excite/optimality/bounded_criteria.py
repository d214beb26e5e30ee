"""Criteria that have a bound: what is maximised over measures, and what any dual point proves.

In each case ``<F(s), lower> + c' h(s) <= factor (<F(s), upper> + constant)`` for all admissible states s, with
``E[c' h] >= 0`` and positive semidefinite `lower` and `upper`, gives a bound after the mean over any motion.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from excite.optimality.moment_conditions import triangle
from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class Multipliers:
    """A dual point."""

    lower: Array  # (b, b)
    upper: Array  # (b, b)
    constant: float  # 1 where `upper` is zero, otherwise 0
    moments: Array  # (m,) ``c`` of the moment conditions


@dataclass(frozen=True, eq=False)
class ConicPart:
    """Rows ``A x + s = b`` of a criterion, for x = (own variables, weights of the states)."""

    objective: Array  # to be minimised, of the own variables
    psd: list[tuple[sp.spmatrix, Array, int]]  # rows of positive semidefinite matrices, with their sizes
    exponential: list[tuple[sp.spmatrix, Array]]  # three rows each, of exponential cones
    total: bool  # whether the weights are to sum to one


class BoundedCriterion(ABC):
    """A criterion of `excite.tasks.criteria`, smaller is better, of which a lower bound can be proven."""

    name: str  # that of the criterion
    described: str

    @abstractmethod
    def part(self, F: Array, scale: float) -> ConicPart:
        """Rows of the relaxation over states with matrices F, shape (N, b, b), that are divided by ``scale``."""

    @abstractmethod
    def multipliers(self, dual: list[Array], scale: float) -> tuple[Array, Array, float]:
        """``lower``, ``upper`` and ``constant`` from the dual matrices of the cones."""

    @abstractmethod
    def proven(self, multipliers: Multipliers, factor: float) -> float:
        """Lower bound on the criterion that multipliers prove, given the factor that holds for all states."""


def _columns(own: Array, F: Array) -> sp.csc_matrix:
    """A column of the own variable, and ``-F`` as columns of weights."""
    return sp.hstack([sp.csc_matrix(own[:, None]), sp.csc_matrix(-triangle(F).T)], format="csc")


class BoundedCondition(BoundedCriterion):
    """``cond(W)``: minimise t subject to ``I <= sum w F <= t I``.

    ``tr(lower) lambda_min <= <M, lower> <= factor <M, upper> <= factor tr(upper) lambda_max``.
    """

    name = "condition"
    described = "condition number"

    def part(self, F: Array, scale: float) -> ConicPart:
        """Two matrices: ``sum w F - I`` and ``t I - sum w F``."""
        b = F.shape[1]
        unit = triangle(np.eye(b)[None])[0]
        rows = _columns(np.zeros(unit.size), F / scale)
        above = _columns(-unit, -F / scale)
        return ConicPart(np.ones(1), [(rows, -unit, b), (above, np.zeros(unit.size), b)], [], False)

    def multipliers(self, dual: list[Array], scale: float) -> tuple[Array, Array, float]:
        """The two dual matrices."""
        return dual[0] / scale, dual[1] / scale, 0.0

    def proven(self, multipliers: Multipliers, factor: float) -> float:
        """``sqrt(tr(lower) / (factor tr(upper)))``."""
        ratio = float(np.trace(multipliers.lower)) / (factor * float(np.trace(multipliers.upper)))
        return max(1.0, float(np.sqrt(ratio)))


class BoundedSmallestEigenvalue(BoundedCriterion):
    """E-optimality, ``1 / sqrt(lambda_min(M))``: maximise e subject to ``sum w F >= e I``, w of total 1."""

    name = "sigma-min"
    described = "largest deviation, 1 / sqrt(lambda_min)"

    def part(self, F: Array, scale: float) -> ConicPart:
        """One matrix: ``sum w F - e I``."""
        b = F.shape[1]
        rows = _columns(triangle(np.eye(b)[None])[0], F / scale)
        return ConicPart(-np.ones(1), [(rows, np.zeros(rows.shape[0]), b)], [], True)

    def multipliers(self, dual: list[Array], scale: float) -> tuple[Array, Array, float]:
        """The dual matrix."""
        return dual[0] / scale, np.zeros_like(dual[0]), 1.0

    def proven(self, multipliers: Multipliers, factor: float) -> float:
        """``sqrt(tr(lower) / factor)``, since ``tr(lower) lambda_min <= <M, lower> <= factor``."""
        return float(np.sqrt(np.trace(multipliers.lower) / factor))


class BoundedDeterminant(BoundedCriterion):
    """D-optimality, ``det(M)^(-1/2b)``: maximise log det, by a triangular factor and exponential cones.

    ``log det M <= b log(factor / b) - log det(lower)``, since ``det(A) <= (tr(A) / b)^b`` for
    ``A = lower^(1/2) M lower^(1/2)``.
    """

    name = "logdet"
    described = "volume of the confidence ellipsoid, det^(-1/2b)"

    def part(self, F: Array, scale: float) -> ConicPart:
        """``[[sum w F, Z], [Z', diag(Z)]] >= 0`` with Z lower triangular, and ``log Z_ii >= t_i``."""
        b = F.shape[1]
        places = [(i, j) for j in range(b) for i in range(j, b)]
        own = b + len(places)
        big = np.zeros((own, 2 * b, 2 * b))
        diagonal = {}
        for n, (i, j) in enumerate(places):
            big[b + n, i, b + j] = big[b + n, b + j, i] = 1.0
            if i == j:
                big[b + n, b + i, b + i] = 1.0
                diagonal[i] = b + n
        of_weights = np.zeros((len(F), 2 * b, 2 * b))
        of_weights[:, :b, :b] = F / scale
        rows = sp.csc_matrix(-np.concatenate([triangle(big), triangle(of_weights)]).T)
        size = own + len(F)
        cones = []
        for i in range(b):  # (t_i, 1, Z_ii) with exp(t_i) <= Z_ii
            A = sp.lil_matrix((3, size))
            A[0, i] = -1.0
            A[2, diagonal[i]] = -1.0
            cones.append((A.tocsc(), np.array([0.0, 1.0, 0.0])))
        objective = np.concatenate([-np.ones(b), np.zeros(len(places))])
        return ConicPart(objective, [(rows, np.zeros(rows.shape[0]), 2 * b)], cones, True)

    def multipliers(self, dual: list[Array], scale: float) -> tuple[Array, Array, float]:
        """The dual matrix's block of M."""
        b = len(dual[0]) // 2
        lower = dual[0][:b, :b] / scale
        return lower, np.zeros_like(lower), 1.0

    def proven(self, multipliers: Multipliers, factor: float) -> float:
        """``exp(log det(lower) / 2b) sqrt(b / factor)``."""
        b = len(multipliers.lower)
        sign, logarithm = np.linalg.slogdet(multipliers.lower)
        return float(np.exp(0.5 * logarithm / b) * np.sqrt(b / factor)) if sign > 0 else 0.0


BOUNDED: dict[str, BoundedCriterion] = {
    each.name: each for each in (BoundedCondition(), BoundedDeterminant(), BoundedSmallestEigenvalue())
}
