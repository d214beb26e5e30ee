"""Choices made for the user, one after the other, each by the torques of left-out blocks of time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from excite.identification.choices.bodies import choose_bodies
from excite.identification.choices.choice import Choice
from excite.identification.choices.cutoffs import choose_cutoff, cutoff_candidates
from excite.identification.choices.free_settings import TERM_SETTINGS
from excite.identification.choices.friction_terms import choose_terms
from excite.identification.choices.pieces import exciting_pieces
from excite.identification.choices.scoring import scoring_of
from excite.identification.choices.sliding import choose_timing, softened
from excite.identification.choices.trial import Trial, trial_of
from excite.identification.known_friction import beside_curves, check_joint_torques
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
    pieces = [piece for log in logs for piece in exciting_pieces(log, target, recipe)]
    cutoffs = cutoff_candidates(min(log.duration for log in pieces), min(_rate(log) for log in pieces))
    trial = _trial(robot, pieces, target, trial_recipe, cutoffs[0] if "cutoff" in free else None, friction)
    scoring = scoring_of(trial, target, trial_recipe, may_hold="estimator" in free)
    choices = []
    if "cutoff" in free:
        progress("choosing the cutoff")
        trial_recipe, choice = choose_cutoff(cutoffs, trial_recipe, lambda tried: scoring.of(scoring.statistics(tried)))
        choices.append(choice)
    parts = trial.prepared(target, trial_recipe)
    progress("choosing the delay of the torques, and the presliding of friction")
    timing = choose_timing(scoring, trial_recipe, parts, free, 1 / _rate(pieces[0]))
    choices += timing.choices
    sliding = trial_recipe = timing.recipe
    parts = trial.prepared(target, sliding) if sliding.delay else parts
    scoring = replace(scoring, target=softened(target, sliding))
    if TERM_SETTINGS & free and target.model.coulomb_friction() is not None:
        progress("choosing the parameters of friction")
        task, choice = choose_terms(scoring, robot, task, sliding, parts, free)
        choices.append(choice)
    if "estimator" in free:
        progress("choosing how bodies are held possible")
        final = target_of(robot, task, sliding.common_width, instantaneous=True)
        statistics = trial.statistics(final, parts, sliding)
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
    pieces: Sequence[Log],
    target: IdentificationTarget,
    recipe: Recipe,
    lowest: float | None,
    friction: FrictionCurves | None,
) -> Trial:
    """The instants that are left under the lowest cutoff."""
    empty = Trial(robot, tuple(pieces), (), (), friction)
    narrow = recipe if lowest is None else replace(recipe, cutoff=lowest)
    return trial_of(robot, pieces, empty.prepared(target, narrow), friction)


def _rate(log: Log) -> float:
    return (log.count - 1) / log.duration
