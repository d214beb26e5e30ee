"""Predictions of a model at the instants of a log, next to its unfiltered measurements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from excite.identification.equations import predicted_rows
from excite.identification.known_friction import known_torque
from excite.identification.preparation import PreparedLog, measured_channel
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget, target_of
from excite.logs.saturation import within
from excite.tasks.task import Task
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.robot import Robot
from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class LogPrediction:
    """Measured and predicted values, at the instants of a log that its filtered motion covers."""

    time: Array  # (N,) [s]
    # (N, r) measured ones as recorded, not filtered; not those while a torque was at its limit [units of the
    # equations]
    measured: Array
    predicted: Array  # (N, r)
    speed: Array  # (N, r) of each equation's coordinate [rad/s or m/s]; NaN where it has none, such as for a wrench
    left_out: NDArray[np.bool_]  # (N,) instants that make no equations, since something happened to the log


def relative_error(measured: Array, predicted: Array) -> float:
    """``||y - y_predicted|| / ||y||`` over all equations, in their units; infinite where nothing was measured."""
    size = float(np.linalg.norm(measured))
    return float(np.linalg.norm(measured - predicted)) / size if size > 0 else np.inf


def instantaneous_target(robot: Robot, task: Task, recipe: Recipe) -> IdentificationTarget:
    """Identification target with the instantaneous form of a task's model, also of one that integrates over windows."""
    return target_of(robot, task, recipe.common_width, instantaneous=True)


def prediction(
    target: IdentificationTarget,
    part: PreparedLog,
    recipe: Recipe,
    coefficients: Array,
    friction: FrictionCurves | None = None,
) -> LogPrediction:
    """Predict the measurements of a log along its filtered motion."""  # coefficients (b,)
    model, log, samples = target.model, part.log, part.samples
    r = len(model.row_labels)
    predicted = predicted_rows(target, samples, recipe.breakaway or 0.0, recipe.sign_width or 0.0, coefficients)
    if friction is not None:
        known = known_torque(friction, target, samples, recipe, predicted, part.temperature)
        predicted = predicted + model.right_side(samples, known).reshape(-1, r)
    inside = (log.time >= samples.time[0]) & (log.time <= samples.time[-1]) & ~within(log.time, part.saturated)
    time = log.time[inside]
    measured = model.right_side(samples, measured_channel(log, target)[inside]).reshape(-1, r)
    speed = _at(time, samples.time, model.speeds(samples))
    return LogPrediction(time, measured, _at(time, samples.time, predicted), speed, within(time, part.left_out))


def _at(time: Array, known: Array, values: Array) -> Array:
    """Values interpolated linearly between their instants, shape (N, r)."""
    if np.array_equal(time, known):
        return values
    return np.column_stack([np.interp(time, known, column) for column in values.T])
