"""Uncertainty that an estimate states for its logs: of their noise, and of what was chosen by the same data."""

from __future__ import annotations

from collections.abc import Sequence

from excite.identification.cumulated_noise import noise_origin
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


def with_uncertainty(
    estimate: Estimate,
    observations: Observations,
    target: IdentificationTarget,
    parts: Sequence[PreparedLog],
    recipe: Recipe,
    *,
    width_found: bool,
) -> Estimate:
    """Covariance by the correlation of the residuals, and for a presliding width that was found.

    Parameters
    ----------
    estimate : Estimate
        With the covariance for white noise.
    observations : Observations
    target : IdentificationTarget
    parts : sequence of PreparedLog
    recipe : Recipe
        With the chosen `sign_width` or `breakaway`.
    width_found : bool
        Whether that was found from the same logs.
    """
    origin = noise_origin(target, parts, recipe)
    column = None
    if width_found and is_supported(estimate):
        column = presliding_column(target, parts, recipe, estimate.coefficients)
    if column is None:
        return with_covariance(estimate, observations, recipe.covariance, origin)
    wider = with_covariance(*with_nuisance(estimate, observations, column), recipe.covariance, origin)
    return without_nuisance(wider, estimate)
