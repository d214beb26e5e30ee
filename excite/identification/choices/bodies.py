"""Choice between plain least squares and physically possible bodies, by left-out torques."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from excite.errors import ConicSolverError
from excite.identification.choices.block_statistics import BlockStatistics
from excite.identification.choices.choice import Candidate, Choice
from excite.identification.choices.left_out import Estimate, LeftOut, least_squares_of_products, left_out
from excite.identification.estimators.physical import possible_fit
from excite.identification.estimators.standard import near_described
from excite.identification.observations import Observations
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from regressors.samples import Array

_WORTH = 0.005  # of the score: what is as good
DEVIATIONS = (None, 10.0, 3.0, 1.0, 0.3)  # of the described bodies, in their sizes; None: only possible


def possible_estimate_of_products(
    target: IdentificationTarget, described: Mapping[str, float], deviation: float | None
) -> Estimate:
    """Estimate by physically possible bodies from sums of products."""

    def estimate(products: Array, weights: Array) -> Array:
        rows = equivalent_rows(target, products, weights)
        pull = None if deviation is None else near_described(target.model, described, deviation)
        try:
            return possible_fit(rows, target.model, target.base, pull=pull, reference=described)
        except ConicSolverError:
            return least_squares_of_products(products, weights)

    return estimate


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


def choose_bodies(
    statistics: BlockStatistics,
    target: IdentificationTarget,
    described: Mapping[str, float],
    recipe: Recipe,
) -> tuple[Recipe, Choice, LeftOut]:
    """Whether bodies are held physically possible, and how near to the description.

    Least squares is taken only where it predicts left-out torques better by more than a standard error, and a
    thousandth; and of the pulls towards the description the weakest that is within that of the best.
    """
    free = left_out(statistics)
    held = {
        deviation: left_out(statistics, possible_estimate_of_products(target, described, deviation), free.weights)
        for deviation in deviations_to_try(target, described)
    }
    listed = [Candidate("weighted", free.error, free.score)]
    listed += [Candidate(_name(d), s.error, s.score) for d, s in held.items()]
    best = min(held, key=lambda d: held[d].score)
    chosen = next(d for d in held if _within_error(held[best], held[d]))
    if not _has_solution(statistics, target, described, chosen, held[chosen].weights):
        reason = "bodies are not held physically possible: the conic solver found none"
        return recipe, Choice("estimator", "weighted", tuple(listed), reason), free
    gain, deviation = free.gain_over(held[chosen])
    if gain > max(deviation, _WORTH):
        reason = (
            f"bodies are not held physically possible: left-out torques are predicted to {_percent(free)}, with "
            f"possible bodies to {_percent(held[chosen])}"
        )
        return recipe, Choice("estimator", "weighted", tuple(listed), reason), free
    reason = (
        f"bodies are {_name(chosen)}: left-out torques are predicted to {_percent(held[chosen])}, by least squares to "
        f"{_percent(free)}"
    )
    taken = replace(recipe, estimator="physical", described_within=chosen)
    return taken, Choice("estimator", _name(chosen), tuple(listed), reason), held[chosen]


def _has_solution(
    statistics: BlockStatistics,
    target: IdentificationTarget,
    described: Mapping[str, float],
    deviation: float | None,
    weights: Array,
) -> bool:
    """True if the conic solver finds possible bodies for all blocks together."""
    pull = None if deviation is None else near_described(target.model, described, deviation)
    rows = equivalent_rows(target, statistics.total, weights)
    try:
        possible_fit(rows, target.model, target.base, pull=pull, reference=described)
    except ConicSolverError:
        return False
    return True


def deviations_to_try(target: IdentificationTarget, described: Mapping[str, float]) -> Sequence[float | None]:
    """Deviations from the description that are tried; only None where it states no body."""
    return DEVIATIONS if near_described(target.model, described, 1.0).values else DEVIATIONS[:1]


def _within_error(best: LeftOut, other: LeftOut) -> bool:
    gain, deviation = best.gain_over(other)
    return gain <= max(deviation, _WORTH)


def _name(deviation: float | None) -> str:
    if deviation is None:
        return "physically possible"
    return f"physically possible, within about {deviation:g} times their size of the description"


def _percent(score: LeftOut) -> str:
    return f"{100 * score.error:.3g} %"
