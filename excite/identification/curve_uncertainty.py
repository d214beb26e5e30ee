"""Intervals that allow for what is left open of known friction curves.

An error of a curve is the same in every row and in every log. To first order it moves the estimate by ``G e``, with
``G = d beta / d p``, so that with the covariance C of the curves' parameters p, independent of the logs, the estimate
has ``Cov + G C G'``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from excite.identification.covariance import METHODS, divisors
from excite.identification.equations import right_sides
from excite.identification.estimate import Estimate
from excite.identification.estimators.huber import THRESHOLD
from excite.identification.factors import GroupFactors
from excite.identification.known_friction import carried_torques
from excite.identification.observations import Observations
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.identification.solution import solve_triangular_system
from excite.information.target import IdentificationTarget
from regressors.errors import InputError
from regressors.friction.curves import FrictionCurves, changed, drives_with_friction
from regressors.samples import Array

_STEP = 1e-3  # of a parameter's deviation
_LEAST = 1.01  # times the deviation from the logs alone, to be told


@dataclass(frozen=True, eq=False)
class CurveEffect:
    """What errors of known friction curves do to an estimate.

    Parameters
    ----------
    parameters : tuple of (str, str)
        Drive, and parameter of its curve.
    correlation : ndarray, shape (k, k)
        Of these parameters.
    changes : ndarray, shape (p, k)
        Of the estimate, by an error of one standard deviation of each.
    """

    parameters: tuple[tuple[str, str], ...]
    correlation: Array
    changes: Array

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
    """The estimate with a covariance, and so intervals, that allow for the uncertainty of the curves.

    Residuals that come of an error of the curves may have widened the intervals before: then they are wider than need
    be.

    Parameters
    ----------
    estimate : Estimate
        With the covariance of the logs alone.
    observations : Observations
        What it was made of, friction taken off.
    target : IdentificationTarget
    measured : sequence of PreparedLog
        The logs before friction was taken off.
    recipe : Recipe
        With the turning of friction that was found.
    friction : FrictionCurves
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
    """What errors of the curves do to an estimate by one of `METHODS`, see `allowing_for_curves` for the arguments.

    Weights and what turns friction are kept as they are. Of ``huber``, rows beyond its threshold do not count; of
    ``physical``, it is what they do to the estimate without constraints.
    """
    of_each = friction.uncertainty
    parameters = tuple((name, parameter) for name, known in of_each.items() for parameter in known.parameters)
    correlation = scipy.linalg.block_diag(*(known.correlation for known in of_each.values()))
    sides = np.concatenate([_right_side_changes(part, target, recipe, friction) for part in measured])
    return CurveEffect(parameters, correlation, _estimate_changes(estimate, observations, sides))


def _right_side_changes(
    part: PreparedLog, target: IdentificationTarget, recipe: Recipe, friction: FrictionCurves
) -> Array:
    """How the right side changes by an error of one deviation of each parameter, shape (m, k)."""
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
    """Change of torques without friction by one deviation of a parameter, from small steps, shape (N, n).

    Steps are to both sides, or to the one where there is such friction. The other drives' curves do not matter: what a
    drive carries depends on its own friction alone.
    """
    curve = friction.curve(name)
    assert curve is not None
    if deviation == 0.0:
        return np.zeros_like(carried(FrictionCurves({name: curve})))
    changes, refused = {}, None
    for step in (-_STEP, _STEP):
        try:
            changes[step] = carried(FrictionCurves({name: changed(curve, {parameter: step * deviation})}))
        except InputError as error:  # as where there is no Coulomb friction at all
            refused = error
    if not changes:
        raise InputError(f"uncertainty of the friction curve of {name}: {refused}") from refused
    if refused is not None:
        changes[0.0] = carried(FrictionCurves({name: curve}))
    low, high = min(changes), max(changes)
    return np.asarray((changes[high] - changes[low]) / (high - low))


def _estimate_changes(estimate: Estimate, observations: Observations, changes: Array) -> Array:
    """How an estimate changes with its right side, shape (p, k) for changes of shape (m, k)."""
    divisor = divisors(estimate)
    if estimate.method == "huber":
        ratio = estimate.residual(observations) / divisor[observations.group]
        inside = np.flatnonzero(np.abs(ratio) <= THRESHOLD)
        observations, changes = observations.rows(inside), changes[inside]
    k = changes.shape[1]
    R = GroupFactors.of(observations, front=changes).stacked(divisor)
    half = solve_triangular_system(R[:, k:]).half
    return np.asarray(half @ ((R[:, k:-1] @ half).T @ R[:, :k]))
