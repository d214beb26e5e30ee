"""Friction known beforehand, taken from what was measured [KD96] eq. (19), (21)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from excite.identify.hysteresis import dahl_direction
from excite.identify.preparation import Prepared
from excite.identify.recipe import Recipe
from excite.subject import Subject
from regressors.errors import InputError
from regressors.friction import FrictionCurves, drives_with_friction
from regressors.load import LoadIntegralModel, LoadModel
from regressors.robot import Robot
from regressors.samples import Array, Samples


def without_friction(part: Prepared, subject: Subject, friction: FrictionCurves, recipe: Recipe) -> Prepared:
    """A log whose measured torques have no friction in them, as far as it is known.

    Parameters
    ----------
    part : Prepared
        As measured.
    subject : Subject
    friction : FrictionCurves
    recipe : Recipe
        With the turning of friction that was found.
    """
    known = known_torque(friction, subject.robot, part.samples, recipe)
    without = [name for name, _ in drives_with_friction(subject.robot) if friction.curve(name) is None]
    notes = [f"no friction curve of {', '.join(without)}: taken to have no friction"] if without else []
    return replace(part, measured=part.measured - known, notes=(*part.notes, *notes))


def known_torque(friction: FrictionCurves, robot: Robot, samples: Samples, recipe: Recipe) -> Array:
    """Joint torques that known friction takes along a motion, ``C' f(C dq)``.

    Parameters
    ----------
    friction : FrictionCurves
    robot : Robot
        Moving.
    samples : Samples
    recipe : Recipe
        Whether friction's direction is the sign of the velocity, turns over a velocity, or over a distance.

    Returns
    -------
    ndarray, shape (N, n)
        [Nm or N]
    """
    rows = drive_rows(robot)
    direction = None
    if recipe.breakaway:
        direction = dahl_direction(samples.q @ rows.T, recipe.breakaway)
    elif recipe.sign_width:
        direction = np.tanh(samples.dq @ rows.T / recipe.sign_width)
    return friction.joint_torque(robot, samples.q, samples.dq, direction)


def drive_rows(robot: Robot) -> Array:
    """Rows of C of the drives that have friction, shape (k, n)."""
    return np.array([row for _, row in drives_with_friction(robot)]).reshape(-1, robot.n)


def check_joint_torques(subject: Subject) -> None:
    """Raise `InputError` where a subject's equations are not of joint torques, and so hold no friction."""
    if isinstance(subject.model, LoadModel | LoadIntegralModel):
        raise InputError("friction curves are for models of joint torques; a wrench has no friction in it")
