"""Confidence intervals that allow for the uncertainty of known friction curves.

An error e of the curves' parameters p is the same in every row and in every log. To first order it changes the estimate
by ``G e``, with ``G = d beta / d p``. With the covariance C of p, independent of the logs, the covariance of the
estimate becomes ``Cov + G C G'``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from excite.identification.covariance import METHODS, divisors
from excite.identification.equations import right_sides
from excite.identification.estimate import Estimate
from excite.identification.estimator import solve_triangular_system
from excite.identification.estimators.huber import THRESHOLD
from excite.identification.known_friction import carried_torques
from excite.identification.observations import GroupFactors, Observations
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from regressors.errors import InputError
from regressors.friction.curves import FrictionCurves, changed, drives_with_friction
from regressors.samples import Array

_STEP = 1e-3  # of a parameter's deviation
_LEAST = 1.01  # times the deviation from the logs alone: smaller effects are not reported


@dataclass(frozen=True, eq=False)
class CurveEffect:
    """Effect of errors of known friction curves on an estimate."""

    parameters: tuple[tuple[str, str], ...]  # drive, and parameter of its curve
    correlation: Array  # (k, k) of these parameters
    changes: Array  # (p, k) change of the estimate by an error of one standard deviation of each parameter

    @property
    def covariance(self) -> Array:
        """``G C G'``, shape (p, p)."""
        return np.asarray(self.changes @ self.correlation @ self.changes.T)


def allowing_for_curves(
    estimate: Estimate,
    observations: Observations,
    target: IdentificationTarget,
    measured: Sequence[PreparedLog],
    recipe: Recipe,
    friction: FrictionCurves,
) -> Estimate:
    """Extend the covariance of an estimate, and so its intervals, by the uncertainty of the friction curves.

    Where errors of the curves have already increased the residuals, they count twice and the intervals are
    conservative.
    """
    moving = [name for name, _ in drives_with_friction(target.robot) if name in friction.curves]
    exact = [name for name in moving if name not in friction.uncertainty]
    if not moving:
        return estimate
    if len(exact) == len(moving):
        return replace(estimate, notes=(*estimate.notes, "intervals take the friction curves as exact"))
    if estimate.method not in METHODS:
        note = (
            "intervals do not allow for the uncertainty of the friction curves: it is "
            f"not implemented for {estimate.method}"
        )
        return replace(estimate, notes=(*estimate.notes, note))
    effect = curve_effect(estimate, observations, target, measured, recipe, friction.of(moving))
    seen = np.isfinite(np.diag(estimate.covariance))
    added = np.where(np.outer(seen, seen), effect.covariance, 0.0)
    wider = replace(estimate, covariance=estimate.covariance + added)
    return replace(wider, notes=(*estimate.notes, _note(estimate, wider, exact)))


def _note(before: Estimate, after: Estimate, exact: Sequence[str]) -> str:
    known = np.isfinite(before.deviation) & (before.deviation > 0)
    ratio = np.divide(after.deviation, before.deviation, out=np.ones_like(before.deviation), where=known)
    worst = int(np.argmax(ratio))
    note = "intervals allow for the uncertainty of the friction curves"
    if ratio[worst] < _LEAST:
        note += ", which changes them little"
    else:
        note += f": up to {ratio[worst]:.3g} times the deviation from the logs alone, of {before.names[worst]}"
    return f"{note}; those of {', '.join(exact)} are taken as exact" if exact else note


def curve_effect(
    estimate: Estimate,
    observations: Observations,
    target: IdentificationTarget,
    measured: Sequence[PreparedLog],
    recipe: Recipe,
    friction: FrictionCurves,
) -> CurveEffect:
    """Effect of errors of the curves on an estimate by one of `METHODS`; arguments as for `allowing_for_curves`.

    Weights and presliding settings are held fixed. For ``huber``, rows beyond its threshold do not count; for
    ``physical``, the effect is that on the estimate without constraints.
    """
    of_each = friction.uncertainty
    parameters = tuple((name, parameter) for name, known in of_each.items() for parameter in known.parameters)
    correlation = scipy.linalg.block_diag(*(known.correlation for known in of_each.values()))
    sides = np.concatenate([_right_side_changes(part, target, recipe, friction) for part in measured])
    return CurveEffect(parameters, correlation, estimate_changes(estimate, observations, sides))


def _right_side_changes(
    part: PreparedLog, target: IdentificationTarget, recipe: Recipe, friction: FrictionCurves
) -> Array:
    """Change of the right-hand side by an error of one standard deviation of each parameter, shape (m, k)."""
    carried = carried_torques(part, target.robot, recipe)
    changes = []
    for name, uncertainty in friction.uncertainty.items():
        each = zip(uncertainty.parameters, uncertainty.deviation.tolist(), strict=True)
        torques = [_torque_change(carried, friction, name, parameter, deviation) for parameter, deviation in each]
        changes.append(right_sides(target, part, recipe, np.array(torques)))
    return np.concatenate(changes, axis=1)


def _torque_change(
    carried: Callable[[FrictionCurves], Array], friction: FrictionCurves, name: str, parameter: str, deviation: float
) -> Array:
    """Change of the friction-free torques by one deviation of a parameter, by finite differences, shape (N, n).

    Differences are central, or one-sided where a step gives an invalid curve. The other drives' curves do not matter:
    the torque that a drive carries depends on its own friction alone.
    """
    curve = friction.curve(name)
    assert curve is not None
    if deviation == 0.0:
        return np.zeros_like(carried(FrictionCurves({name: curve})))
    changes, refused = {}, None
    for step in (-_STEP, _STEP):
        try:
            changes[step] = carried(FrictionCurves({name: changed(curve, {parameter: step * deviation})}))
        except InputError as error:  # for example where Coulomb friction is zero
            refused = error
    if not changes:
        raise InputError(f"uncertainty of the friction curve of {name}: {refused}") from refused
    if refused is not None:
        changes[0.0] = carried(FrictionCurves({name: curve}))
    low, high = min(changes), max(changes)
    return np.asarray((changes[high] - changes[low]) / (high - low))


def estimate_changes(estimate: Estimate, observations: Observations, changes: Array) -> Array:
    """Change of an estimate with its right-hand side, shape (p, k) for changes of shape (m, k)."""  # changes (m, k)
    divisor = divisors(estimate)
    if estimate.method == "huber":
        ratio = estimate.residual(observations) / divisor[observations.group]
        inside = np.flatnonzero(np.abs(ratio) <= THRESHOLD)
        observations, changes = observations.rows(inside), changes[inside]
    k = changes.shape[1]
    R = GroupFactors.of(observations, front=changes).stacked(divisor)
    half = solve_triangular_system(R[:, k:]).half
    return np.asarray(half @ ((R[:, k:-1] @ half).T @ R[:, :k]))
