"""An identification read from its folder, with what its figures draw."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from excite.identification.estimate import Estimate
from excite.identification.observations import Observations
from excite.identification.prediction import instantaneous_target
from excite.identification.reference_values import ReferenceValues
from excite.identification.result import StoredResult
from excite.information.target import IdentificationTarget
from excite.storage.curves_file import Arrays
from regressors.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class StoredEstimate:
    """What the figure of parameters shows of an identification."""

    robot: Robot
    target: IdentificationTarget
    estimate: Estimate
    reference: ReferenceValues | None  # values that the estimate is compared with


def stored_estimate(result: StoredResult) -> StoredEstimate:
    """Estimate and model of a result."""
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


@dataclass(frozen=True, eq=False)
class StoredFit:
    """What the figures of torques and residuals show of an identification."""

    robot: Robot
    observations: Observations  # equations in one parameter, of value 1, whose column is the prediction
    estimate: Estimate  # of that parameter


def stored_fit(result: StoredResult, arrays: Arrays) -> StoredFit:
    """Measured and predicted values of a result."""
    content = result.content
    observations = Observations(
        W=arrays["predicted"].astype(float)[:, None],
        y=arrays["measured"].astype(float),
        names=("prediction",),
        units=("",),
        equation=arrays["equation"].astype(np.intp),
        equations=tuple((str(name), str(unit)) for name, unit in content["equations"]),
        log=arrays["log"].astype(np.intp),
        logs=tuple(str(log["file"]) for log in content["logs"]),
        time=arrays["time"],
    )
    shape = len(observations.logs), len(observations.equations)
    estimate = Estimate(
        method=str(content["estimator"]),
        names=observations.names,
        units=observations.units,
        values=np.ones(1),
        covariance=np.zeros((1, 1)),
        noise=np.zeros(shape),
        degrees_of_freedom=content["degrees_of_freedom"],
    )
    return StoredFit(result.robot, observations, estimate)


def with_history(stored: StoredEstimate, arrays: Arrays) -> StoredEstimate:
    """The estimate with its values over time, of the recursive method."""
    history = arrays["history_time"], arrays["history"].astype(float)
    return replace(stored, estimate=replace(stored.estimate, history=history))


def _known(value: Any, unknown: float = np.nan) -> float:
    return unknown if value is None else float(value)
