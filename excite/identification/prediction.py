"""Predicted measurements, and known friction, which is subtracted from the measured ones [KD96] eq. (19), (21)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from excite.identification.equations import drive_directions, measured_rows, predicted_rows
from excite.identification.estimator import CONFIDENCE, Estimate
from excite.identification.observations import Observations
from excite.identification.preparation import HELD, PreparedLog, measured_channel
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget, target_of
from excite.logs.event import within
from excite.logs.signals.method import interpolated
from excite.tasks.model_choice import FRICTION
from excite.tasks.model_options import without_curve
from excite.tasks.robot_of_task import moving_robot
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.robot.columns import COULOMB, VISCOUS
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.load_and_temperature import (
    carried_along,
    drive_temperatures,
    drives_with_friction,
    friction_rows,
    moving_drive_numbers,
    temperature_notes,
)
from regressors.robot.moving_base import BASE_JOINTS
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples


def without_friction(
    part: PreparedLog, target: IdentificationTarget, friction: FrictionCurves, recipe: Recipe
) -> PreparedLog:
    """Subtract known friction from the measured torques of a log."""
    carried = carried_torques(part, target.robot, recipe)(friction)
    notes = (
        *_missing_curves(part.samples, target, friction),
        *known_temperatures(part, target.robot, friction, recipe),
        *friction.speed_notes(target.robot, part.samples.dq),
    )
    return replace(part, measured=carried, notes=(*part.notes, *notes))


def beside_curves(task: Task, robot: Robot, friction: FrictionCurves) -> Task:
    """The task without curves of its own, whose friction columns are those of the drives without a curve."""
    moving = moving_robot(robot, task)
    left = {name: without_curve(getattr(task.model, name), moving, friction) for name in FRICTION}
    return task.changed(**left, friction_curves=None)


def _missing_curves(samples: Samples, target: IdentificationTarget, friction: FrictionCurves) -> tuple[str, ...]:
    """Notes on the drives without a curve that move in a log: identified with the rest, or frictionless as asked."""
    robot, numbers = target.robot, moving_drive_numbers(target.robot)
    turned = np.ptp(samples.q @ friction_rows(robot).T, axis=0) > HELD
    turning = [name for (name, _), turns in zip(drives_with_friction(robot), turned, strict=True) if turns]
    without = [name for name in turning if friction.curve(name) is None]
    columns = {column.owner for column in target.model.standard_columns if column.kind in (COULOMB, VISCOUS)}
    identified = [name for name in without if numbers[name] in columns]
    frictionless = [name for name in without if numbers[name] not in columns]
    notes = [f"no friction curve of {', '.join(identified)}: identified with the rest"] if identified else []
    if frictionless:
        described, names = FrictionCurves.of_robot(robot), ", ".join(frictionless)
        note = f"no friction curve of {names}, and no friction columns, as asked: assumed to have no friction"
        if stated := [name for name in frictionless if described.curve(name) is not None]:
            note += (
                f", though the robot's description states friction for {', '.join(stated)}: give `friction=True` to "
            )
            note += "identify it"
        notes.append(note)
    return tuple(notes)


def carried_torques(part: PreparedLog, robot: Robot, recipe: Recipe) -> Callable[[FrictionCurves], Array]:
    """Joint torques of a log without friction, as a function of the friction curves."""
    samples = part.samples
    direction = drive_directions(robot, samples, recipe.sign_width, recipe.breakaway)
    drive_temperature = of_drives(robot, part.temperature)

    def carried(friction: FrictionCurves) -> Array:
        return friction.carried_torque(robot, samples.q, samples.dq, part.measured, direction, drive_temperature)

    return carried


def known_torque(
    friction: FrictionCurves,
    target: IdentificationTarget,
    samples: Samples,
    recipe: Recipe,
    predicted: Array,
    temperature: Array | None = None,
) -> Array:
    """Joint torques of known friction along a motion, ``C' f(C dq)``."""  # predicted (N, r); temperature (N, n)
    load, equations = predicted if friction.loaded else None, target.model.torque_equations()
    if load is not None and equations is not None and not equations.every_joint:  # of the drives that it moves
        load = np.asarray(predicted @ carried_along(target.robot, equations.directions).T)
    direction = drive_directions(target.robot, samples, recipe.sign_width, recipe.breakaway)
    drive_temperature = of_drives(target.robot, temperature)
    return friction.joint_torque(target.robot, samples.q, samples.dq, direction, drive_temperature, load)


def mean_friction(friction: FrictionCurves, robot: Robot, temperature: Array | None) -> FrictionCurves:
    """Curves at the mean temperature of each drive."""  # temperature (N, n)
    means = {} if temperature is None else _of_each(friction, robot, temperature)
    return friction.at({name: float(np.mean(values)) for name, values in means.items()})


def known_temperatures(part: PreparedLog, robot: Robot, friction: FrictionCurves, recipe: Recipe) -> tuple[str, ...]:
    """Notes on the temperatures at which the curves are evaluated."""
    known = None if part.temperature is None else _of_each(friction, robot, part.temperature)
    moving = {name: curve for name, _ in drives_with_friction(robot) if (curve := friction.curve(name)) is not None}
    notes = temperature_notes(moving, known)
    if recipe.temperature is None:
        return notes
    if not notes:
        return ("no friction curve depends on temperature: the given temperature has no effect",)
    if part.log.temperature is not None:
        return (*notes, "the log has its own temperatures, so the given temperature is not used")
    return notes


def _of_each(friction: FrictionCurves, robot: Robot, temperature: Array) -> dict[str, Array]:
    """Temperature of every drive that has a curve."""
    names = (name for name, _ in drives_with_friction(robot))
    columns = zip(names, drive_temperatures(robot, temperature).T, strict=True)
    return {name: column for name, column in columns if friction.curve(name) is not None}


def of_drives(robot: Robot, temperature: Array | None) -> Array | None:
    """Temperatures of the drives with friction from those of the joints, where they are known."""
    return None if temperature is None else drive_temperatures(robot, temperature)


def check_joint_torques(target: IdentificationTarget) -> None:
    """Raise `InputError` if a target's equations are not of joint torques, and so contain no friction."""
    if target.model.channel == "wrench":
        raise InputError("friction curves are for models of joint torques; a wrench does not contain friction")


def check_for_curves(recipe: Recipe) -> None:
    """Raise `InputError` for settings of known friction where no curves are given."""
    for name, given in (("temperature", recipe.temperature is not None), ("friction_scale", recipe.friction_scale)):
        if given:
            raise InputError(
                f"`{name}` is for known friction, but no friction curves are given; give `friction_curves`"
            )


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


def with_measured_side(equations: Sequence[tuple[str, str]], size: Array) -> NDArray[np.bool_]:
    """Which equations errors are over, shape (r,), by the size of their measured sides: not those of a free base."""
    of_base = np.array([name in BASE_JOINTS for name, _ in equations])  # size (r,)
    return ~of_base | np.any(size[of_base] > 0)


def fit_error(observations: Observations, estimate: Estimate) -> float:
    """Relative error over all equations but those of a base that nothing touches, which have no measured side."""
    y, equation, names = observations.y, observations.equation, observations.equations
    rows = with_measured_side(names, np.asarray(np.bincount(equation, y**2, len(names)), dtype=float))[equation]
    return relative_error(y[rows], estimate.predicted(observations)[rows])


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
    predicted = predicted_rows(target, samples, recipe, coefficients)
    if friction is not None:
        known = known_torque(friction, target, samples, recipe, predicted, part.temperature)
        predicted = predicted + model.right_side(samples, known).reshape(-1, r)
    inside = (log.time >= samples.time[0]) & (log.time <= samples.time[-1]) & ~within(log.time, part.saturated)
    time = log.time[inside]
    measured = model.right_side(samples, measured_channel(log, target)[inside]).reshape(-1, r)
    speed = interpolated(time, samples.time, model.speeds(samples))
    return LogPrediction(
        time, measured, interpolated(time, samples.time, predicted), speed, within(time, part.left_out)
    )


_INSTANTS = 3000
_DECISIVE = 0.5  # of what the most decisive parameter changes
_MULTIPLIERS = 10.0 ** np.arange(-16.0, 8.0, 0.25)  # of the mean square of the columns


def best_within_region(
    estimate: Estimate, target: IdentificationTarget, part: PreparedLog, recipe: Recipe, predicted: LogPrediction
) -> tuple[Array, list[str]]:
    """Coefficients of an estimate's 99 % region that predict a log best, shape (b,), and which change the torques most.

    ``min |W d - e|^2`` with ``d' C^-1 d <= k F(k, f)`` for the k parameters that are identifiable, by Lagrange's
    multiplier; the others are free. Every equation counts by its size.
    """
    time = part.samples.time
    some = np.unique(np.linspace(0, time.size - 1, _INSTANTS).astype(int))
    # (N, r, b)
    rows = measured_rows(target, part.samples, recipe.breakaway, recipe.sign_width).at(some).part(slice(None))
    size = np.sqrt(np.mean(predicted.measured**2, axis=0))
    size = np.where(size > 0, size, 1.0)[:, None]
    e = interpolated(time[some], predicted.time, predicted.measured - predicted.predicted)

    seen = np.isfinite(np.diag(estimate.covariance))
    values, vectors = np.linalg.eigh(estimate.covariance[np.ix_(seen, seen)])
    length = np.linalg.norm(rows / size, axis=(0, 1))
    region = np.diag(np.where(seen, 0.0, 1 / np.where(length > 0, length, 1.0)))  # directions, of deviation one
    region[np.ix_(seen, seen)] = vectors * np.sqrt(np.maximum(values, 0.0))
    A, k = (rows / size @ region).reshape(-1, len(region)), max(int(seen.sum()), 1)
    gram, moment = A.T @ A, A.T @ (e[..., None] / size).ravel()
    most, change = k * scipy.special.fdtri(k, max(estimate.degrees_of_freedom, 1), CONFIDENCE), np.zeros(len(region))
    for multiplier in _MULTIPLIERS * np.trace(gram) / len(gram):
        change = np.linalg.lstsq(gram + multiplier * np.diag(seen), moment, rcond=None)[0]
        if np.sum(change[seen] ** 2) <= most:
            break
    moved = length * np.abs(region @ change)
    decisive = [estimate.names[k] for k in np.argsort(-moved) if moved[k] > _DECISIVE * moved.max()]
    return estimate.coefficients + region @ change, decisive
