"""Choice of an estimate's covariance by its residuals, and the condition number of its equations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from excite.identification.covariance import METHODS, robust_covariance
from excite.identification.cumulated_noise import NoiseOrigin
from excite.identification.estimate import Estimate
from excite.identification.factors import GroupFactors
from excite.identification.observations import Observations
from excite.identification.residuals import residual_diagnostics


def with_covariance(
    estimate: Estimate, observations: Observations, kind: str, origin: NoiseOrigin | None = None
) -> Estimate:
    """Choose the covariance of an estimate by the correlation of its residuals, or as asked for."""
    cumulated = origin is not None and origin.cumulated
    if kind == "white" or (kind == "auto" and not cumulated and _white(estimate, observations)):
        return estimate
    if kind == "auto" and estimate.method not in METHODS:
        note = "residuals are correlated in time, but the intervals assume white ones: they are too narrow"
        return replace(estimate, notes=(*estimate.notes, note))
    return robust_covariance(estimate, observations, origin=origin)


def _white(estimate: Estimate, observations: Observations) -> bool:
    """True if no equation's residuals are clearly correlated in time."""
    return all(r.whiteness > 0.001 or abs(r.lag_one) < 0.05 for r in residual_diagnostics(estimate, observations))


def condition_number(observations: Observations) -> float:
    """cond(W), infinite where a column vanishes or depends on others."""
    factors = GroupFactors.of(observations)
    R = factors.stacked(np.ones(len(factors.R)))[:, :-1]
    sigma = np.linalg.svd(R, compute_uv=False)
    return float(sigma[0] / sigma[-1]) if R.shape[0] >= R.shape[1] and sigma[-1] > 1e-13 * sigma[0] else np.inf
