"""Parameters of a robot from its logs, step by step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from excite.identification.covariance import METHODS, robust_covariance
from excite.identification.curve_uncertainty import allowing_for_curves
from excite.identification.equations import equations_of
from excite.identification.estimate import Estimate
from excite.identification.estimator import Context, Estimator
from excite.identification.factors import GroupFactors
from excite.identification.identification import Identification
from excite.identification.known_friction import check_joint_torques, without_friction
from excite.identification.observations import Observations, joined
from excite.identification.preparation import PreparedLog, prepare
from excite.identification.presliding import best_turning
from excite.identification.recipe import Recipe
from excite.identification.reference_values import reference_of
from excite.identification.residuals import residual_diagnostics
from excite.information.target import IdentificationTarget, friction_of_moving, target_of
from excite.logs.log import Log
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from regressors.errors import InputError
from regressors.friction.curves import FrictionCurves
from regressors.models.columns import COULOMB
from regressors.models.nominal import standard_values
from regressors.models.windows import Window
from regressors.robot.robot import Robot


def estimate_parameters(
    robot: Robot,
    task: Task,
    logs: Sequence[Log],
    recipe: Recipe | None = None,
    *,
    commanded: Trajectory | None = None,
    friction: FrictionCurves | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Identification:
    """Identify parameters from one log or several.

    Parameters
    ----------
    robot : Robot
        The whole robot.
    task : Task
        Which model, of which joints; friction columns are left out where friction is known.
    logs : sequence of Log
        Each with a hash.
    recipe : Recipe, optional
    commanded : Trajectory, optional
        The motion that was played, where it is known.
    friction : FrictionCurves, optional
        Friction known beforehand, see `excite.identification.known_friction`; the curves of the task if not given.
    progress : callable
        Called with what is being done.

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
    offset = task.model.offset  # false in a task with curves of its own
    if friction is None:
        friction = task.known_friction
    else:
        task = task.changed(friction=False, offset=False, friction_curves=None)
    made_for = task, recipe.sign_width or 0.0
    target = target_of(robot, *made_for)
    if friction is not None:
        check_joint_torques(target)
        friction = friction_of_moving(friction, robot, target.robot)
        task = task if task.known_friction is None else task.changed(friction_curves=friction)
    elif recipe.temperature is not None:
        raise InputError("temperature is for known friction, whose curves may depend on it: no curves are given")
    parts = []
    for log in logs:
        progress(f"reading the motion of {log.source}")
        parts.append(prepare(log, robot, target, recipe))
    task = _with_whole_window(task, target, parts[0])
    recipe = _with_turning(recipe, target, parts, friction)
    if (task, recipe.sign_width) != made_for:
        target = target_of(robot, task, recipe.sign_width or 0.0)
    measured = parts
    if friction is not None:
        parts = [without_friction(part, target, friction, recipe) for part in parts]
    progress("making the equations")
    observations = joined([equations_of(target, part, recipe) for part in parts])
    if len(observations.y) <= len(observations.names):
        raise InputError(
            f"{', '.join(observations.logs)}: {len(observations.y)} equations are too few for "
            f"{len(observations.names)} parameters"
        )
    progress(f"estimating {len(observations.names)} parameters from {len(observations.y)} equations")
    context = Context(target, tuple(parts), recipe, standard_values(robot), commanded)
    estimate = estimator.estimate(observations, context)
    estimate = _with_covariance(estimate, observations, recipe.covariance)
    if friction is not None:
        estimate = allowing_for_curves(estimate, observations, target, measured, recipe, friction)
    told = _turning_note(recipe, target, known=friction is not None)
    if friction is not None and offset:
        told = (*told, "offset columns are left out: friction is known")
    estimate = replace(estimate, notes=(*estimate.notes, *told))
    condition = condition_number(observations)
    reference = reference_of(target, logs)
    return Identification(
        robot, task, recipe, target, tuple(parts), observations, estimate, condition, friction, reference=reference
    )


def _with_whole_window(task: Task, target: IdentificationTarget, part: PreparedLog) -> Task:
    """The task with short windows of a whole number of samples, the nearest to what was asked for."""
    window, time = target.model.window, part.samples.time
    if window is None or window.kind != "short":
        return task
    fitted = window.fitted(float(time[-1] - time[0]) / (time.size - 1))
    return task.changed(model=task.model.with_window(fitted))


def _with_turning(
    recipe: Recipe, target: IdentificationTarget, parts: Sequence[PreparedLog], friction: FrictionCurves | None
) -> Recipe:
    """The recipe with how friction turns, where that is to be found from the data."""
    if recipe.sign_width is not None or recipe.breakaway or target.model.window is not None:
        return replace(recipe, sign_width=recipe.sign_width or 0.0, breakaway=recipe.breakaway or 0.0)
    plain = replace(recipe, low_pass=None, every=None, sign_width=0.0, breakaway=0.0)
    equations = [(part, equations_of(target, part, plain)) for part in parts]
    turning = best_turning(target, equations, by_distance=recipe.breakaway is None, friction=friction)
    return replace(recipe, sign_width=turning.sign_width, breakaway=turning.breakaway)


def _turning_note(recipe: Recipe, target: IdentificationTarget, *, known: bool) -> tuple[str, ...]:
    base, window = target.base, target.model.window
    if window is not None:
        return (_window_note(window),)
    if not known and not any(base.columns[k].kind == COULOMB for k in base.index):
        return ()
    what = "known friction" if known else "Coulomb friction"
    if recipe.breakaway:
        return (f"{what} turns over {recipe.breakaway:.3g} rad (or m) of travel, and keeps at standstill",)
    if recipe.sign_width:
        return (f"{what} turns over {recipe.sign_width:.3g} rad/s (or m/s) of drive velocity",)
    return (f"{what} turns with the sign of the velocity",)


def _window_note(window: Window) -> str:
    if window.kind == "long":
        return "rows of long windows share the noise of the instants before them: the intervals are too narrow"
    return f"windows of {1e3 * window.length:.4g} ms"


def _with_covariance(estimate: Estimate, observations: Observations, kind: str) -> Estimate:
    """The estimate with a covariance that suits its residuals."""
    if kind == "white" or (kind == "auto" and _white(estimate, observations)):
        return estimate
    if kind == "auto" and estimate.method not in METHODS:
        note = "residuals are correlated in time: the intervals, made for white ones, are too narrow"
        return replace(estimate, notes=(*estimate.notes, note))
    return robust_covariance(estimate, observations)


def _white(estimate: Estimate, observations: Observations) -> bool:
    """True if no equation's residuals are clearly correlated in time."""
    return all(r.whiteness > 0.001 or abs(r.lag_one) < 0.05 for r in residual_diagnostics(estimate, observations))


def condition_number(observations: Observations) -> float:
    """cond(W), infinite where a column vanishes or depends on others.

    Parameters
    ----------
    observations : Observations
    """
    factors = GroupFactors.of(observations)
    R = factors.stacked(np.ones(len(factors.R)))[:, :-1]
    sigma = np.linalg.svd(R, compute_uv=False)
    return float(sigma[0] / sigma[-1]) if R.shape[0] >= R.shape[1] and sigma[-1] > 1e-13 * sigma[0] else np.inf
