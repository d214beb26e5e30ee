"""Known friction curves scaled by one fitted factor for each drive: another day, another temperature.

With the curves subtracted, ``y = W beta + F c``: column k of F is the friction of drive k, whose factor is ``1 + c_k``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from excite.identification.covariance import robust_covariance
from excite.identification.curve_uncertainty import estimate_changes
from excite.identification.equations import right_sides
from excite.identification.estimate import Estimate
from excite.identification.estimators.weighted import weighted
from excite.identification.known_friction import carried_torques
from excite.identification.observations import Observations
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from regressors.errors import InputError
from regressors.friction.curves import FrictionCurves, drives_with_friction
from regressors.friction.multiplied import multiplied
from regressors.samples import Array

PREFIX = "scale."


@dataclass(frozen=True, eq=False)
class FrictionScale:
    """Fitted factors of known friction curves.

    Parameters
    ----------
    drives : tuple of str, length k
    factor : ndarray, shape (k,)
    covariance : ndarray, shape (k, k)
    half_width : ndarray, shape (k,)
        Half of the 99 % interval.
    """

    listed: ClassVar[bool] = True

    drives: tuple[str, ...]
    factor: Array
    covariance: Array
    half_width: Array

    @property
    def factors(self) -> dict[str, float]:
        """Factor of each drive, by name."""
        return dict(zip(self.drives, self.factor.tolist(), strict=True))

    def of(self, friction: FrictionCurves) -> FrictionCurves:
        """The curves times their factors, as exact."""
        return scaled_curves(friction, self.factors)

    @property
    def note(self) -> str:
        """The factors in words."""
        rows = zip(self.drives, self.factor, self.half_width, strict=True)
        return "known friction is scaled: " + ", ".join(f"{name} by {f:.3f} +- {half:.2g}" for name, f, half in rows)

    def content(self) -> dict[str, Any]:
        """Factors with their 99 % intervals as plain values, by drive."""
        rows = zip(self.drives, self.factor, self.half_width, strict=True)
        return {name: {"factor": float(f), "interval": [float(f - half), float(f + half)]} for name, f, half in rows}


def friction_columns(
    target: IdentificationTarget, part: PreparedLog, friction: FrictionCurves, recipe: Recipe
) -> tuple[tuple[str, ...], Array]:
    """Known friction of each moving drive with a curve, in the rows of a log's equations."""  # result (m, k)
    names, torques = friction_torques(target, part, friction, recipe)
    return names, right_sides(target, part, recipe, torques)


def friction_torques(
    target: IdentificationTarget, part: PreparedLog, friction: FrictionCurves, recipe: Recipe
) -> tuple[tuple[str, ...], Array]:
    """Joint torques of the known friction of each moving drive with a curve."""  # result (k, N, n)
    moving = [name for name, row in drives_with_friction(target.robot) if np.any(row @ target.motion.matrix)]
    names = tuple(name for name in moving if friction.curve(name) is not None)
    carried = carried_torques(part, target.robot, recipe)
    torques = np.array([part.measured - carried(friction.of((name,))) for name in names])
    return names, torques.reshape(-1, *part.measured.shape)


def scaled_curves(friction: FrictionCurves, factors: Mapping[str, float]) -> FrictionCurves:
    """Curves times the factors of their drives, as exact."""
    curves = {name: curve for name in friction.curves if (curve := friction.curve(name)) is not None}
    return FrictionCurves({name: multiplied(curve, factors.get(name, 1.0)) for name, curve in curves.items()})


def fitted_scale(
    observations: Observations,
    target: IdentificationTarget,
    measured: Sequence[PreparedLog],
    friction: FrictionCurves,
    recipe: Recipe,
) -> FrictionScale:
    """Factors of the curves that explain the logs best, all parameters identified along."""
    pairs = [friction_columns(target, part, friction, recipe) for part in measured]
    names, F = pairs[0][0], np.concatenate([columns for _, columns in pairs])
    if not names:
        raise InputError("`friction_scale` scales friction curves, but no moving drive has one")
    extended = replace(
        observations,
        W=np.hstack([observations.matrix, F]),
        names=(*observations.names, *(PREFIX + name for name in names)),
        units=(*observations.units, *("1",) * len(names)),
    )
    estimate = robust_covariance(weighted(extended), extended)
    change, half = estimate.values[-len(names) :], estimate.half_width[-len(names) :]
    if unclear := [name for name, x in zip(names, change, strict=True) if not np.isfinite(x)]:
        raise InputError(f"the factors of the friction curves of {', '.join(unclear)} are not identifiable")
    covariance = estimate.covariance[-len(names) :, -len(names) :]
    scale = FrictionScale(names, 1.0 + change, covariance, half)
    if np.any(scale.factor <= 0):
        raise InputError(f"{scale.note}; a factor must be positive: the curves are not of this robot's friction")
    return scale


def allowing_for_scale(
    estimate: Estimate,
    observations: Observations,
    target: IdentificationTarget,
    measured: Sequence[PreparedLog],
    friction: FrictionCurves,
    recipe: Recipe,
    scale: FrictionScale,
) -> Estimate:
    """Extend the covariance of an estimate by that of the factors, ``Cov + G C G'``.

    For least squares this is the covariance of both estimated at once.
    """
    columns = np.concatenate([friction_columns(target, part, friction, recipe)[1] for part in measured])
    steps = estimate_changes(estimate, observations, columns)
    covariance = estimate.covariance + steps @ scale.covariance @ steps.T
    return replace(estimate, covariance=covariance, notes=(*estimate.notes, scale.note))
