"""Identification of a robot's parameters from its logs, step by step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from excite.identification.adjustment import presliding_note, with_presliding, with_whole_window
from excite.identification.between_logs import LogScatter, allowing_for_logs, log_scatter
from excite.identification.curve_uncertainty import allowing_for_curves
from excite.identification.each_log import estimate_each
from excite.identification.equations import equations
from excite.identification.estimate import Estimate
from excite.identification.estimator import Context, Estimator
from excite.identification.friction_scale import allowing_for_scale, fitted_scale
from excite.identification.identification import Identification
from excite.identification.known_friction import (
    beside_curves,
    check_for_curves,
    check_joint_torques,
    without_friction,
)
from excite.identification.motion_noise import allowing_for_motion_noise
from excite.identification.observations import Observations
from excite.identification.preparation import prepare
from excite.identification.pull_bias import allowing_for_pull
from excite.identification.recipe import Recipe
from excite.identification.reference_values import reference_of
from excite.identification.residual_covariance import condition_number
from excite.identification.standstill import without_standstill
from excite.identification.standstill_bias import allowing_for_standstill
from excite.identification.stated_uncertainty import PRESLIDING, with_uncertainty
from excite.information.friction_notes import left_out_notes
from excite.information.target import friction_of_moving, target_of
from regressors.errors import InputError
from regressors.models.nominal import standard_values

if TYPE_CHECKING:
    from excite.logs.log import Log
    from excite.tasks.task import Task
    from excite.trajectories import Trajectory
    from regressors.friction.curves import FrictionCurves
    from regressors.robot.robot import Robot


def estimate_parameters(
    robot: Robot,
    task: Task,
    logs: Sequence[Log],
    recipe: Recipe | None = None,
    *,
    commanded: Trajectory | None = None,
    friction: FrictionCurves | None = None,
    found: frozenset[str] = frozenset(),
    progress: Callable[[str], None] = lambda _: None,
) -> Identification:
    """Identify parameters from one log or several.

    Parameters
    ----------
    robot : Robot
        The whole robot.
    task : Task
        Which model, of which joints; drives whose friction is known get no friction columns.
    logs : sequence of Log
        Each with a hash.
    recipe : Recipe, optional
    commanded : Trajectory, optional
        The motion that was played, where it is known.
    friction : FrictionCurves, optional
        Friction known beforehand, see `excite.identification.known_friction`; the curves of the task if not given.
    found : frozenset of str
        Which of ``presliding`` and ``delay`` in the recipe were found from the same logs, so that the intervals allow
        for that.
    progress : callable
        Called with a description of each step.

    Raises
    ------
    InputError
        No logs, logs that do not fit, or fewer equations than parameters.
    """
    if not logs:
        raise InputError("no logs to identify from")
    recipe = recipe if recipe is not None else Recipe()
    estimator: Estimator = recipe.chosen_estimator()
    estimator.check(commanded)
    asked = task.model
    own, friction = friction is None, task.known_friction if friction is None else friction
    if friction is not None and (recipe.friction_scale or not own):
        task = beside_curves(task, robot, friction)
    made_for = task, recipe.common_width
    target = target_of(robot, *made_for)
    if friction is not None:
        check_joint_torques(target)
        friction = friction_of_moving(friction, robot, target.robot)
        task = task if task.known_friction is None else task.changed(friction_curves=friction)
    else:
        check_for_curves(recipe)
    parts = []
    for log in logs:
        progress(f"reading the motion of {log.source}")
        parts.append(prepare(log, robot, target, recipe))
    task = with_whole_window(task, target, parts[0])
    if recipe.sign_width is None and not recipe.breakaway:
        found |= {PRESLIDING}
    found = found if friction is None else found - {PRESLIDING}
    recipe = with_presliding(recipe, target, parts, friction)
    if (task, recipe.common_width) != made_for:
        target = target_of(robot, task, recipe.common_width)
    measured = parts = [without_standstill(part, target, recipe.standstill) for part in parts]
    if friction is not None:
        parts = [without_friction(part, target, friction, recipe) for part in parts]
    progress("building the equations")
    observations, scale = equations(target, parts, recipe), None
    if friction is not None and recipe.friction_scale:
        scale = fitted_scale(observations, target, measured, friction, recipe)
        parts = [without_friction(part, target, scale.of(friction), recipe) for part in measured]
        observations = equations(target, parts, recipe)
    if estimator.holds_rows:
        observations = observations.held()
    _check_enough(observations)
    progress(f"estimating {len(observations.names)} parameters from {len(observations.y)} equations")
    context = Context(target, tuple(parts), recipe, standard_values(target.robot), commanded)
    estimate = estimator.estimate(observations, context)
    estimate, scatter = _with_deviations(estimate, estimator, observations, context, found)
    if friction is not None:
        estimate = allowing_for_curves(estimate, observations, target, measured, recipe, friction)
    if friction is not None and scale is not None:
        estimate = allowing_for_scale(estimate, observations, target, measured, friction, recipe, scale)
        friction = scale.of(friction)
    notes = (*robot.reading_notes, *presliding_note(recipe, target, known=friction is not None))
    if friction is not None:
        notes = (*notes, *left_out_notes(asked, target, friction))
    estimate = replace(estimate, notes=(*estimate.notes, *notes))
    condition = condition_number(observations)
    reference = reference_of(target, logs)
    return Identification(
        robot,
        task,
        recipe,
        target,
        tuple(parts),
        observations,
        estimate,
        condition,
        friction,
        friction_scale=scale,
        reference=reference,
        scatter=scatter,
    )


def _check_enough(observations: Observations) -> None:
    """Raise `InputError` where there are fewer equations than parameters."""
    if len(observations.y) <= len(observations.names):
        raise InputError(
            f"{', '.join(observations.logs)}: {len(observations.y)} equations are too few for "
            f"{len(observations.names)} parameters"
        )


def _with_deviations(
    estimate: Estimate, estimator: Estimator, observations: Observations, context: Context, found: frozenset[str]
) -> tuple[Estimate, LogScatter | None]:
    """The estimate with the deviations that noise, motion, a pull and several logs give it, and their scatter."""
    parts, target, recipe = context.prepared, context.target, context.recipe
    estimate = with_uncertainty(estimate, observations, target, parts, recipe, found=found)
    estimate = allowing_for_motion_noise(estimate, estimator, context)
    estimate = allowing_for_standstill(estimate, estimator, observations, context)
    estimate = allowing_for_pull(estimate, estimator, observations)
    if len(parts) == 1:
        return estimate, None
    scatter = log_scatter(estimate_each(estimator, observations, context, found=found))
    return allowing_for_logs(estimate, scatter), scatter
