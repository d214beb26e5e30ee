"""How candidates are scored, and the choice between least squares and physically possible bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from excite.errors import ConicSolverError
from excite.identification.choices.left_out import (
    BlockStatistics,
    Choice,
    Estimate,
    LeftOut,
    best_of,
    candidates_of,
    least_squares_of_products,
    left_out,
)
from excite.identification.choices.trial import Trial
from excite.identification.estimators.physical import possible_fit
from excite.identification.estimators.standard import near_described
from excite.identification.observations import Observations
from excite.identification.preparation import PreparedLog
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

    def softened(self, recipe: Recipe) -> Scoring:
        """With friction that changes its sign over the recipe's velocity, where trials cannot write it themselves."""
        width, model = recipe.common_width, self.target.model
        if not width or model.coulomb_friction() is not None:
            return self
        return replace(self, target=replace(self.target, model=model.softened(width)))

    def parts(self, recipe: Recipe) -> list[PreparedLog]:
        """The logs under a recipe."""
        return self.trial.prepared(self.target, recipe)

    def statistics(self, recipe: Recipe) -> BlockStatistics:
        """Sums of products under a recipe."""
        return self.trial.statistics(self.target, self.parts(recipe), recipe)

    def of(self, statistics: BlockStatistics, judged: BlockStatistics | None = None) -> LeftOut:
        """Left-out errors, of the rows that are judged if these are not those of the estimates."""
        plain = left_out(statistics, judged=judged)
        if self.estimate is None:
            return plain
        return left_out(statistics, self.estimate, plain.weights, judged=judged)

    def fitted(self, statistics: BlockStatistics, weights: Array) -> Array:
        """The estimate from all blocks, shape (p,)."""
        return (self.estimate or least_squares_of_products)(statistics.total, weights)

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
    return plain if gain > -deviation else replace(plain, estimate=best_pulled(target, described, statistics))


WITHIN = (10.0, 3.0, 1.0)  # of the described bodies, in their sizes


def best_pulled(
    target: IdentificationTarget,
    described: Mapping[str, float],
    statistics: BlockStatistics,
) -> Estimate:
    """`pulled_least_squares` with the deviation that predicts left-out blocks best."""
    every = range(target.base.rank)
    estimates = [pulled_least_squares(target, described, within, every) for within in WITHIN]
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


_WORTH = 0.005  # of the score: what is as good
DEVIATIONS = (None, 10.0, 3.0, 1.0, 0.3)  # of the described bodies, in their sizes; None: only possible


def choose_bodies(
    statistics: BlockStatistics,
    target: IdentificationTarget,
    described: Mapping[str, float],
    recipe: Recipe,
) -> tuple[Recipe, Choice]:
    """Whether bodies are held physically possible, and how near to the description.

    Least squares is taken only where it predicts left-out torques better by more than a standard error, and a
    thousandth; and of the pulls towards the description the weakest that is within that of the best.
    """
    free = left_out(statistics)
    held = {
        deviation: left_out(statistics, possible_estimate_of_products(target, described, deviation), free.weights)
        for deviation in deviations_to_try(target, described)
    }
    best = held[best_of(held)]
    chosen = next(deviation for deviation in held if not best.is_better(held[deviation], _WORTH))
    listed = candidates_of({"weighted": free, **{_words(deviation): errors for deviation, errors in held.items()}})
    try:
        _possible_fit(target, statistics.total, held[chosen].weights, described, chosen)
    except ConicSolverError:
        reason = "bodies are not held physically possible: the conic solver found none"
        return recipe, Choice("estimator", "weighted", listed, reason)
    if free.is_better(held[chosen], _WORTH):
        reason = (
            f"bodies are not held physically possible: left-out torques are predicted to {free.percent}, with "
            f"possible bodies to {held[chosen].percent}"
        )
        return recipe, Choice("estimator", "weighted", listed, reason)
    reason = (
        f"bodies are {_words(chosen)}: left-out torques are predicted to {held[chosen].percent}, by least squares to "
        f"{free.percent}"
    )
    taken = replace(recipe, estimator="physical", described_within=chosen)
    return taken, Choice("estimator", _words(chosen), listed, reason)


def deviations_to_try(target: IdentificationTarget, described: Mapping[str, float]) -> Sequence[float | None]:
    """Deviations from the description that are tried; only None where it states no body."""
    return DEVIATIONS if near_described(target.model, described, 1.0).values else DEVIATIONS[:1]


def _words(deviation: float | None) -> str:
    if deviation is None:
        return "physically possible"
    return f"physically possible, within about {deviation:g} times their size of the description"


def possible_estimate_of_products(
    target: IdentificationTarget, described: Mapping[str, float], deviation: float | None
) -> Estimate:
    """Estimate by physically possible bodies from sums of products; by least squares where the solver finds none."""

    def estimate(products: Array, weights: Array) -> Array:
        try:
            return _possible_fit(target, products, weights, described, deviation)
        except ConicSolverError:
            return least_squares_of_products(products, weights)

    return estimate


def _possible_fit(
    target: IdentificationTarget,
    products: Array,
    weights: Array,
    described: Mapping[str, float],
    deviation: float | None,
) -> Array:
    pull = None if deviation is None else near_described(target.model, described, deviation)
    rows = equivalent_rows(target, products, weights)
    return possible_fit(rows, target.model, target.base, pull=pull, reference=described)


def equivalent_rows(target: IdentificationTarget, products: Array, weights: Array) -> Observations:
    """As few rows as have the given sums of products."""  # products (r, p + 1, p + 1); weights (r,)
    r, width = products.shape[:2]
    factors = []
    for block in products:
        length = np.sqrt(np.diag(block))
        length = np.where(length > 0, length, 1.0)
        values, vectors = np.linalg.eigh(block / np.outer(length, length))
        factors.append(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T * length)
    both = np.concatenate(factors)
    return Observations(
        W=both[:, :-1],
        y=both[:, -1],
        names=target.base.names,
        units=target.base.units,
        equation=np.repeat(np.arange(r), width),
        equations=target.model.row_labels,
        log=np.zeros(r * width, dtype=np.intp),
        logs=("",),
        time=np.tile(np.arange(float(width)), r),
        noise=1.0 / np.sqrt(weights)[None, :],
    )


def of_base_columns(target: IdentificationTarget, columns: Sequence[int]) -> IdentificationTarget:
    """A target with some of its base columns; parameters that only the others contain remain undetermined."""
    base, kept = target.base, list(columns)
    few = replace(
        base,
        index=base.index[kept],
        D=base.D[kept],
        singular_values=base.singular_values[kept],
        expressions=tuple(base.expressions[k] for k in kept),
    )
    return replace(target, base=few)
