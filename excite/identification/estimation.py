"""Identification of a robot's parameters from its logs, step by step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from excite.identification.adjustment import presliding_note
from excite.identification.between_logs import LogScatter, allowing_for_logs, estimate_each, log_scatter
from excite.identification.covariance import condition_number
from excite.identification.curve_uncertainty import allowing_for_curves
from excite.identification.equations import equations
from excite.identification.estimate import Estimate
from excite.identification.estimator import Context, Estimator
from excite.identification.friction_mismatch import friction_mismatch
from excite.identification.friction_scale import FrictionScale, allowing_for_scale, fitted_scale
from excite.identification.given_logs import MeasuredLogs, measured_logs
from excite.identification.identification import Identification
from excite.identification.known_friction import without_friction
from excite.identification.motion_noise import allowing_for_motion_noise
from excite.identification.observations import Observations
from excite.identification.preparation import PreparedLog
from excite.identification.provenance import reference_of
from excite.identification.recipe import Recipe
from excite.identification.result import FitData
from excite.identification.standstill_bias import allowing_for_standstill
from excite.identification.stated_uncertainty import allowing_for_pull, with_uncertainty
from excite.information.friction_notes import left_out_notes
from excite.information.nearly_unidentifiable import left_out_by_rounding
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
    """Identify parameters from one log or several."""
    if not logs:
        raise InputError("no logs to identify from")
    recipe = recipe if recipe is not None else Recipe()
    estimator: Estimator = recipe.chosen_estimator()
    estimator.check(commanded)
    measured = measured_logs(robot, task, logs, recipe, friction, found, progress)
    progress("building the equations")
    equated = _equated(measured)
    observations = equated.observations.held() if estimator.holds_rows else equated.observations
    _check_enough(observations)
    progress(f"estimating {len(observations.names)} parameters from {len(observations.y)} equations")
    target, recipe = measured.target, measured.recipe
    context = Context(target, equated.parts, recipe, standard_values(target.robot), commanded)
    estimate = estimator.estimate(observations, context)
    estimate, scatter = _with_deviations(estimate, estimator, observations, context, measured.found)
    estimate = _allowing_for_friction(estimate, observations, measured, equated.scale)
    mismatch = friction_mismatch(estimate, observations, context) if equated.friction is None else None
    estimate = replace(estimate, mismatch=mismatch, notes=(*estimate.notes, *_notes(robot, task, measured)))
    return Identification(
        robot,
        measured.task,
        recipe,
        estimate,
        condition_number(observations),
        FitData(target, equated.parts, observations),
        friction=equated.friction,
        friction_scale=equated.scale,
        reference=reference_of(target, logs),
        scatter=scatter,
    )


@dataclass(frozen=True, eq=False)
class _Equated:
    """The equations of the logs, with the known friction that was subtracted in them."""

    parts: tuple[PreparedLog, ...]
    observations: Observations
    friction: FrictionCurves | None = None
    scale: FrictionScale | None = None


def _equated(measured: MeasuredLogs) -> _Equated:
    """The equations; known friction is subtracted, times its fitted factors where it is scaled."""
    target, recipe, friction = measured.target, measured.recipe, measured.friction
    if friction is None:
        return _Equated(measured.parts, equations(target, measured.parts, recipe))
    equated = _less(friction, measured)
    if not recipe.friction_scale:
        return equated
    scale = fitted_scale(equated.observations, target, measured.parts, friction, recipe)
    return replace(_less(scale.of(friction), measured), scale=scale)


def _less(friction: FrictionCurves, measured: MeasuredLogs) -> _Equated:
    """The equations without some friction."""
    target, recipe = measured.target, measured.recipe
    parts = tuple(without_friction(part, target, friction, recipe) for part in measured.parts)
    return _Equated(parts, equations(target, parts, recipe), friction)


def _allowing_for_friction(
    estimate: Estimate, observations: Observations, measured: MeasuredLogs, scale: FrictionScale | None
) -> Estimate:
    """Intervals that hold although known friction, and its fitted factors, are uncertain."""
    friction = measured.friction
    if friction is None:
        return estimate
    target, parts, recipe = measured.target, measured.parts, measured.recipe
    estimate = allowing_for_curves(estimate, observations, target, parts, recipe, friction)
    if scale is None:
        return estimate
    return allowing_for_scale(estimate, observations, target, parts, friction, recipe, scale)


def _notes(robot: Robot, asked: Task, measured: MeasuredLogs) -> tuple[str, ...]:
    """How the robot was read, how friction changes sign, and what known friction leaves out of what was asked for."""
    known = measured.friction is not None
    notes = (*left_out_by_rounding(measured.target.robot, measured.target.base), *robot.reading_notes)
    notes = (*notes, *presliding_note(measured.recipe, measured.target, known=known))
    if measured.friction is None:
        return notes
    return (*notes, *left_out_notes(asked.model, measured.target, measured.friction))


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
