"""Bias of an estimate by friction near standstill, and intervals that allow for it.

Friction that holds a drive is no function of the motion, and the filter blurs it into the rows beside. With a right
model, leaving out rows of slow drives changes an estimate by noise alone; where friction holds, by the bias as well
[Hausman 1978]. So the change ``d`` enters the intervals, ``Cov + d d'``, where rows near standstill show that the model
fails there: because they are left out, from those of drives faster than twice that speed; or because their residuals
are larger than the others'.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.stats
from numpy.typing import NDArray

from excite.identification.covariance import METHODS, group_scale
from excite.identification.estimate import CONFIDENCE, Estimate
from excite.identification.estimator import Context, Estimator
from excite.identification.known_instants import nearest
from excite.identification.leading_autocorrelation import autocorrelation
from excite.identification.observations import Observations
from excite.identification.preparation import PreparedLog
from excite.identification.residuals import effective_samples
from excite.identification.row_stretches import row_stretches
from excite.identification.standstill import least_speeds, typical_speed
from excite.identification.streamed_rows import StreamedRows
from regressors.errors import ExciteError
from regressors.samples import Array

_SLOW = 0.1  # of the typical speed: rows of slower drives are compared with the others
_FASTER = 2.0  # of the speed below which rows are left out
_INSTANTS = 100_000  # of a log, that the typical speed is found from
_SAID = 0.5  # change over deviation that is worth a note


def allowing_for_standstill(
    estimate: Estimate, estimator: Estimator, observations: Observations, context: Context
) -> Estimate:
    """Extend the covariance of an estimate by its change without rows near standstill, where friction holds there."""
    target, recipe = context.target, context.recipe
    if estimate.method not in METHODS or target.model.torque_equations() is None:
        return estimate
    if target.model.coulomb_friction() is None:
        return estimate
    shown = _held(observations)
    speed = _FASTER * recipe.standstill if recipe.standstill else _SLOW * typical_speed(target, _thinned(context))
    fast = fast_rows(shown, context, speed)
    if fast.all() or not (recipe.standstill or fails_near_standstill(estimate, shown, fast)):
        return estimate
    try:
        before = estimate if shown is observations else estimator.estimate(shown, context)
        other = estimator.estimate(shown.rows(np.flatnonzero(fast)), context)
    except ExciteError:
        note = (
            f"rows of drives faster than {speed:.3g} rad/s (m/s) are too few to tell what friction near standstill does"
        )
        return replace(estimate, notes=(*estimate.notes, note))
    seen = np.isfinite(np.diag(estimate.covariance))
    # what moving drives do not show is known from rows near standstill alone
    change = np.where(np.isfinite(other.values), other.coefficients - before.coefficients, estimate.coefficients)
    change = np.where(seen, change, 0.0)
    return replace(
        estimate,
        covariance=estimate.covariance + np.outer(change, change),
        notes=(*estimate.notes, *_note(estimate, change, speed)),
    )


def _held(observations: Observations) -> Observations:
    """The observations themselves; of streamed ones, stretches that stand for all."""
    if not isinstance(observations.W, StreamedRows):
        return observations
    rows = [np.arange(stretch.start, stretch.stop) for stretch in row_stretches(observations)]
    return observations.rows(np.concatenate(rows))


def _thinned(context: Context) -> list[PreparedLog]:
    """The logs at few instants, as far as these are."""
    steps = [max(1, part.samples.time.size // _INSTANTS) for part in context.prepared]
    every = (slice(None, None, step) for step in steps)
    return [replace(p, samples=p.samples.rows(which)) for p, which in zip(context.prepared, every, strict=True)]


def fast_rows(observations: Observations, context: Context, speed: float) -> NDArray[np.bool_]:
    """Rows of the equations whose drives are faster than a speed, shape (m,)."""
    fast = np.ones(observations.y.size, dtype=bool)
    for log, part in enumerate(context.prepared):
        rows = np.flatnonzero(observations.log == log)
        instants, which = np.unique(nearest(part.samples.time, observations.time[rows]), return_inverse=True)
        speeds = least_speeds(replace(part, samples=part.samples.rows(instants)), context.target)
        fast[rows] = speeds[which, observations.equation[rows]] >= speed
    return fast


def fails_near_standstill(estimate: Estimate, observations: Observations, fast: NDArray[np.bool_]) -> bool:
    """True if residuals are larger in rows near standstill than in the others, beyond what noise does in 1 % of cases.

    Their mean squares in units of each group's noise are compared, with a normal distribution of variance
    ``2 / n_slow + 2 / n_fast`` in effective rows, see `excite.identification.residuals`.
    """  # fast (m,)
    residual, group = estimate.residual(observations), observations.group
    squares = (residual / group_scale(estimate)[group]) ** 2
    share = np.ones(observations.y.size)
    for g in np.flatnonzero(np.bincount(group)):
        rows = group == g
        count = int(np.count_nonzero(rows))
        share[rows] = effective_samples(autocorrelation(residual[rows]), count) / count
    slow, quick = (max(2.0, float(share[rows].sum())) for rows in (~fast, fast))
    if not np.any(fast):
        return False
    excess = float(squares[~fast].mean() / squares[fast].mean()) - 1.0
    return excess > float(scipy.stats.norm.ppf(CONFIDENCE)) * float(np.sqrt(2 / slow + 2 / quick))


def _note(estimate: Estimate, change: Array, speed: float) -> Sequence[str]:
    deviation = estimate.deviation
    relative = np.divide(
        np.abs(change), deviation, out=np.zeros_like(change), where=np.isfinite(deviation) & (deviation > 0)
    )
    worst = int(np.argmax(relative))
    if relative[worst] < _SAID:
        return ()
    return (
        f"friction near standstill: without rows of drives slower than {speed:.3g} rad/s (m/s) {estimate.names[worst]} "
        f"changes most, by {relative[worst]:.2g} of its deviations; the intervals allow for that",
    )
