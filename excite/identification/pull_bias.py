"""Intervals of an estimate that is pulled towards other values than the data's: the pull's bias enters them.

Constraints alone cost nothing: with true parameters that are possible, moving an estimate to the nearest possible one
moves it towards the truth, and the deviations without constraints hold for it. A pull is different. It biases the
estimate by ``b - b_0`` on average, with b_0 the estimate without pull, whose own noise makes that difference larger
still, so that ``Cov + (b - b_0)(b - b_0)'`` with the covariance of b_0 is on the safe side.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from excite.identification.estimate import Estimate
from excite.identification.estimator import Estimator
from excite.identification.estimators.weighted import weighted
from excite.identification.observations import Observations


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
