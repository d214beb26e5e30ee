"""Identification of a robot's parameters from its logs, step by step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from excite.identification.allowances import (
    FrictionScale,
    allowing_for_curves,
    allowing_for_pull,
    allowing_for_scale,
    fitted_scale,
    with_uncertainty,
)
from excite.identification.between_logs import LogScatter, allowing_for_logs, estimate_each, log_scatter
from excite.identification.biases import allowing_for_motion_noise, allowing_for_standstill, friction_mismatch
from excite.identification.covariance import condition_number
from excite.identification.equations import equations
from excite.identification.estimate import Estimate, noted
from excite.identification.estimator import Context, Estimator
from excite.identification.given_logs import MeasuredLogs, measured_logs
from excite.identification.identification import Identification
from excite.identification.known_friction import without_friction
from excite.identification.observations import Observations
from excite.identification.presliding import presliding_note
from excite.identification.recipe import Recipe
from excite.identification.result import FitData, reference_of
from excite.information.nearly_unidentifiable import left_out_by_rounding
from excite.information.target import left_out_notes
from excite.logs.log import Log
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from regressors.errors import InputError
from regressors.models.nominal import standard_values
from regressors.robot.friction.curves import FrictionCurves
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
    """Identify parameters from one log or several."""
    if not logs:
        raise InputError("no logs to identify from")
    recipe = recipe if recipe is not None else Recipe()
    estimator: Estimator = recipe.chosen_estimator()
    estimator.check(commanded)
    given = measured_logs(robot, task, logs, recipe, friction, found, progress)
    progress("building the equations")
    target, recipe = given.target, given.recipe
    measured = Context(target, given.parts, recipe, standard_values(target.robot), commanded)
    context, curves, scale = _less_friction(measured, given.friction)
    observations = equations(target, context.prepared, recipe)
    observations = observations.held() if estimator.holds_rows else observations
    if len(observations.y) <= len(observations.names):
        raise InputError(
            f"{', '.join(observations.logs)}: {len(observations.y)} equations are too few for "
            f"{len(observations.names)} parameters"
        )
    progress(f"estimating {len(observations.names)} parameters from {len(observations.y)} equations")
    estimate = estimator.estimate(observations, context)
    estimate, scatter = _with_deviations(estimate, estimator, observations, context, given.found)
    if given.friction is not None:
        estimate = allowing_for_curves(estimate, observations, measured, given.friction)
        if scale is not None:
            estimate = allowing_for_scale(estimate, observations, measured, given.friction, scale)
    mismatch = friction_mismatch(estimate, observations, context) if curves is None else None
    return Identification(
        robot,
        given.task,
        recipe,
        noted(replace(estimate, mismatch=mismatch), *_notes(robot, task, given)),
        condition_number(observations),
        FitData(target, context.prepared, observations),
        friction=curves,
        friction_scale=scale,
        reference=reference_of(target, logs),
        scatter=scatter,
    )


def _less_friction(
    measured: Context, friction: FrictionCurves | None
) -> tuple[Context, FrictionCurves | None, FrictionScale | None]:
    """The logs less known friction, times its fitted factors where it is scaled; that friction, and the factors."""
    if friction is None:
        return measured, None, None
    target, recipe, scale = measured.target, measured.recipe, None

    def less(friction: FrictionCurves) -> Context:
        parts = (without_friction(part, target, friction, recipe) for part in measured.prepared)
        return replace(measured, prepared=tuple(parts))

    if recipe.friction_scale:
        scale = fitted_scale(equations(target, less(friction).prepared, recipe), measured, friction)
        friction = scale.of(friction)
    return less(friction), friction, scale


def _notes(robot: Robot, asked: Task, measured: MeasuredLogs) -> tuple[str, ...]:
    """How the robot was read, how friction changes sign, and what known friction leaves out of what was asked for."""
    known = measured.friction is not None
    notes = (*left_out_by_rounding(measured.target.robot, measured.target.base), *robot.reading_notes)
    notes = (*notes, *presliding_note(measured.recipe, measured.target, known=known))
    if measured.friction is None:
        return notes
    return (*notes, *left_out_notes(asked.model, measured.target, measured.friction))


def _with_deviations(
    estimate: Estimate, estimator: Estimator, observations: Observations, context: Context, found: frozenset[str]
) -> tuple[Estimate, LogScatter | None]:
    """The estimate with the deviations that noise, motion, a pull and several logs give it, and their scatter."""
    estimate = with_uncertainty(estimate, observations, context, found=found)
    estimate = allowing_for_motion_noise(estimate, estimator, context)
    estimate = allowing_for_standstill(estimate, estimator, observations, context)
    estimate = allowing_for_pull(estimate, estimator, observations)
    if len(context.prepared) == 1:
        return estimate, None
    scatter = log_scatter(estimate_each(estimator, observations, context, found=found))
    return allowing_for_logs(estimate, scatter), scatter
