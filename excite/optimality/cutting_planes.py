"""Cutting planes: solve a conic relaxation on some states, and add those that violate the dual inequality most."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import Any, ClassVar

import clarabel
import numpy as np
import scipy.sparse as sp

from excite.errors import ConicSolverError
from excite.optimality.limited_states import LimitedStates, MomentConditions, StateRows, matrix_of, triangle
from regressors.samples import Array, Index

_DRAWN, _CLIMBING, _ADDED, _STEPS = 8000, 1200, 500, 30
LOOKED_AT = _DRAWN + _CLIMBING * _STEPS  # states in a round
_FIRST = 2000
_UNUSED, _KEPT_EARLY, _EARLY = 1e-4, 0.2, 2
_VIOLATED = 1.0 + 1e-4
_NEAR = 1.01  # of the largest ratio, where more rounds gain less than half a per cent
_FEWER = 0.85  # of the steps' lengths from one to the next
Tell = Callable[[str], None]  # takes a sentence on the progress


@dataclass(frozen=True, eq=False)
class CuttingPlanes:
    """Search for a dual point of a criterion."""

    rows: StateRows
    conditions: MomentConditions
    motion: Array  # (N, 3 k) states of a motion within the limits, at equal steps, which keep the relaxation feasible

    @property
    def states(self) -> LimitedStates:
        """Within the limits."""
        return self.conditions.states

    def improving(
        self, criterion: BoundedCriterion, rounds: int, rng: np.random.Generator, tell: Tell = lambda _: None
    ) -> Iterator[tuple[DualCertificate, float]]:
        """Solve and add states, round by round; after each the best dual point so far, and its largest ratio."""
        S = np.concatenate([self.motion, self.states.drawn(_FIRST, rng)])
        best: tuple[DualCertificate, float] | None = None
        for number in range(rounds):
            weights, certificate = self._solved(criterion, S)
            if certificate is None:
                S = np.concatenate([S, self.states.drawn(_FIRST, rng)])
                continue
            states, ratios = self._violations(certificate, S[np.argsort(-weights)[:300]], rng)
            factor = float(ratios[0])
            if best is None or criterion.proven(certificate, factor) > criterion.proven(*best):
                best = certificate, factor
            tell(f"{criterion.described}: round {number + 1}, {criterion.proven(*best):.4g}")
            yield best
            if factor < _NEAR:
                break
            S = np.concatenate([S[self._kept(weights, number, rng)], states[ratios > _VIOLATED][:_ADDED]])
        if best is None:
            raise ConicSolverError("the relaxation was not solved in any round; give a design of fewer parameters")

    def of_few(self, most: int, positions: int) -> CuttingPlanes:
        """The relaxation of the columns that few coordinates move, and few positions; itself where there are none."""
        (moves, placed), k = self.rows.moved_by(), self.states.n
        chosen: tuple[tuple[int, ...], Index] = (), np.zeros(0, dtype=int)
        for kept in (each for size in range(1, most + 1) for each in combinations(range(k), size)):
            columns = np.flatnonzero(~np.delete(moves, kept, axis=1).any(axis=1))
            if columns.size > chosen[1].size and np.count_nonzero(placed[columns].any(axis=0)) <= positions:
                chosen = kept, columns
        if not chosen[1].size:
            return self
        own, others = np.array(chosen[0]), np.delete(np.arange(k), chosen[0])
        rows = self.rows.part(chosen[1], own, others, self.states.centre[others])
        states = self.states.part(own, others)
        counted = placed[np.ix_(chosen[1], own)].any(axis=0) & np.isfinite(states.extent(0))
        conditions = MomentConditions(states, counted, self.conditions.frequencies)
        return CuttingPlanes(rows, conditions, self.motion[:, np.concatenate([own, own + k, own + 2 * k])])

    def _solved(self, criterion: BoundedCriterion, S: Array) -> tuple[Array, DualCertificate | None]:
        Y = self.rows(S)
        F = np.einsum("nri,nrj->nij", Y, Y) + self.rows.prior
        scale = float(np.linalg.eigvalsh(F[: len(self.motion)].mean(axis=0))[0])
        try:
            weights, dual = relaxation(criterion, F, self.conditions.values(S), self.conditions, scale)
        except ConicSolverError:
            return np.zeros(len(S)), None
        return weights, DualCertificate(self.rows, self.conditions, *dual)

    def _kept(self, weights: Array, number: int, rng: np.random.Generator) -> Array:
        kept = weights > _UNUSED * weights.max()
        kept[: len(self.motion)] = True
        if number < _EARLY:
            kept |= rng.random(weights.size) < _KEPT_EARLY
        return np.asarray(kept)

    def _violations(self, certificate: DualCertificate, used: Array, rng: np.random.Generator) -> tuple[Array, Array]:
        """States of large ratios, the largest first: random ones, improved by random steps."""
        S = np.concatenate([self.states.drawn(_DRAWN, rng), self.motion, used])
        ratios = certificate.ratios(S)
        chosen = np.argsort(-ratios)[:_CLIMBING]
        S, ratios = S[chosen], ratios[chosen]
        extents = np.concatenate([self.states.extent(order) for order in range(3)])
        length = 0.4 * np.where(np.isfinite(extents), extents, np.pi)
        few = max(0.2, 2.0 / length.size)  # part of the coordinates that one step changes
        centre = np.concatenate([self.states.centre, np.zeros(2 * self.states.n)])
        for _ in range(_STEPS):
            moved = S + length * rng.standard_normal(S.shape) * (rng.random(S.shape) < few)
            excess = np.maximum(self.states.excess(moved), 0.0)[:, None]
            moved = centre + (moved - centre) / (1.0 + excess)
            better = np.where(self.states.hold(moved), certificate.ratios(moved), -np.inf)
            improved = better > ratios
            S, ratios = np.where(improved[:, None], moved, S), np.where(improved, better, ratios)
            length = length * _FEWER
        order = np.argsort(-ratios)
        return S[order], ratios[order]


_LEAST = 1e-12  # of the largest denominator


@dataclass(frozen=True, eq=False)
class DualCertificate:
    """``(<F(s), lower> + c' h(s)) / (<F(s), upper> + constant)``; its largest value over all states proves a bound."""

    rows: StateRows
    conditions: MomentConditions
    lower: Array  # (b, b)
    upper: Array  # (b, b)
    constant: float  # 1 where `upper` is zero, otherwise 0
    moments: Array  # (m,) ``c`` of the moment conditions

    def ratios(self, S: Array) -> Array:
        """The ratio at every state, shape (N,)."""
        Y = self.rows(S)
        above = _inner(Y, self.lower) + float(np.sum(self.rows.prior * self.lower))
        above += self.conditions.values(S) @ self.moments
        if self.constant:
            return np.asarray(above / self.constant)
        below = _inner(Y, self.upper) + float(np.sum(self.rows.prior * self.upper))
        return np.asarray(above / np.maximum(below, _LEAST * below.max()))


def _inner(Y: Array, Z: Array) -> Array:
    """``<Y'Y, Z>`` of every state."""
    return np.asarray(np.einsum("nri,nri->n", Y @ Z, Y))


_SETTINGS = {  # bounds do not depend on them, see `DualCertificate`
    "max_iter": 100,
    **dict.fromkeys(("tol_gap_rel", "tol_gap_abs"), 1e-5),
    "tol_feas": 1e-6,
}
_TOTAL = 1e-12
_USABLE = ("Solved", "AlmostSolved", "MaxIterations", "InsufficientProgress")


def relaxation(
    criterion: BoundedCriterion, F: Array, h: Array, conditions: MomentConditions, scale: float
) -> tuple[Array, tuple[Array, Array, float, Array]]:
    """Best measure on some states, and the multipliers of the dual point."""  # F (N, b, b); h (N, m); result (N,)
    size = criterion.sizes(F, scale)  # of a state; a weight times it is the programme's variable
    of_own, psd, exponential, total = criterion.part(F / size[:, None, None], scale)
    own, N, h = of_own.size, len(F), h / size[:, None]
    B = conditions.cone()
    p = B.shape[1]
    sizes = np.maximum(np.abs(h).max(axis=0), 1e-9)
    of_cone = np.zeros((h.shape[1], p))
    of_cone[: len(B)] = B
    zeros: Callable[[int, int], sp.csc_matrix] = lambda rows, columns: sp.csc_matrix((rows, columns))  # noqa: E731
    moments = [zeros(h.shape[1], own), sp.csc_matrix((h / sizes).T), sp.csc_matrix(-of_cone / sizes[:, None])]
    blocks = [(moments, np.zeros(h.shape[1]), [clarabel.ZeroConeT(h.shape[1])])]
    if total:
        blocks.append(([zeros(1, own), 1.0 / size[None], zeros(1, p)], np.ones(1), [clarabel.ZeroConeT(1)]))
    blocks.append(([zeros(N, own), -sp.eye_array(N), zeros(N, p)], np.zeros(N), [clarabel.NonnegativeConeT(N)]))
    first = sum(b.size for _, b, _ in blocks)
    blocks += [([A, zeros(A.shape[0], p)], b, [clarabel.PSDTriangleConeT(order)]) for A, b, order in psd]
    blocks += [([A, zeros(3, p)], b, [clarabel.ExponentialConeT()]) for A, b in exponential]
    if p:
        of_sizes = [clarabel.PSDTriangleConeT(size) for size in conditions.sizes]
        blocks.append(([zeros(p, own + N), -sp.eye_array(p)], np.zeros(p), of_sizes))
    rows, right, cones = zip(*blocks, strict=True)
    A = sp.vstack([sp.hstack(row) for row in rows])
    objective = np.concatenate([of_own, np.zeros(N + p)])
    x, z = _solved(objective, A, np.concatenate(right), [cone for some in cones for cone in some])
    dual = []
    for _, b, order in psd:
        dual.append(_positive(matrix_of(z[first : first + b.size], order)))
        first += b.size
    lower, upper, constant = criterion.multipliers(dual, scale)
    weights = np.maximum(x[own : own + N], 0.0) / size
    admitted = conditions.admitted(-z[: h.shape[1]] / sizes)
    return weights / max(weights.sum(), _TOTAL), (lower, upper, constant, admitted)


def _positive(M: Array) -> Array:
    """The matrix without negative eigenvalues."""
    values, V = np.linalg.eigh(M)
    return np.asarray((V * np.maximum(values, 0.0)) @ V.T)


def conic_solution(objective: Array, A: sp.spmatrix, b: Array, cones: list[object], **changed: float) -> Any:
    """Clarabel's solution of ``min objective'x`` with ``b - A x`` in the cones, by some settings of its own."""
    settings = clarabel.DefaultSettings()
    for name, value in {**changed, "verbose": False, "max_threads": 1}.items():
        setattr(settings, name, value)
    n = objective.size
    return clarabel.DefaultSolver(sp.csc_matrix((n, n)), objective, sp.csc_matrix(A), b, cones, settings).solve()


def _solved(objective: Array, A: sp.spmatrix, b: Array, cones: list[object]) -> tuple[Array, Array]:
    solution = conic_solution(objective, A, b, cones, **_SETTINGS)
    x, z = np.array(solution.x), np.array(solution.z)
    if not (np.all(np.isfinite(x)) and np.all(np.isfinite(z))) or str(solution.status) not in _USABLE:
        raise ConicSolverError(f"the relaxation was not solved: {solution.status}")
    return x, z


#: Rows ``A x + s = b`` of a criterion, for x = (own variables, weights of the states): the objective to be minimised,
#: of the own variables; rows of positive semidefinite matrices, with their sizes; rows of exponential cones, three
#: each; whether the weights are to sum to one.
ConicPart = tuple[Array, list[tuple[sp.spmatrix, Array, int]], list[tuple[sp.spmatrix, Array]], bool]


class BoundedCriterion(ABC):
    """A criterion of `excite.tasks.criteria`, smaller is better, of which a lower bound can be proven."""

    name: str  # that of the criterion
    described: str
    of_columns: ClassVar[bool] = True  # that of some columns is at most that of all
    trivial: ClassVar[float] = 0.0  # below any value

    def sizes(self, F: Array, scale: float) -> Array:
        """Sizes of states, in which the solver has their weights, shape (N,)."""
        return np.asarray(1.0 + np.linalg.norm(F, axis=(1, 2)) / scale)

    @abstractmethod
    def part(self, F: Array, scale: float) -> ConicPart:
        """Rows of the relaxation over states with matrices F, shape (N, b, b), that are divided by ``scale``."""

    @abstractmethod
    def multipliers(self, dual: list[Array], scale: float) -> tuple[Array, Array, float]:
        """``lower``, ``upper`` and ``constant`` from the dual matrices of the cones."""

    @abstractmethod
    def proven(self, dual: DualCertificate, factor: float) -> float:
        """Lower bound on the criterion that a dual point proves, given the factor that holds for all states."""


def _columns(own: Array, F: Array) -> sp.csc_matrix:
    """A column of the own variable, and ``-F`` as columns of weights."""
    return sp.hstack([sp.csc_matrix(own[:, None]), sp.csc_matrix(-triangle(F).T)], format="csc")


class BoundedCondition(BoundedCriterion):
    """``cond(W)``: minimise t subject to ``I <= sum w F <= t I``.

    ``tr(lower) lambda_min <= <M, lower> <= factor <M, upper> <= factor tr(upper) lambda_max``.
    """

    name = "condition"
    described = "condition number"
    trivial = 1.0

    def part(self, F: Array, scale: float) -> ConicPart:
        """Two matrices: ``sum w F - I`` and ``t I - sum w F``."""
        b = F.shape[1]
        unit = triangle(np.eye(b)[None])[0]
        rows = _columns(np.zeros(unit.size), F / scale)
        above = _columns(-unit, -F / scale)
        return np.ones(1), [(rows, -unit, b), (above, np.zeros(unit.size), b)], [], False

    def multipliers(self, dual: list[Array], scale: float) -> tuple[Array, Array, float]:
        """The two dual matrices."""
        return dual[0] / scale, dual[1] / scale, 0.0

    def proven(self, dual: DualCertificate, factor: float) -> float:
        """``sqrt(tr(lower) / (factor tr(upper)))``."""
        ratio = float(np.trace(dual.lower)) / (factor * float(np.trace(dual.upper)))
        return max(1.0, float(np.sqrt(ratio)))


class BoundedSmallestEigenvalue(BoundedCriterion):
    """E-optimality, ``1 / sqrt(lambda_min(M))``: maximise e subject to ``sum w F >= e I``, w of total 1."""

    name = "sigma-min"
    described = "largest deviation, 1 / sqrt(lambda_min)"

    def part(self, F: Array, scale: float) -> ConicPart:
        """One matrix: ``sum w F - e I``."""
        b = F.shape[1]
        rows = _columns(triangle(np.eye(b)[None])[0], F / scale)
        return -np.ones(1), [(rows, np.zeros(rows.shape[0]), b)], [], True

    def multipliers(self, dual: list[Array], scale: float) -> tuple[Array, Array, float]:
        """The dual matrix."""
        return dual[0] / scale, np.zeros_like(dual[0]), 1.0

    def proven(self, dual: DualCertificate, factor: float) -> float:
        """``sqrt(tr(lower) / factor)``, since ``tr(lower) lambda_min <= <M, lower> <= factor``."""
        return float(np.sqrt(np.trace(dual.lower) / factor))


class BoundedDeterminant(BoundedCriterion):
    """D-optimality, ``det(M)^(-1/2b)``: maximise log det, by a triangular factor and exponential cones.

    ``log det M <= b log(factor / b) - log det(lower)``, since ``det(A) <= (tr(A) / b)^b`` for
    ``A = lower^(1/2) M lower^(1/2)``.
    """

    name = "logdet"
    described = "volume of the confidence ellipsoid, det^(-1/2b)"
    of_columns = False

    def sizes(self, F: Array, scale: float) -> Array:
        """All alike: with others, the exponential cones end the solver's progress early."""
        return np.ones(len(F))

    def part(self, F: Array, scale: float) -> ConicPart:
        """``[[sum w F, Z], [Z', diag(Z)]] >= 0`` with Z lower triangular, and ``log Z_ii >= t_i``."""
        b = F.shape[1]
        columns, rows = np.triu_indices(b)  # of Z
        own = b + rows.size
        big, place = np.zeros((own, 2 * b, 2 * b)), np.arange(b, own)
        big[place, rows, b + columns] = big[place, b + columns, rows] = 1.0
        diagonal, ends = place[rows == columns], np.arange(b, 2 * b)
        big[diagonal, ends, ends] = 1.0
        of_weights = np.zeros((len(F), 2 * b, 2 * b))
        of_weights[:, :b, :b] = F / scale
        psd = sp.csc_matrix(-np.concatenate([triangle(big), triangle(of_weights)]).T)
        cones = [  # (t_i, 1, Z_ii) with exp(t_i) <= Z_ii
            (sp.csc_matrix(([-1.0, -1.0], ([0, 2], [i, k])), (3, own + len(F))), np.array([0.0, 1.0, 0.0]))
            for i, k in enumerate(diagonal)
        ]
        objective = np.concatenate([-np.ones(b), np.zeros(rows.size)])
        return objective, [(psd, np.zeros(psd.shape[0]), 2 * b)], cones, True

    def multipliers(self, dual: list[Array], scale: float) -> tuple[Array, Array, float]:
        """The dual matrix's block of M."""
        b = len(dual[0]) // 2
        lower = dual[0][:b, :b] / scale
        return lower, np.zeros_like(lower), 1.0

    def proven(self, dual: DualCertificate, factor: float) -> float:
        """``exp(log det(lower) / 2b) sqrt(b / factor)``."""
        b = len(dual.lower)
        sign, logarithm = np.linalg.slogdet(dual.lower)
        return float(np.exp(0.5 * logarithm / b) * np.sqrt(b / factor)) if sign > 0 else 0.0


BOUNDED: dict[str, BoundedCriterion] = {
    each.name: each for each in (BoundedCondition(), BoundedDeterminant(), BoundedSmallestEigenvalue())
}
