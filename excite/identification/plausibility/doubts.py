"""All checks of a result."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from excite.identification.observations import GroupFactors
from excite.identification.plausibility.expected_error import expected_error, few_data
from excite.identification.plausibility.impossible_parameters import (
    allowed_poses,
    described_coefficients,
    heavier_than_described,
    impossible_parameters,
    least_inertia,
    mass_matrix_check,
)
from excite.identification.plausibility.large_residual import (
    LARGEST,
    Doubt,
    NoisyDerivatives,
    ResidualCauses,
    large_residual,
    left_out_rows,
    missing_terms,
    noisy_derivatives,
    wrong_factors,
)
from excite.identification.prediction import LogPrediction, instantaneous_target, prediction, relative_error
from excite.identification.preparation import PreparedLog
from excite.information.target import IdentificationTarget
from excite.logs.signals.periods import mean_rate, measurement_noise, motion_ends
from regressors.models.nominal import standard_values
from regressors.robot.friction.load_and_temperature import drives_with_friction
from regressors.robot.plausibility import implausible_inertias
from regressors.samples import Array, Samples

if TYPE_CHECKING:
    from excite.identification.identification import Identification


def doubts_of(result: Identification) -> tuple[Doubt, ...]:
    """Reasons why a result cannot be right; empty if there are none."""
    target = instantaneous_target(result.robot, result.task, result.recipe)
    noise = _derivatives(result)
    checks = [left_out_rows(part.log.source, part.left_out_share) for part in result.prepared]
    residual = _residual(result, target, noise)
    checks.append(residual)
    if residual is None:  # else the others follow from it
        if target.base.names == result.names:
            checks += [_mass_matrix(result, target, noise), _gravity(result, target)]
        checks.append(impossible_parameters(result.estimate, result.target.base, _shares(result), noise))
    return tuple(doubt for doubt in checks if doubt is not None)


def warnings_of(result: Identification) -> tuple[Doubt, ...]:
    """What the logs do not determine, although the result may be right; empty if there is nothing."""
    target = instantaneous_target(result.robot, result.task, result.recipe)
    if target.base.names != result.names or _residual_size(result) > LARGEST:  # such a residual is no noise
        return ()
    expected = expected_error(target, result.observations, result.estimate, _travelled(result.prepared))
    warning = few_data(len(result.prepared), expected, result.estimate.method, _excess(result))
    return () if warning is None else (warning,)


def _excess(result: Identification) -> float:
    """Relative error of least squares in left-out blocks beyond that of the estimate's own rows; 0 where not known."""
    scored = [
        c.error for one in result.choices if one.name == "estimator" for c in one.candidates if c.value == "weighted"
    ]
    return float(np.sqrt(max(0.0, scored[0] ** 2 - _residual_size(result) ** 2))) if scored else 0.0


def _travelled(prepared: tuple[PreparedLog, ...]) -> Samples:
    """Motions of all logs, one after the other."""
    parts = [part.samples for part in prepared]
    if len(parts) == 1:
        return parts[0]
    return Samples(*(np.concatenate([getattr(s, name) for s in parts]) for name in ("time", "q", "dq", "ddq", "dddq")))


def _shares(result: Identification) -> Array:
    """``||W_j beta_j|| / ||y||``, shape (b,)."""
    size = float(np.linalg.norm(result.observations.y))
    factors = GroupFactors.of(result.observations)
    columns = factors.stacked(np.ones(len(factors.R)))[:, -result.target.base.rank - 1 : -1]
    sizes = np.linalg.norm(columns, axis=0) * np.abs(result.coefficients)
    return np.asarray(sizes / size if size > 0 else sizes)


def _residual_size(result: Identification) -> float:
    return relative_error(result.observations.y, result.estimate.predicted(result.observations))


def _derivatives(result: Identification) -> NoisyDerivatives:
    above = max(motion_ends(part.log.q, mean_rate(part.log.time)) for part in result.prepared)
    return noisy_derivatives(result.observations, result.estimate.predicted(result.observations), above)


def _mass_matrix(result: Identification, target: IdentificationTarget, noise: NoisyDerivatives) -> Doubt | None:
    poses = allowed_poses(target.robot, _travelled(result.prepared).q)
    least = least_inertia(target, result.coefficients, result.estimate.covariance, poses)
    return mass_matrix_check(least, result.estimate.method, noise)


def _gravity(result: Identification, target: IdentificationTarget) -> Doubt | None:
    """Torques of gravity over the allowed poses, against those of the description where that is to be believed."""
    known = described_coefficients(target.base, standard_values(target.robot))
    if known is None or target.model.torque_equations() is None or implausible_inertias(target.robot):
        return None
    q = allowed_poses(target.robot, _travelled(result.prepared).q)
    still = np.zeros_like(q)
    Y = target.model.instants(Samples(np.arange(len(q), dtype=float), q, still, still, still))[:, target.base.index]
    inertial = np.array([target.base.columns[j].group == "inertial" for j in target.base.index])
    return heavier_than_described(Y[:, inertial] @ result.coefficients[inertial], Y[:, inertial] @ known[inertial])


def _residual(result: Identification, target: IdentificationTarget, noise: NoisyDerivatives) -> Doubt | None:
    relative = _residual_size(result)
    if not relative > LARGEST or target.base.names != result.names:
        return None
    parts = [prediction(target, part, result.recipe, result.coefficients, result.friction) for part in result.prepared]
    return large_residual(relative, _noise(parts, noise.above), _causes(result, target, parts, noise))


def _noise(parts: list[LogPrediction], above: float) -> float:
    """Norm of the noise of the measurements over that of the measurements."""
    square = sum(
        p.time.size
        * float(np.sum(measurement_noise(p.measured, p.measured - p.predicted, mean_rate(p.time), above).square))
        for p in parts
        if p.time.size > 1
    )
    size = sum(float(np.sum(p.measured**2)) for p in parts)
    return float(np.sqrt(square / size)) if size > 0 else 0.0


def _causes(
    result: Identification, target: IdentificationTarget, parts: list[LogPrediction], noise: NoisyDerivatives
) -> ResidualCauses:
    observations, equations = result.observations, target.model.torque_equations()
    residual = np.concatenate([p.measured - p.predicted for p in parts])
    terms, per_joint = dict.fromkeys(("friction", "rotor", "offset"), 0.0), np.zeros(residual.shape[1])
    if equations is not None:
        speed = np.concatenate([p.speed for p in parts])
        along = [equations.speeds(part.samples.ddq) for part in result.prepared]
        acceleration = np.concatenate(
            [
                np.column_stack([np.interp(p.time, part.samples.time, column) for column in a.T])
                for p, part, a in zip(parts, result.prepared, along, strict=True)
            ]
        )
        terms, per_joint = missing_terms(residual, speed, acceleration)
    return ResidualCauses(
        tuple(name for name, _ in target.model.row_labels),
        wrong_factors(observations),
        noise,
        terms,
        tuple(per_joint.tolist()),
        _without_curve(result, target),
    )


def _without_curve(result: Identification, target: IdentificationTarget) -> tuple[str, ...]:
    """Drives that move and have no friction curve, where friction is known."""
    if result.friction is None:
        return ()
    speeds = np.concatenate([part.samples.dq for part in result.prepared])
    moving = [
        name for name, row in drives_with_friction(target.robot) if np.ptp(speeds @ np.asarray(row, dtype=float)) > 0
    ]
    return tuple(name for name in moving if name not in result.friction.curves)
