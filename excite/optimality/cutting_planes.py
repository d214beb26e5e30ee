"""Cutting planes: solve on some states, search the states that violate the dual inequality most, add them, repeat."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from excite.errors import ConicSolverError
from excite.optimality.bounded_criteria import BoundedCriterion, Multipliers
from excite.optimality.dual_certificate import DualCertificate
from excite.optimality.limited_states import LimitedStates
from excite.optimality.moment_conditions import MomentConditions
from excite.optimality.semidefinite_relaxation import relaxation
from excite.optimality.state_rows import StateRows
from regressors.samples import Array

_DRAWN, _CLIMBING, _ADDED, _STEPS = 8000, 1200, 500, 30
_FIRST = 2000
_UNUSED, _KEPT_EARLY, _EARLY = 1e-4, 0.2, 2
_VIOLATED = 1.0 + 1e-4
_NEAR = 1.01  # of the largest ratio, where more rounds gain less than half a per cent
_FEWER = 0.85  # of the steps' lengths from one to the next


@dataclass(frozen=True, eq=False)
class Relaxed:
    """The best dual point that was found."""

    multipliers: Multipliers
    factor: float  # largest ratio over all states that were looked at with these multipliers
    looked_at: int  # number of these states
    states: Array  # (N, 3 k) states that carry the measure, and the motion in hand


@dataclass(frozen=True, eq=False)
class CuttingPlanes:
    """Search for a dual point of a criterion."""

    rows: StateRows
    states: LimitedStates
    conditions: MomentConditions
    motion: Array  # (N, 3 k) states of a motion within the limits, at equal steps, which keep the relaxation feasible

    def run(
        self,
        criterion: BoundedCriterion,
        rounds: int,
        rng: np.random.Generator,
        begin: Array | None = None,
        tell: Callable[[str], None] = lambda _: None,
    ) -> Relaxed:
        """Solve and add states, round by round."""  # begin (N, 3 k)
        first = [self.motion, self.states.drawn(_FIRST, rng)]
        S = np.concatenate(first if begin is None else [*first, begin])
        best: Relaxed | None = None
        for number in range(rounds):
            weights, certificate = self._solved(criterion, S)
            if certificate is None:
                S = np.concatenate([S, self.states.drawn(_FIRST, rng)])
                continue
            states, ratios = self._violations(certificate, S[np.argsort(-weights)[:300]], rng)
            factor = float(ratios[0])
            found = Relaxed(certificate.multipliers, factor, _DRAWN + _CLIMBING * _STEPS, S)
            bound = criterion.proven(found.multipliers, factor)
            if best is None or bound > criterion.proven(best.multipliers, best.factor):
                best = found
            tell(f"{criterion.described}: round {number + 1}, {criterion.proven(best.multipliers, best.factor):.4g}")
            if factor < _NEAR:
                break
            S = np.concatenate([S[self._kept(weights, number, rng)], states[ratios > _VIOLATED][:_ADDED]])
        if best is None:
            raise ConicSolverError("the relaxation was not solved in any round; give a design of fewer parameters")
        return best

    def _solved(self, criterion: BoundedCriterion, S: Array) -> tuple[Array, DualCertificate | None]:
        Y = self.rows(S)
        F = np.einsum("nri,nrj->nij", Y, Y) + self.rows.prior
        scale = float(np.linalg.eigvalsh(F[: len(self.motion)].mean(axis=0))[0])
        try:
            weights, multipliers = relaxation(criterion, F, self.conditions.values(S), self.conditions, scale)
        except ConicSolverError:
            return np.zeros(len(S)), None
        return weights, DualCertificate(self.rows, self.conditions, multipliers)

    def _kept(self, weights: Array, number: int, rng: np.random.Generator) -> Array:
        kept = weights > _UNUSED * weights.max()
        kept[: len(self.motion)] = True
        if number < _EARLY:
            kept |= rng.random(weights.size) < _KEPT_EARLY
        return np.asarray(kept)

    def _violations(
        self, certificate: DualCertificate, carriers: Array, rng: np.random.Generator
    ) -> tuple[Array, Array]:
        """States of large ratios, the largest first: random ones, improved by random steps."""
        S = np.concatenate([self.states.drawn(_DRAWN, rng), self.motion, carriers])
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
