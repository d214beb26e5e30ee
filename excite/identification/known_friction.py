"""Known friction, subtracted from the measured torques [KD96] eq. (19), (21)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from excite.identification.hysteresis import measured_direction
from excite.identification.preparation import HELD, PreparedLog
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from regressors.errors import InputError
from regressors.friction.curves import FrictionCurves, carried_along, drive_temperatures, drives_with_friction
from regressors.friction.temperature import temperature_notes
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples


def without_friction(
    part: PreparedLog, target: IdentificationTarget, friction: FrictionCurves, recipe: Recipe
) -> PreparedLog:
    """Subtract known friction from the measured torques of a log.

    Parameters
    ----------
    part : PreparedLog
        As measured.
    target : IdentificationTarget
    friction : FrictionCurves
    recipe : Recipe
        With the chosen `sign_width` or `breakaway`.
    """
    carried = carried_torques(part, target.robot, recipe)(friction)
    notes = (
        *_missing_curves(part.samples, target.robot, friction),
        *known_temperatures(part, target.robot, friction, recipe),
        *friction.speed_notes(target.robot, part.samples.dq),
    )
    return replace(part, measured=carried, notes=(*part.notes, *notes))


def _missing_curves(samples: Samples, robot: Robot, friction: FrictionCurves) -> tuple[str, ...]:
    """Note on the drives without a curve that move in a log."""
    turned = np.ptp(samples.q @ drive_rows(robot).T, axis=0) > HELD
    turning = [name for (name, _), turns in zip(drives_with_friction(robot), turned, strict=True) if turns]
    without = [name for name in turning if friction.curve(name) is None]
    if not without:
        return ()
    described = FrictionCurves.of_robot(robot)
    stated = [name for name in without if described.curve(name) is not None]
    note = f"no friction curve of {', '.join(without)}: assumed to have no friction"
    if stated:
        note += (
            f", though the robot's description states friction for {', '.join(stated)}: fit it too, or leave out "
            "`friction_curves`"
        )
    return (note,)


def carried_torques(part: PreparedLog, robot: Robot, recipe: Recipe) -> Callable[[FrictionCurves], Array]:
    """Joint torques of a log without friction, as a function of the friction curves.

    Parameters
    ----------
    part : PreparedLog
        As measured.
    robot : Robot
        With its moving joints only.
    recipe : Recipe
        With the chosen `sign_width` or `breakaway`.
    """
    samples = part.samples
    direction = friction_direction(robot, samples, recipe)
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
    """Joint torques of known friction along a motion, ``C' f(C dq)``.

    Parameters
    ----------
    friction : FrictionCurves
    target : IdentificationTarget
        With an instantaneous model.
    samples : Samples
    recipe : Recipe
        With the chosen `sign_width` or `breakaway`.
    predicted : ndarray, shape (N, r)
        Right-hand sides without friction, for friction that grows with load.
    temperature : ndarray, shape (N, n), optional
        Of the joints; the curves' reference temperatures if not given [deg C].

    Returns
    -------
    ndarray, shape (N, n)
        [Nm or N]
    """
    load = _load(target, predicted) if friction.loaded else None
    direction = friction_direction(target.robot, samples, recipe)
    drive_temperature = of_drives(target.robot, temperature)
    return friction.joint_torque(target.robot, samples.q, samples.dq, direction, drive_temperature, load)


def friction_direction(robot: Robot, samples: Samples, recipe: Recipe) -> Array | None:
    """Direction of the friction of each drive along a motion.

    Parameters
    ----------
    robot : Robot
        With its moving joints only.
    samples : Samples
    recipe : Recipe
        Whether the direction is the sign of the velocity, or changes over a velocity or over a distance.

    Returns
    -------
    ndarray, shape (N, k), or None
        None for the exact sign of the velocity.
    """
    rows = drive_rows(robot)
    if recipe.breakaway:
        return measured_direction(samples.q @ rows.T, recipe.breakaway)
    return np.tanh(samples.dq @ rows.T / recipe.sign_width) if recipe.sign_width else None


def _load(target: IdentificationTarget, predicted: Array) -> Array:
    """Joint torques from right-hand sides; for a partial motion, those of the drives that it moves."""
    equations = target.model.torque_equations()
    if equations is None or equations.every_joint:
        return predicted
    return np.asarray(predicted @ carried_along(target.robot, equations.directions).T)


def mean_friction(friction: FrictionCurves, robot: Robot, temperature: Array | None) -> FrictionCurves:
    """Curves at the mean temperature of each drive.

    Parameters
    ----------
    friction : FrictionCurves
    robot : Robot
        With its moving joints only.
    temperature : ndarray, shape (N, n), optional
        Of the joints; the curves' reference temperatures if not given [deg C].
    """
    means = {} if temperature is None else _of_each(friction, robot, temperature)
    return friction.at({name: float(np.mean(values)) for name, values in means.items()})


def known_temperatures(part: PreparedLog, robot: Robot, friction: FrictionCurves, recipe: Recipe) -> tuple[str, ...]:
    """Notes on the temperatures at which the curves are evaluated.

    Parameters
    ----------
    part : PreparedLog
    robot : Robot
        With its moving joints only.
    friction : FrictionCurves
    recipe : Recipe
    """
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


def drive_rows(robot: Robot) -> Array:
    """Rows of C of the drives that have friction, shape (k, n)."""
    return np.array([row for _, row in drives_with_friction(robot)]).reshape(-1, robot.n)


def check_joint_torques(target: IdentificationTarget) -> None:
    """Raise `InputError` if a target's equations are not of joint torques, and so contain no friction."""
    if target.model.channel == "wrench":
        raise InputError("friction curves are for models of joint torques; a wrench does not contain friction")
