"""What a result of joint torques was identified with, and what its data alone say of the base parameters."""

from __future__ import annotations

import numpy as np

from excite.identification.identification import Identification
from excite.identification.prediction import instantaneous_target
from excite.information.target import IdentificationTarget
from regressors.errors import InputError
from regressors.robot.inertia import parameter_names
from regressors.samples import Array


def torque_target(result: Identification) -> IdentificationTarget:
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


def stated_covariance(result: Identification) -> Array | None:
    """Covariance of the base parameters, shape (b, b), infinite where one is not identified; None where not stated."""
    C = result.estimate.covariance
    seen = np.isfinite(np.diag(C))
    return C if np.isfinite(C[np.ix_(seen, seen)]).all() else None


def unconstrained_estimate(result: Identification) -> Array:
    """Base parameters by the data alone, without bounds and pull where the result has them, shape (b,)."""
    free = result.estimate.unconstrained
    return result.coefficients if free is None else free
