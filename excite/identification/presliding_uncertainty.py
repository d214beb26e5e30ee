"""Confidence intervals that allow for a presliding width that was found from the same data.

The width w is one more parameter: near the estimate the equations are ``y = W beta + c log w`` with
``c = d (W beta) / d log w``. Its value enters W; its uncertainty enters the intervals by the column c.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from excite.identification.covariance import METHODS, divisors
from excite.identification.equations import friction_drives, kept_rows
from excite.identification.estimate import Estimate
from excite.identification.estimator import solve_triangular_system
from excite.identification.friction_directions import drive_directions
from excite.identification.observations import GroupFactors, Observations
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe, Sizes
from excite.identification.streamed_rows import widened
from excite.information.target import IdentificationTarget
from regressors.samples import Array

_STEP = 0.05  # of log w


def presliding_column(
    target: IdentificationTarget, parts: Sequence[PreparedLog], recipe: Recipe, coefficients: Array
) -> Array | None:
    """Change of the predicted equations with the logarithm of the presliding width, shape (m,)."""  # coefficients (p,)
    if target.model.coulomb_friction() is None or not np.any(
        [*np.atleast_1d(recipe.sign_width or 0.0), *np.atleast_1d(recipe.breakaway or 0.0)]
    ):
        return None
    changes = [_changes(target, part, recipe, coefficients) for part in parts]
    column = np.concatenate(changes)
    return column if np.any(column) else None


def _changes(target: IdentificationTarget, part: PreparedLog, recipe: Recipe, coefficients: Array) -> Array:
    drives = friction_drives(target, part.samples)

    def directions(step: float) -> Array:
        sizes = [_scaled(size, float(np.exp(step))) for size in (recipe.sign_width, recipe.breakaway)]
        found = drive_directions(target.robot, part.samples, *sizes)
        assert found is not None  # some drive has a width
        return found

    slopes = (directions(_STEP) - directions(-_STEP)) / (2 * _STEP)
    torque = np.zeros((len(slopes), drives.rows.shape[1]))
    for k, column in enumerate(drives.columns):  # one after the other: logs may be long
        slope = slopes[:, drives.drives[k]]
        torque += (slope * drives.magnitudes[:, k] * coefficients[column])[:, None] * drives.rows[k]
    return kept_rows(target, part, recipe, torque.reshape(-1, 1))[:, 0]


def _scaled(size: Sizes | None, factor: float) -> Sizes | None:
    """One width or several, times a factor."""
    if size is None:
        return None
    return tuple(factor * one for one in size) if isinstance(size, tuple) else factor * size


def with_nuisance(
    estimate: Estimate, observations: Observations, column: Array, name: str = "nuisance parameter"
) -> tuple[Estimate, Observations]:
    """Estimate and observations with one more parameter, whose value is zero; its column widens the covariance."""
    # column (m,)
    wider = replace(
        observations,
        W=widened(observations.W, column),
        names=(*observations.names, name),
        units=(*observations.units, "1"),
    )
    halves = [_half(estimate, some) for some in (observations, wider)]
    seen = np.isfinite(np.diag(estimate.covariance))
    white = np.sum(halves[0] ** 2, axis=1)
    known = seen & (white > 0)
    ratio = float(np.median(np.diag(estimate.covariance)[known] / white[known])) if np.any(known) else 1.0
    covariance = ratio * halves[1] @ halves[1].T
    kept = np.append(seen, True)
    covariance = np.where(np.outer(kept, kept), covariance, 0.0)
    covariance[np.diag_indices_from(covariance)] = np.where(kept, np.diag(covariance), np.inf)
    extended = replace(
        estimate,
        names=wider.names,
        units=wider.units,
        values=np.append(estimate.values, 0.0),
        covariance=covariance,
        fit=np.append(estimate.coefficients, 0.0),
    )
    return extended, wider


def without_nuisance(estimate: Estimate, of: Estimate) -> Estimate:
    """Remove the last parameters again."""
    p = len(of.names)
    return replace(
        estimate, names=of.names, units=of.units, values=of.values, covariance=estimate.covariance[:p, :p], fit=of.fit
    )


def is_supported(estimate: Estimate) -> bool:
    """True if the covariance of an estimate can be widened by a nuisance parameter."""
    return estimate.method in METHODS


def _half(estimate: Estimate, observations: Observations) -> Array:
    return solve_triangular_system(GroupFactors.of(observations).stacked(divisors(estimate))).half
