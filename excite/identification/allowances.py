"""Intervals that count what was not known exactly: one more column of the equations, with its deviation.

What is known with a deviation alone (parameters of friction curves, their fitted factors, gains of drives) enters the
equations as ``y = W beta + F e``. To first order an error e changes the estimate by ``G e``, with
``G = d beta / d e``, and its covariance C, independent of the noise, widens that of the estimate to ``Cov + G C G'``.

What was found from the same data enters as a parameter more. Near the estimate a presliding width w has the column
``d (W beta) / d log w``, a delay the column ``-d (W beta) / dt``; its value enters W, its uncertainty the intervals.

Of m terms that could be added, those are that explain most, noise included: what they explain is exaggerated, and what
is correlated with them is shifted. Intervals hold whatever was chosen if the added terms' own are as wide as for m
statements at once [Berk, Brown, Buja, Zhang, Zhao 2013, Annals of Statistics 41, 802], by Bonferroni's bound. With C
the covariance and J the added terms, ``C[:, J] C[J, J]^-1 C[J, :]`` is what they contribute to all parameters; it is
multiplied by the square of the ratio of the quantiles.

Constraints alone cost nothing: with true parameters that are possible, moving an estimate to the nearest possible one
moves it towards the truth, and the deviations without constraints hold for it. A pull is different. It biases the
estimate by ``b - b_0`` on average, with b_0 the estimate without pull, whose own noise makes that difference larger
still, so that ``Cov + (b - b_0)(b - b_0)'`` with the covariance of b_0 is on the safe side.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import scipy

from excite.identification.covariance import METHODS, divisors, robust_covariance, with_covariance
from excite.identification.equations import (
    constants,
    drive_directions,
    friction_drives,
    instant_columns,
    nuisance_columns,
    predicted_rows,
)
from excite.identification.estimator import (
    CONFIDENCE,
    Context,
    Estimate,
    Estimator,
    allowing_for,
    largest_share,
    noted,
    of_seen,
    solve_triangular_system,
)
from excite.identification.estimators.least_squares import weighted
from excite.identification.estimators.robust import THRESHOLD
from excite.identification.noise import noise_origin
from excite.identification.observations import GroupFactors, Observations
from excite.identification.prediction import carried_torques
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from regressors.errors import InputError
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.load_and_temperature import drives_with_friction
from regressors.robot.friction.uncertainty import changed, multiplied
from regressors.samples import Array, Index

PRESLIDING, DELAY, BIAS = FOUND = ("presliding", "delay", "bias")


def with_uncertainty(
    estimate: Estimate, observations: Observations, context: Context, *, found: frozenset[str]
) -> Estimate:
    """Covariance by the correlation of the residuals, and for settings that were found from the logs."""
    wider, rows = estimate, observations
    for name, column in found_columns(estimate, context, found):
        wider, rows = with_nuisance(wider, rows, column, name)
    wider = with_covariance(wider, rows, context.recipe.covariance, *noise_origin(context))
    return wider if rows is observations else without_nuisance(wider, estimate)


def found_columns(estimate: Estimate, context: Context, found: frozenset[str]) -> list[tuple[str, Array]]:
    """Names of the settings that were found, and their columns of the equations, shape (m,); see `with_uncertainty`."""
    if estimate.method not in METHODS:
        return []
    sizes = presliding_columns(context, estimate.coefficients).T if PRESLIDING in found else ()
    columns = [(PRESLIDING, column) for column in sizes]
    if DELAY in found:
        columns += [(DELAY, column) for column in delay_columns(context, estimate.coefficients).T]
    biases = nuisance_columns(context, constants).T[np.flatnonzero(context.recipe.bias or ())] if BIAS in found else ()
    return columns + [(BIAS, column) for column in biases if np.any(column)]


def delay_columns(context: Context, coefficients: Array) -> Array:
    """Change of the predicted torques with each delay, ``-d (W beta) / dt``, per sample time, shape (m, k).

    Torques that act later belong to an earlier motion. There is one delay of all, or one of each joint or log.
    """  # coefficients (p,)
    target, recipe = context.target, context.recipe
    late = np.atleast_1d(recipe.delay) != 0.0  # of all joints or of each
    logs: list[str | None] = [None] if np.any(late) else []
    logs += dict(recipe.log_delays or ())
    if not logs or target.model.window is not None:
        return np.zeros((0, 0))

    def change(part: PreparedLog) -> Array:
        slope = -np.gradient(predicted_rows(target, part.samples, recipe, coefficients), axis=0)
        r = len(target.model.row_labels)
        each = np.eye(r)[late] if late.size > 1 else np.ones((1, r))
        return np.concatenate([slope * each[:, None] * (log in (None, part.log.source)) for log in logs])

    return instant_columns(context, change)


_WIDTH_STEP = 0.05  # of log w


def presliding_columns(context: Context, coefficients: Array) -> Array:
    """Change of the predicted equations with the logarithm of the presliding size, or of each drive's, shape (m, k)."""
    # coefficients (p,)
    target, sizes = context.target, (context.recipe.sign_width or 0.0, context.recipe.breakaway or 0.0)
    if target.model.coulomb_friction() is None or not any(np.any(size) for size in sizes):
        return np.zeros((0, 0))

    def change(part: PreparedLog) -> Array:
        ahead, behind = (
            drive_directions(target.robot, part.samples, *(np.multiply(size, np.exp(step)) for size in sizes))
            for step in (_WIDTH_STEP, -_WIDTH_STEP)
        )
        assert ahead is not None
        assert behind is not None
        drives, slopes = friction_drives(target, part.samples), (ahead - behind) / (2 * _WIDTH_STEP)
        torque = np.zeros((max(map(np.size, sizes)), len(slopes), drives.rows.shape[1]))
        for k, (column, drive) in enumerate(zip(drives.columns, drives.drives, strict=True)):  # logs may be long
            own = slopes[:, drive] * drives.magnitudes[:, k] * coefficients[column]
            torque[drive if len(torque) > 1 else 0] += own[:, None] * drives.rows[k]
        return torque

    columns = instant_columns(context, change)
    return columns[:, np.any(columns, axis=0)]


def with_nuisance(
    estimate: Estimate, observations: Observations, column: Array, name: str = "nuisance parameter"
) -> tuple[Estimate, Observations]:
    """Estimate and observations with one more parameter, whose value is zero; its column widens the covariance."""
    # column (m,)
    wider = observations.beside(column[:, None], (name,))
    factors = [GroupFactors.of(rows).stacked(divisors(estimate)) for rows in (observations, wider)]
    plain, wide = (solve_triangular_system(R).half for R in factors)
    seen = np.isfinite(np.diag(estimate.covariance))
    white = np.sum(plain**2, axis=1)
    known = seen & (white > 0)
    ratio = float(np.median(np.diag(estimate.covariance)[known] / white[known])) if np.any(known) else 1.0
    extended = replace(
        estimate,
        names=wider.names,
        units=wider.units,
        values=np.append(estimate.values, 0.0),
        covariance=of_seen(ratio * wide @ wide.T, np.append(seen, True)),
        fit=np.append(estimate.coefficients, 0.0),
    )
    return extended, wider


def without_nuisance(estimate: Estimate, of: Estimate) -> Estimate:
    """Remove the last parameters again."""
    p = len(of.names)
    return replace(
        estimate, names=of.names, units=of.units, values=of.values, covariance=estimate.covariance[:p, :p], fit=of.fit
    )


def estimate_changes(estimate: Estimate, observations: Observations, changes: Array) -> Array:
    """Change of an estimate by one of `METHODS` with its right-hand side, shape (p, k) for changes of shape (m, k).

    Weights and presliding settings are held fixed. For ``huber``, rows beyond its threshold do not count; for
    ``physical``, the effect is that on the estimate without constraints.
    """  # changes (m, k)
    divisor = divisors(estimate)
    if estimate.method == "huber":
        ratio = estimate.residual(observations) / divisor[observations.group]
        inside = np.flatnonzero(np.abs(ratio) <= THRESHOLD)
        observations, changes = observations.rows(inside), changes[inside]
    k = changes.shape[1]
    R = GroupFactors.of(observations, front=changes).stacked(divisor)
    half = solve_triangular_system(R[:, k:]).half
    return np.asarray(half @ ((R[:, k:-1] @ half).T @ R[:, :k]))


_LITTLE = 1.01  # times the deviation from the logs alone: smaller effects are not reported


def allowing_for_curves(
    estimate: Estimate, observations: Observations, measured: Context, friction: FrictionCurves
) -> Estimate:
    """Extend the covariance of an estimate, and so its intervals, by the uncertainty of the friction curves.

    Where errors of the curves have already increased the residuals, they count twice: intervals are too wide.
    """
    moving = [name for name, _ in drives_with_friction(measured.target.robot) if name in friction.curves]
    exact = [name for name in moving if name not in friction.uncertainty]
    if not moving:
        return estimate
    if len(exact) == len(moving):
        return noted(estimate, "intervals take the friction curves as exact")
    if estimate.method not in METHODS:
        return noted(
            estimate,
            "the intervals leave out the uncertainty of the friction curves, which the estimator "
            f"{estimate.method} cannot include",
        )
    changes, correlation = curve_errors(estimate, observations, measured, friction.of(moving))
    wider = allowing_for(estimate, changes, covariance=correlation)
    worst, ratio = largest_share(estimate, wider.deviation)
    note = "the intervals include the uncertainty of the friction curves"
    if ratio < _LITTLE:
        note += ", which changes them little"
    else:
        note += f": up to {ratio:.3g} times the deviation from the logs alone, of {estimate.names[worst]}"
    return noted(wider, f"{note}; those of {', '.join(exact)} are taken as exact" if exact else note)


def curve_errors(
    estimate: Estimate, observations: Observations, measured: Context, friction: FrictionCurves
) -> tuple[Array, Array]:
    """Change of an estimate by one deviation of each parameter of the curves, and these parameters' correlation."""
    # result (p, k); result (k, k)

    def change(part: PreparedLog) -> Array:
        carried = carried_torques(part, measured.target.robot, measured.recipe)
        uncertain = (
            (name, *each)
            for name, known in friction.uncertainty.items()
            for each in zip(known.parameters, known.deviation.tolist(), strict=True)
        )
        return np.array([_torque_change(carried, friction, *each) for each in uncertain])

    correlation = scipy.linalg.block_diag(*(known.correlation for known in friction.uncertainty.values()))
    return estimate_changes(estimate, observations, nuisance_columns(measured, change)), correlation


_STEP = 1e-3  # of a parameter's deviation


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


def friction_columns(measured: Context, friction: FrictionCurves) -> tuple[tuple[str, ...], Array]:
    """Known friction of each moving drive with a curve, in the rows of the equations."""  # result (m, k)
    target, recipe = measured.target, measured.recipe
    names = curves_of_moving(target, friction)
    return names, nuisance_columns(measured, lambda part: friction_torques(target, part, friction, recipe))


def curves_of_moving(target: IdentificationTarget, friction: FrictionCurves) -> tuple[str, ...]:
    """Moving drives that have a friction curve."""
    moving = (name for name, row in drives_with_friction(target.robot) if np.any(row @ target.motion.matrix))
    return tuple(name for name in moving if friction.curve(name) is not None)


def friction_torques(
    target: IdentificationTarget, part: PreparedLog, friction: FrictionCurves, recipe: Recipe
) -> Array:
    """Joint torques of the known friction of each moving drive with a curve, shape (k, N, n)."""
    carried, names = carried_torques(part, target.robot, recipe), curves_of_moving(target, friction)
    torques = np.array([part.measured - carried(friction.of((name,))) for name in names])
    return torques.reshape(-1, *part.measured.shape)


def scaled_curves(friction: FrictionCurves, factors: Mapping[str, float]) -> FrictionCurves:
    """Curves times the factors of their drives, as exact."""
    curves = {name: curve for name in friction.curves if (curve := friction.curve(name)) is not None}
    return FrictionCurves({name: multiplied(curve, factors.get(name, 1.0)) for name, curve in curves.items()})


def fitted_scale(observations: Observations, measured: Context, friction: FrictionCurves) -> FrictionScale:
    """Factors of the curves that explain the logs best, all parameters identified along."""
    if not curves_of_moving(measured.target, friction):
        raise InputError("`friction_scale` scales friction curves, but no moving drive has one")
    names, F = friction_columns(measured, friction)
    extended = observations.held().beside(F, [f"scale.{name}" for name in names])
    estimate = robust_covariance(weighted(extended), extended)
    of_scale = slice(-len(names), None)
    change = estimate.values[of_scale]
    if unclear := [name for name, x in zip(names, change, strict=True) if not np.isfinite(x)]:
        raise InputError(f"the factors of the friction curves of {', '.join(unclear)} are not identifiable")
    scale = FrictionScale(names, 1.0 + change, estimate.covariance[of_scale, of_scale], estimate.half_width[of_scale])
    if np.any(scale.factor <= 0):
        raise InputError(f"{scale.note}; a factor must be positive: the curves are not of this robot's friction")
    return scale


def allowing_for_scale(
    estimate: Estimate, observations: Observations, measured: Context, friction: FrictionCurves, scale: FrictionScale
) -> Estimate:
    """Extend the covariance of an estimate by that of the factors; of least squares that of both estimated at once."""
    changes = estimate_changes(estimate, observations, friction_columns(measured, friction)[1])
    return allowing_for(estimate, changes, scale.note, covariance=scale.covariance)


def allowing_for_selection(estimate: Estimate, added: Sequence[int] | Index, candidates: int) -> Estimate:
    """Extend the covariance of an estimate by what choosing some of its terms does."""
    C, freedom = estimate.covariance, max(estimate.degrees_of_freedom, 1)
    J: Index = np.array([k for k in added if np.isfinite(C[k, k]) and C[k, k] > 0], dtype=np.intp)
    if not J.size or candidates < 2:
        return estimate
    tail = (1 - CONFIDENCE) / 2
    one, several = -scipy.special.stdtrit(freedom, [tail, tail / candidates])
    share = ((several / one) ** 2 - 1) * np.linalg.pinv(C[np.ix_(J, J)], hermitian=True)
    note = f"{J.size} of {candidates} possible terms were chosen by the same data, which the intervals include"
    return allowing_for(estimate, C[:, J], note, covariance=share)


def allowing_for_pull(estimate: Estimate, estimator: Estimator, observations: Observations) -> Estimate:
    """Extend the covariance of a pulled estimate by its distance from the estimate without pull."""
    if getattr(estimator, "described_within", None) is None:
        return estimate
    free = weighted(observations)
    seen = np.isfinite(np.diag(estimate.covariance)) & np.isfinite(free.values)
    bias = np.where(seen, estimate.values - free.values, 0.0)
    return allowing_for(estimate, bias, "the intervals reach as far as the estimate without the description")
