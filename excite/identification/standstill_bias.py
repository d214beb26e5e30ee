"""Rows near standstill, where friction may hold a drive, and the bias that they leave.

Friction that holds a drive is no function of the motion, and the filter blurs it into the rows beside. With a right
model, leaving out rows of slow drives changes an estimate by noise alone; where friction holds, by the bias as well
[Hausman 1978]. So the change ``d`` enters the intervals, ``Cov + d d'``, where rows near standstill show that the model
fails there: because they are left out, from those of drives faster than twice that speed; or because their residuals
are larger than the others'.

Friction of a drive at rest is what the rest of its torque asks for, not a function of the motion. A row of the
equations that contains it says nothing about the parameters then, and biases those of a small torque.
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
from excite.identification.friction_directions import drive_rows
from excite.identification.known_instants import nearest
from excite.identification.leading_autocorrelation import autocorrelation
from excite.identification.observations import Observations
from excite.identification.preparation import PreparedLog
from excite.identification.residuals import effective_samples
from excite.identification.row_stretches import row_stretches
from excite.identification.streamed_rows import StreamedRows
from excite.information.target import IdentificationTarget
from excite.logs.excitation import runs
from regressors.errors import ExciteError, InputError
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


SPEEDS = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4)  # candidates, of the typical speed of the drives that move
_NOTHING = 1e-12  # of a drive's torque in an equation


def without_standstill(part: PreparedLog, target: IdentificationTarget, speed: float | None) -> PreparedLog:
    """The log with the stretches of each equation in which a drive whose torque it contains hardly moves."""
    if not speed:
        return part
    equations = target.model.torque_equations()
    if equations is None:
        raise InputError("`standstill` is for models of joint torques at single instants")
    slow = least_speeds(part, target) < speed
    labels = [name for name, _ in target.model.row_labels]
    each = ", ".join(f"{100 * share:.2g} % of {name}" for name, share in zip(labels, slow.mean(axis=0), strict=True))
    note = f"rows left out while a drive is slower than {speed:.3g} rad/s (m/s), where friction may hold it: {each}"
    time = part.samples.time
    spans = tuple(tuple((float(time[a]), float(time[b - 1])) for a, b in runs(column)) for column in slow.T)
    return replace(part, standing=spans, notes=(*part.notes, note))


def standstill_candidates(target: IdentificationTarget, parts: Sequence[PreparedLog]) -> tuple[float, ...]:
    """Speeds for `without_standstill` to choose from, `SPEEDS` times the typical speed of the drives that move."""
    if target.model.torque_equations() is None:
        return (0.0,)
    typical = typical_speed(target, parts)
    return tuple(share * typical for share in SPEEDS) if typical > 0 else (0.0,)


def typical_speed(target: IdentificationTarget, parts: Sequence[PreparedLog]) -> float:
    """Median over the drives that move of the root mean square of their speed; 0 where none does [rad/s or m/s]."""
    speeds = np.concatenate([part.samples.dq for part in parts]) @ drive_rows(target.robot).T
    sizes = np.sqrt(np.mean(speeds**2, axis=0))
    return float(np.median(sizes[sizes > 0])) if np.any(sizes > 0) else 0.0


def least_speeds(part: PreparedLog, target: IdentificationTarget) -> Array:
    """Least speed of the drives whose torque each equation contains, shape (N, r); infinite where there is none."""
    equations = target.model.torque_equations()
    assert equations is not None
    rows = drive_rows(target.robot)
    speed = np.abs(part.samples.dq @ rows.T)
    acts = np.abs(rows @ equations.directions) > _NOTHING
    return np.column_stack([np.min(speed, axis=1, where=drives, initial=np.inf) for drives in acts.T])
