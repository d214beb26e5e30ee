"""How candidates are scored: by the torques of blocks that an estimate was made without."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from excite.identification.choices.block_statistics import BlockStatistics
from excite.identification.choices.bodies import possible_estimate_of_products
from excite.identification.choices.left_out import Estimate, LeftOut, least_squares_of_products, left_out
from excite.identification.choices.trial import Trial
from excite.identification.estimators.standard import near_described
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from regressors.models.nominal import standard_values
from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class Scoring:
    """Logs, the columns of a target, and an estimate."""

    trial: Trial
    target: IdentificationTarget
    estimate: Estimate | None = None  # see `left_out`; weighted least squares if not given

    def statistics(self, recipe: Recipe) -> BlockStatistics:
        """Sums of products under a recipe."""
        return self.trial.statistics(self.target, self.trial.prepared(self.target, recipe), recipe)

    def of(self, statistics: BlockStatistics) -> LeftOut:
        """Left-out errors."""
        plain = left_out(statistics)
        return plain if self.estimate is None else left_out(statistics, self.estimate, plain.weights)

    def with_target(self, target: IdentificationTarget, recipe: Recipe) -> Scoring:
        """Score in the columns of another target, with the described bodies if these were needed before."""
        other = replace(self, target=target, estimate=None)
        if self.estimate is None:
            return other
        described = standard_values(target.robot)
        return replace(other, estimate=best_pulled(target, described, other.statistics(recipe)))


def scoring_of(trial: Trial, target: IdentificationTarget, recipe: Recipe, *, may_hold: bool) -> Scoring:
    """Score by least squares; with possible bodies where few data determine too little."""
    plain = Scoring(trial, target)
    if not may_hold or not target.model.standard_columns:
        return plain
    statistics = plain.statistics(recipe)
    errors = plain.of(statistics)
    described = standard_values(target.robot)
    possible = left_out(statistics, possible_estimate_of_products(target, described, None), errors.weights)
    gain, deviation = errors.gain_over(possible)
    return plain if gain > -deviation else Scoring(trial, target, best_pulled(target, described, statistics))


_WITHIN = (10.0, 3.0, 1.0)  # of the described bodies, in their sizes


def best_pulled(target: IdentificationTarget, described: Mapping[str, float], statistics: BlockStatistics) -> Estimate:
    """`pulled_least_squares` with the deviation that predicts left-out blocks best."""
    every = range(target.base.rank)
    estimates = [pulled_least_squares(target, described, within, every) for within in _WITHIN]
    return min(estimates, key=lambda estimate: left_out(statistics, estimate).score)


def pulled_least_squares(
    target: IdentificationTarget, described: Mapping[str, float], within: float, columns: Sequence[int]
) -> Estimate:
    """Least squares with the prior ``beta ~ N(A theta0, A D^2 A')`` of the base parameters that bodies are part of."""
    definition, names = target.model.definition()
    A = np.asarray(target.base.D @ definition)[list(columns)]
    pull = near_described(target.model, described, within)
    spread = A * np.array([pull.deviations.get(name, 0.0) for name in names])
    center = A @ np.array([pull.values.get(name, 0.0) for name in names])
    known = np.flatnonzero(np.any(spread != 0.0, axis=1))
    length = np.linalg.norm(spread[known], axis=1)
    inverse = np.linalg.pinv((spread[known] / length[:, None]).T)
    information = inverse @ inverse.T / np.outer(length, length) if known.size else np.zeros((0, 0))

    def estimate(products: Array, weights: Array) -> Array:
        p = products.shape[-1] - 1
        prior = np.zeros((p + 1, p + 1))
        prior[np.ix_(known, known)] = information
        prior[known, -1] = prior[-1, known] = information @ center[known]
        return least_squares_of_products(np.concatenate([products, prior[None]]), np.append(weights, 1.0))

    return estimate
