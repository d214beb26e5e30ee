"""Choices made for the user, one after the other, each by the torques of left-out blocks of time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from excite.identification.choices.bodies import choose_bodies
from excite.identification.choices.choice import Choice
from excite.identification.choices.cutoffs import choose_cutoff, cutoff_candidates
from excite.identification.choices.free_settings import TERM_SETTINGS
from excite.identification.choices.friction_terms import choose_terms
from excite.identification.choices.pieces import LogPiece, pieces_of
from excite.identification.choices.scoring import scoring_of
from excite.identification.choices.sliding import choose_timing, softened
from excite.identification.choices.trial import Trial, trial_of
from excite.identification.known_friction import beside_curves, check_joint_torques
from excite.identification.preparation import prepare
from excite.identification.recipe import ALL, Recipe
from excite.information.target import IdentificationTarget, friction_of_moving, moving_robot, target_of
from excite.logs.log import Log
from excite.tasks.drive_choice import DriveChoice, without_curve
from excite.tasks.task import Task
from regressors.friction.curves import FrictionCurves
from regressors.models.nominal import standard_values
from regressors.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class Chosen:
    """Settings with those that were chosen.

    Parameters
    ----------
    task : Task
    recipe : Recipe
    choices : tuple of Choice
    """

    task: Task
    recipe: Recipe
    choices: tuple[Choice, ...] = ()


def choose_settings(
    robot: Robot,
    task: Task,
    logs: Sequence[Log],
    recipe: Recipe,
    free: frozenset[str],
    *,
    friction: FrictionCurves | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Chosen:
    """Choose settings of a task and a recipe.

    Parameters
    ----------
    robot : Robot
        The whole robot.
    task : Task
    logs : sequence of Log
    recipe : Recipe
    free : frozenset of str
        Settings to choose, see `excite.identification.choices.free_settings`.
    friction : FrictionCurves, optional
        Known friction of the moving drives, which is subtracted; the curves of the task if not given.
    progress : callable
        Called with a description of each step.

    Raises
    ------
    InputError
        Logs that do not fit, or too short to leave blocks of them out.
    """
    if not free:
        return Chosen(task, recipe)
    progress("choosing settings by left-out torques")
    trial_recipe = replace(recipe, rows=ALL, low_pass=None, every=None)
    asked_task, moving = task, moving_robot(robot, task)
    if friction is None and task.known_friction is not None:
        friction = friction_of_moving(task.known_friction, robot, moving)
    if friction is not None:
        task = beside_curves(task, robot, friction)
    target = _widest(robot, task, free, without_curve(True, moving, friction))
    if friction is not None:
        check_joint_torques(target)
    first = replace(recipe, low_pass=None, every=None)
    pieces = [piece for log in logs for piece in pieces_of(prepare(log, robot, target, first))]
    cutoffs = cutoff_candidates(min(p.log.duration for p in pieces), min(p.log.rate for p in pieces))
    trial = _trial(robot, pieces, target, trial_recipe, cutoffs[0] if "cutoff" in free else None, friction)
    scoring = scoring_of(trial, target, trial_recipe, may_hold="estimator" in free)
    choices = []
    if "cutoff" in free:
        progress("choosing the cutoff")
        trial_recipe, choice = choose_cutoff(cutoffs, trial_recipe, lambda tried: scoring.of(scoring.statistics(tried)))
        choices.append(choice)
    parts = trial.prepared(target, trial_recipe)
    progress("choosing the delay of the torques, and the presliding of friction")
    timing = choose_timing(scoring, trial_recipe, parts, free)
    if TERM_SETTINGS & free and target.model.coulomb_friction() is not None:
        progress("choosing the parameters of friction")
        sliding = replace(scoring, target=softened(target, timing.recipe))
        task, choice = choose_terms(sliding, robot, task, timing.recipe, trial.prepared(target, timing.recipe), free)
        choices.append(choice)
        target = target_of(robot, task, 0.0, instantaneous=True)
        progress("choosing the delay and the presliding again, with these parameters")
        timing = choose_timing(scoring.with_target(target, timing.recipe), trial_recipe, parts, free)
    choices += timing.choices
    trial_recipe = timing.recipe
    if "estimator" in free:
        progress("choosing how bodies are held possible")
        final = target_of(robot, task, trial_recipe.common_width, instantaneous=True)
        statistics = trial.statistics(final, trial.prepared(final, trial_recipe), trial_recipe)
        trial_recipe, choice, _ = choose_bodies(statistics, final, standard_values(final.robot), trial_recipe)
        choices.append(choice)
    asked = replace(trial_recipe, rows=recipe.rows, low_pass=recipe.low_pass, every=recipe.every)
    of_terms = (*(TERM_SETTINGS & free), "carried", "stribeck_speed")
    asked_task = asked_task.changed(**{name: getattr(task.model, name) for name in of_terms})
    return Chosen(asked_task, asked, tuple(choices))


def _widest(robot: Robot, task: Task, free: frozenset[str], drives: DriveChoice) -> IdentificationTarget:
    """Instantaneous target with rotor inertias, and offsets of some drives, where they may be chosen."""
    wide = {"offset": drives, "joint_rotors": True}
    task = task.changed(**{name: value for name, value in wide.items() if name in free})
    return target_of(robot, task, 0.0, instantaneous=True)


def _trial(
    robot: Robot,
    pieces: Sequence[LogPiece],
    target: IdentificationTarget,
    recipe: Recipe,
    lowest: float | None,
    friction: FrictionCurves | None,
) -> Trial:
    """The instants that are left under the lowest cutoff."""
    empty = Trial(robot, tuple(piece.log for piece in pieces), (), (), friction)
    narrow = recipe if lowest is None else replace(recipe, cutoff=lowest)
    return trial_of(robot, pieces, empty.prepared(target, narrow), friction)
