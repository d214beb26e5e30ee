"""Uncertainty that an estimate states for its logs: of their noise, and of what was chosen by the same data."""

from __future__ import annotations

from collections.abc import Sequence

from excite.identification.cumulated_noise import noise_origin
from excite.identification.delay_uncertainty import delay_column
from excite.identification.estimate import Estimate
from excite.identification.observations import Observations
from excite.identification.preparation import PreparedLog
from excite.identification.presliding_uncertainty import (
    is_supported,
    presliding_column,
    with_nuisance,
    without_nuisance,
)
from excite.identification.recipe import Recipe
from excite.identification.residual_covariance import with_covariance
from excite.information.target import IdentificationTarget
from regressors.samples import Array

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
