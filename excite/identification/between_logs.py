"""Scatter of estimates between logs, beside what the noise of each log explains, and intervals that count it.

For a parameter with estimates b_k of deviation s_k from K logs, ``Q = sum_k (b_k - b)^2 / s_k^2`` about their weighted
mean b. If noise were all, ``Q / (K - 1)`` would be about one. What changes from log to log (temperature, the payload's
seat, what the model leaves out in this motion) is not in the residuals of any one log, so that its size is known from
K - 1 differences only: an interval by Student's t from these alone is useless for two logs. Parameters of the same kind
scatter alike, so that the mean over the friction coefficients, and over the others, counts as one log more:

    variance = s^2 max(1, m, (m + (K - 1) Q / (K - 1)) / K),    K degrees of freedom,

with the variance s^2 for noise alone, and the mean m over the parameters of ``Q / (K - 1)``, at least one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import scipy
from numpy.typing import NDArray

from excite.identification.allowances import with_uncertainty
from excite.identification.equations import equations
from excite.identification.estimator import CONFIDENCE, Context, Estimate, Estimator, noted
from excite.identification.observations import Observations
from excite.identification.streamed_rows import StreamedRows
from regressors.errors import ExciteError
from regressors.samples import Array

TYPICAL = 1.2  # largest scatter between two logs of a real robot over stated deviations, benchmarks/real


@dataclass(frozen=True, eq=False)
class LogScatter:
    """Scatter of p parameters between logs.

    Parameters
    ----------
    each : EachLog
    counts : ndarray of int, shape (p,)
        Logs from which each parameter is identifiable alone.
    means : ndarray, shape (p,)
        Mean of the estimates weighted by their precision; NaN where there are fewer than two.
    ratios : ndarray, shape (p,)
        ``Q / (K - 1)``; NaN where there are fewer than two estimates.
    probabilities : ndarray, shape (p,)
        Of a scatter as large or larger from noise alone, by Welch's test [Welch 1951], which allows for the
        uncertainty of the deviations; for many rows it is that of ``Q`` by chi squared. NaN likewise.
    """

    listed: ClassVar[bool] = True

    each: EachLog
    counts: Array
    means: Array
    ratios: Array
    probabilities: Array

    @property
    def rms(self) -> float:
        """Root mean square of the ratios: how many times the scatter is what noise explains; NaN without any."""
        known = self.ratios[np.isfinite(self.ratios)]
        return float(np.sqrt(known.mean())) if known.size else np.nan

    @property
    def exceeding(self) -> tuple[str, ...]:
        """Parameters whose scatter noise does not explain, by Holm's procedure at 1 % for all of them together."""
        known = np.flatnonzero(np.isfinite(self.probabilities))
        exceeding = []
        for rank, k in enumerate(known[np.argsort(self.probabilities[known])]):
            if not self.probabilities[k] < (1 - CONFIDENCE) / (known.size - rank):
                break
            exceeding.append(int(k))
        return tuple(self.each.names[k] for k in sorted(exceeding))

    def factors(self) -> Array:
        """Factor of each variance for noise alone, shape (p,): at least one."""
        known = np.isfinite(self.ratios)
        factors = np.ones(known.size)
        for kind in (self.each.friction, ~self.each.friction):
            some = kind & known
            mean = max(1.0, float(self.ratios[some].mean())) if np.any(some) else 1.0
            K = np.maximum(self.counts, 2)
            own = np.where(known, (mean + (K - 1) * np.nan_to_num(self.ratios)) / K, mean)
            factors[kind] = np.maximum(own, mean)[kind]
        return factors


def log_scatter(each: EachLog) -> LogScatter:
    """Scatter between logs."""
    seen = np.isfinite(each.deviations) & (each.deviations > 0) & np.isfinite(each.values)
    weights = np.divide(1.0, each.deviations**2, out=np.zeros(seen.shape), where=seen)
    counts, total = seen.sum(axis=0), weights.sum(axis=0)
    enough = counts >= 2
    with np.errstate(divide="ignore", invalid="ignore"):
        means = np.where(enough, np.nansum(weights * np.nan_to_num(each.values), axis=0) / total, np.nan)
        squares = np.sum(weights * (np.nan_to_num(each.values) - means) ** 2, axis=0)
        ratios = np.where(enough, squares / (counts - 1), np.nan)
    return LogScatter(each, counts, means, ratios, _probabilities(each, weights, counts, ratios))


def _probabilities(each: EachLog, weights: Array, counts: Array, ratios: Array) -> Array:
    """Welch's test of equal means with unequal, estimated variances, shape (p,)."""
    probabilities = np.full(counts.size, np.nan)
    for j in np.flatnonzero(np.isfinite(ratios)):
        w, K = weights[weights[:, j] > 0, j], float(counts[j])
        freedom = each.degrees_of_freedom[weights[:, j] > 0]
        spread = float(np.sum((1 - w / w.sum()) ** 2 / freedom))
        F = ratios[j] / (1 + 2 * (K - 2) / (K**2 - 1) * spread)
        probabilities[j] = scipy.special.fdtrc(K - 1, (K**2 - 1) / (3 * spread), F)
    return probabilities


def allowing_for_logs(estimate: Estimate, scatter: LogScatter) -> Estimate:
    """Extend the intervals of an estimate from several logs by their scatter."""
    if not np.any(np.isfinite(scatter.ratios)):
        note = (
            "no parameter is identifiable from two of the logs alone: the intervals leave out the scatter between logs"
        )
        return noted(estimate, note)
    factor = np.sqrt(scatter.factors())
    seen = np.isfinite(np.diag(estimate.covariance))
    wider = np.where(np.outer(seen, seen), estimate.covariance * np.outer(factor, factor), estimate.covariance)
    K = len(scatter.each.logs)
    note = (
        f"estimates from the {K} logs scatter {scatter.rms:.2g} times as much as noise explains; the intervals include "
        f"that (deviations up to {factor.max():.2g} times those for noise alone, Student's t with {K} degrees of "
        "freedom), and more logs narrow them"
    )
    freedom = min(K, estimate.degrees_of_freedom)
    return noted(replace(estimate, covariance=wider, degrees_of_freedom=freedom), note)


def scatter_warning(scatter: LogScatter) -> str | None:
    """Name the parameters that differ between logs by more than their intervals say; None where there are none."""
    if not (names := scatter.exceeding):
        return None
    return (
        f"{', '.join(names)} differ{'s' * (len(names) == 1)} from log to log by more than noise explains (Welch's test "
        "at 1 % for all parameters together): check whether temperature or payload changed; otherwise the model lacks "
        "something that the motions excite differently"
    )


def interval_scope(logs: int) -> str:
    """Describe what the intervals of a result hold for."""
    if logs == 1:
        return (
            "the intervals cover the noise of this log alone: on two real robots, estimates from different logs "
            f"scattered up to {TYPICAL:g} times as much as stated; identify from several logs to include that"
        )
    return f"the intervals hold across logs such as these {logs}"


@dataclass(frozen=True, eq=False)
class EachLog:
    """Estimates from K logs, each from one of them alone; p parameters."""

    listed: ClassVar[bool] = True

    logs: tuple[str, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    # (p,) which parameters are coefficients of friction, which changes with temperature, wear and lubrication
    friction: NDArray[np.bool_]
    # (K, p) estimates, and the standard deviation that each log's own residuals give them; NaN and infinite where a
    # parameter is not identifiable from a log alone
    values: Array
    deviations: Array  # (K, p)
    degrees_of_freedom: Array  # (K,) of these deviations


def estimate_each(
    estimator: Estimator, observations: Observations, context: Context, *, found: frozenset[str]
) -> EachLog:
    """Estimate from every log alone."""
    count, base = len(observations.logs), context.target.base
    values = np.full((count, len(observations.names)), np.nan)
    deviations, freedom = np.full(values.shape, np.inf), np.ones(count)
    for k in range(count):
        alone = _alone(estimator, observations, context, k, found)
        if alone is not None:
            values[k], deviations[k], freedom[k] = alone.values, alone.deviation, alone.degrees_of_freedom
    friction = np.array([base.columns[k].group == "friction" for k in base.index])
    return EachLog(observations.logs, observations.names, observations.units, friction, values, deviations, freedom)


def _alone(
    estimator: Estimator, observations: Observations, context: Context, k: int, found: frozenset[str]
) -> Estimate | None:
    """Estimate from log k; None where it has too few equations, or none that the estimator can use."""
    rows = np.flatnonzero(observations.log == k)
    if rows.size <= len(observations.names):
        return None
    alone = replace(context, prepared=context.prepared[k : k + 1])
    if isinstance(observations.W, StreamedRows):
        part = equations(alone.target, alone.prepared, alone.recipe)
    else:
        noise = None if observations.noise is None else observations.noise[k : k + 1]
        first, logs = np.zeros(rows.size, dtype=np.intp), observations.logs[k : k + 1]
        part = replace(observations.rows(rows), log=first, logs=logs, noise=noise)
    try:
        estimate = estimator.estimate(part, alone)
    except ExciteError:
        return None
    return with_uncertainty(estimate, part, alone, found=found)
