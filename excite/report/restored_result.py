"""The parameters of an identification read from its folder, for their figure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from excite.identification.estimate import Estimate
from excite.identification.prediction import instantaneous_target
from excite.identification.reference_values import ReferenceValues
from excite.identification.result import StoredResult
from excite.information.target import IdentificationTarget
from regressors.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class StoredEstimate:
    """What the figure of parameters shows of an identification.

    Parameters
    ----------
    robot : Robot
    target : IdentificationTarget
    estimate : Estimate
    reference : ReferenceValues or None
        Values that the estimate is compared with.
    """

    robot: Robot
    target: IdentificationTarget
    estimate: Estimate
    reference: ReferenceValues | None


def stored_estimate(result: StoredResult) -> StoredEstimate:
    """Estimate and model of a result.

    Parameters
    ----------
    result : StoredResult

    Raises
    ------
    InputError
        A user-defined part that the result only names.
    """
    content = result.content
    parameters = content["parameters"]
    estimate = Estimate(
        method=content["estimator"],
        names=result.names,
        units=result.units,
        values=np.array([_known(each["value"]) for each in parameters]),
        covariance=np.diag([_known(each["standard_deviation"], np.inf) ** 2 for each in parameters]),
        noise=np.zeros((1, 1)),
        degrees_of_freedom=content["degrees_of_freedom"],
        unseen=tuple(content["unseen"]),
        fit=result.coefficients,
    )
    values = np.array([_known(each["reference"]) for each in parameters])
    reference = None if content["reference"] is None else ReferenceValues(content["reference"], values)
    return StoredEstimate(
        result.robot, instantaneous_target(result.robot, result.task, result.recipe), estimate, reference
    )


def _known(value: Any, unknown: float = np.nan) -> float:
    return unknown if value is None else float(value)
