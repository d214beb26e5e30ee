"""Uncertainty that an estimate states for its logs: of their noise, and of what was chosen by the same data.

Of m terms that could be added, those are that explain most, noise included: what they explain is exaggerated, and what
is correlated with them is shifted. Intervals hold whatever was chosen if the added terms' own are as wide as for m
statements at once [Berk, Brown, Buja, Zhang, Zhao 2013, Annals of Statistics 41, 802], by Bonferroni's bound. With C
the covariance and J the added terms, ``C[:, J] C[J, J]^-1 C[J, :]`` is what they contribute to all parameters; it is
multiplied by the square of the ratio of the quantiles.

Constraints alone cost nothing: with true parameters that are possible, moving an estimate to the nearest possible one
moves it towards the truth, and the deviations without constraints hold for it. A pull is different. It biases the
estimate by ``b - b_0`` on average, with b_0 the estimate without pull, whose own noise makes that difference larger
still, so that ``Cov + (b - b_0)(b - b_0)'`` with the covariance of b_0 is on the safe side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.stats

from excite.identification.autoregressive_noise import noise_origin
from excite.identification.covariance import with_covariance
from excite.identification.equations import kept_rows, predicted_rows
from excite.identification.estimate import CONFIDENCE, Estimate
from excite.identification.estimator import Estimator
from excite.identification.estimators.weighted import weighted
from excite.identification.observations import Observations
from excite.identification.preparation import PreparedLog
from excite.identification.presliding_uncertainty import (
    is_supported,
    presliding_column,
    with_nuisance,
    without_nuisance,
)
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from regressors.samples import Array, Index

PRESLIDING, DELAY = FOUND = ("presliding", "delay")


def with_uncertainty(
    estimate: Estimate,
    observations: Observations,
    target: IdentificationTarget,
    parts: Sequence[PreparedLog],
    recipe: Recipe,
    *,
    found: frozenset[str],
) -> Estimate:
    """Covariance by the correlation of the residuals, and for a presliding width and a delay that were found."""
    origin = noise_origin(target, parts, recipe)
    wider, rows = estimate, observations
    for name, column in found_columns(estimate, target, parts, recipe, found):
        wider, rows = with_nuisance(wider, rows, column, name)
    wider = with_covariance(wider, rows, recipe.covariance, origin)
    return wider if rows is observations else without_nuisance(wider, estimate)


def found_columns(
    estimate: Estimate,
    target: IdentificationTarget,
    parts: Sequence[PreparedLog],
    recipe: Recipe,
    found: frozenset[str],
) -> list[tuple[str, Array]]:
    """Names of the settings that were found, and their columns of the equations, shape (m,); see `with_uncertainty`."""
    if not is_supported(estimate):
        return []
    made = {PRESLIDING: presliding_column, DELAY: delay_column}
    columns = [(name, made[name](target, parts, recipe, estimate.coefficients)) for name in FOUND if name in found]
    return [(name, column) for name, column in columns if column is not None]


def delay_column(
    target: IdentificationTarget, parts: Sequence[PreparedLog], recipe: Recipe, coefficients: Array
) -> Array | None:
    """Change of the predicted torques with the delay, ``-d (W beta) / dt``, per sample time, shape (m,).

    Torques that act later belong to an earlier motion.
    """  # coefficients (p,)
    if not recipe.delay or target.model.window is not None:
        return None
    columns = []
    for part in parts:
        sizes = recipe.breakaway or 0.0, recipe.sign_width or 0.0
        change = -np.gradient(predicted_rows(target, part.samples, *sizes, coefficients), axis=0)
        columns.append(kept_rows(target, part, recipe, change.reshape(-1, 1))[:, 0])
    return np.concatenate(columns)


def allowing_for_selection(estimate: Estimate, added: Sequence[int] | Index, candidates: int) -> Estimate:
    """Extend the covariance of an estimate by what choosing some of its terms does."""
    C, freedom = estimate.covariance, max(estimate.degrees_of_freedom, 1)
    J: Index = np.array([k for k in added if np.isfinite(C[k, k]) and C[k, k] > 0], dtype=np.intp)
    if not J.size or candidates < 2:
        return estimate
    tail = (1 - CONFIDENCE) / 2
    one, several = scipy.stats.t.isf([tail, tail / candidates], freedom)
    seen = np.flatnonzero(np.isfinite(np.diag(C)))
    share = C[np.ix_(seen, J)]
    wider = C.copy()
    wider[np.ix_(seen, seen)] += (
        ((several / one) ** 2 - 1) * share @ np.linalg.pinv(C[np.ix_(J, J)], hermitian=True) @ share.T
    )
    note = f"the intervals allow for {J.size} of {candidates} possible terms having been chosen by the same data"
    return replace(estimate, covariance=wider, notes=(*estimate.notes, note))


def allowing_for_pull(estimate: Estimate, estimator: Estimator, observations: Observations) -> Estimate:
    """Extend the covariance of a pulled estimate by its distance from the estimate without pull."""
    if not getattr(estimator, "pull", 0.0) and getattr(estimator, "described_within", None) is None:
        return estimate
    free = weighted(observations)
    seen = np.isfinite(np.diag(estimate.covariance)) & np.isfinite(free.values)
    bias = np.where(seen, estimate.values - free.values, 0.0)
    return replace(
        estimate,
        covariance=estimate.covariance + np.outer(bias, bias),
        notes=(*estimate.notes, "the intervals allow for the pull: they reach the estimate without it"),
    )
