"""An estimate from each of several logs alone, by the same model, recipe and estimator."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from excite.identification.equations import equations
from excite.identification.estimate import Estimate
from excite.identification.estimator import Context, Estimator
from excite.identification.observations import Observations
from excite.identification.stated_uncertainty import with_uncertainty
from excite.identification.streamed_rows import StreamedRows
from regressors.errors import ExciteError
from regressors.samples import Array


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
    parts = context.prepared[k : k + 1]
    if isinstance(observations.W, StreamedRows):
        part = equations(context.target, parts, context.recipe)
    else:
        part = _of_log(observations.rows(rows), k)
    try:
        estimate = estimator.estimate(part, replace(context, prepared=parts))
    except ExciteError:
        return None
    return with_uncertainty(estimate, part, context.target, parts, context.recipe, found=found)


def _of_log(observations: Observations, k: int) -> Observations:
    noise = observations.noise
    return replace(
        observations,
        log=np.zeros_like(observations.log),
        logs=observations.logs[k : k + 1],
        noise=None if noise is None else noise[k : k + 1],
    )
