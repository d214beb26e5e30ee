"""Density of the noise of a robot's equations, as a result has measured it: what the next experiment may expect."""

from __future__ import annotations

import numpy as np

from excite.identification.covariance import group_scale
from excite.identification.estimate import Estimate
from excite.identification.observations import GroupFactors, Observations
from regressors.samples import Array


def noise_density(estimate: Estimate, observations: Observations) -> Array:
    """Noise of each equation whose white version would give the deviations that the estimate states.

    With the residuals' deviation s_g of the n_g rows of log and equation g over T seconds, white noise would give the
    information ``J = sum_g W_g' W_g / s_g^2``. The covariance C that the estimate states allows for correlated
    residuals, scatter between logs and more; on average over all directions of the parameters it is
    ``c = (det C det J)^(1/p)`` times ``J^-1``. The density of equation j is ``sqrt(c mean_g s_g^2 T_g / n_g)``, over
    the logs.
    """
    count = np.bincount(observations.group, minlength=len(observations.logs) * len(observations.equations))
    count = count.reshape(len(observations.logs), -1)
    span = [np.ptp(observations.time[observations.log == k]) for k in range(len(observations.logs))]
    with np.errstate(divide="ignore", invalid="ignore"):
        squares = np.where(count > 0, estimate.noise**2 * np.array(span)[:, None] / count, np.nan)
    known = np.isfinite(squares)
    mean = np.where(known, squares, 0.0).sum(axis=0) / np.where(known.any(axis=0), known.sum(axis=0), np.nan)
    return np.asarray(np.sqrt(mean * _inflation(estimate, observations)))


def _inflation(estimate: Estimate, observations: Observations) -> float:
    """Mean factor from the variances of white noise to those stated, over the parameters that are identified."""
    seen = np.flatnonzero(np.isfinite(np.diag(estimate.covariance)))
    R = GroupFactors.of(observations).stacked(group_scale(estimate))[:, : len(estimate.names)]
    if seen.size < len(estimate.names) or seen.size == 0:
        return 1.0
    size = np.linalg.norm(R, axis=0)
    stated = np.linalg.slogdet(estimate.covariance * np.outer(size, size))[1]
    white = 2.0 * np.log(np.abs(np.diag(np.linalg.qr(R / size, mode="r")))).sum()
    return float(np.exp((stated + white) / seen.size))
