"""What a result of joint torques was identified with, and what its data alone say of the base parameters."""

from __future__ import annotations

import numpy as np

from excite.identification.identification import Identification
from excite.identification.prediction import instantaneous_target
from excite.identification.result import IdentificationResult, StoredResult
from excite.information.target import IdentificationTarget
from regressors.errors import InputError
from regressors.robot.inertia import parameter_names
from regressors.samples import Array


def torque_target(result: IdentificationResult) -> IdentificationTarget:
    """Identification target of a result of joint torques, with the model at single instants."""
    if result.task.model.channel == "wrench":
        raise InputError(
            f"{result.name} is a result of a load, which has no robot to write: give its parameters (see result.json) "
            "as `payload` of a design or a simulation, or identify the robot from joint torques and export that result"
        )
    target = instantaneous_target(result.robot, result.task, result.recipe)
    if target.model.torque_equations() is None:
        raise InputError(
            f"{result.name} is of a model whose equations are not joint torques, so it has no robot to write"
        )
    if target.base.names != result.names:
        raise InputError(
            f"{result.name} has the parameters {', '.join(result.names)}, but its model has "
            f"{', '.join(target.base.names)}; identify again"
        )
    names = {column.name for column in target.model.standard_columns}
    for number, body in zip(target.robot.body_numbers, target.robot.bodies, strict=True):
        if not names >= set(parameter_names(number)):
            raise InputError(f"{result.name}: its model has no inertial parameters of link {body.name!r} to write")
    return target


def stated_covariance(result: IdentificationResult) -> Array | None:
    """Covariance of the base parameters, shape (b, b); NaN or infinite where it is not known, None without any."""
    if isinstance(result, Identification):
        return result.estimate.covariance
    if isinstance(result, StoredResult) and "covariance" in result.content:
        return np.array(result.content["covariance"], dtype=float)  # None becomes NaN
    return None


def unconstrained_estimate(result: IdentificationResult) -> Array:
    """Base parameters by the data alone, without bounds and pull where the result has them, shape (b,)."""
    if isinstance(result, Identification):
        free = result.estimate.unconstrained
        return result.coefficients if free is None else free
    if isinstance(result, StoredResult):
        entries = result.content["parameters"]
        if all("unconstrained" in entry for entry in entries):
            return np.array([float(entry["unconstrained"]) for entry in entries])
    return result.coefficients


def degrees_of_freedom(result: IdentificationResult) -> float:
    """Of Student's t for the intervals of a result; infinite where it does not state them."""
    if isinstance(result, Identification):
        return float(max(result.estimate.degrees_of_freedom, 1))
    known = result.content.get("degrees_of_freedom") if isinstance(result, StoredResult) else None
    return np.inf if known is None else float(max(known, 1))


def stated_mismatch(result: IdentificationResult) -> Array | None:
    """Second moments of the error by friction of other forms than the model's, shape (b, b); None without any."""
    if isinstance(result, Identification):
        return result.estimate.mismatch
    known = result.content.get("friction_mismatch") if isinstance(result, StoredResult) else None
    return None if known is None else np.array(known, dtype=float)
