"""How candidates are scored: by left-out torques, with an estimate that suits how much the data determine."""

from __future__ import annotations

from dataclasses import dataclass, replace

from excite.identification.choices.block_statistics import BlockStatistics
from excite.identification.choices.bodies import possible_estimate_of_products
from excite.identification.choices.left_out import Estimate, LeftOut, left_out
from excite.identification.choices.pulled import best_pulled
from excite.identification.choices.trial import Trial
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from regressors.models.nominal import standard_values


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
