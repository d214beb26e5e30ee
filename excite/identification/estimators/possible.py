"""Estimate from physically possible standard parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from excite.identification.estimate import Estimate
from excite.identification.estimators.standard import StandardProblem
from excite.identification.estimators.weighted import weighted_estimate
from excite.identification.observations import Observations
from excite.identification.weights import GroupWeights
from regressors.samples import Array


def possible_estimate(
    method: str,
    observations: Observations,
    problem: GroupWeights,
    standard: StandardProblem,
    theta: Array,
    notes: tuple[str, ...],
) -> Estimate:
    """Estimate from possible standard parameters, with the covariance of weighted least squares."""
    free = weighted_estimate(method, observations, problem)
    fit = np.asarray(standard.A @ theta)
    values = np.where(np.isnan(free.values), np.nan, fit)
    named = dict(zip(standard.names, theta.tolist(), strict=True))
    notes = (*free.notes, *notes, "covariance of the estimate without constraints and pull")
    return replace(free, values=values, standard=named, notes=notes, fit=fit, unconstrained=free.coefficients)
