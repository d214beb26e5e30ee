"""Choices made for the user, one after the other, each by the torques of left-out blocks of time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from excite.errors import ConicSolverError
from excite.identification.choices.choice import Choice
from excite.identification.choices.choices_in_turn import ChoicesInTurn
from excite.identification.choices.cutoffs import PERIODS, cutoff_candidates
from excite.identification.choices.free_settings import TERM_SETTINGS
from excite.identification.choices.pieces import LogPiece, pieces_of
from excite.identification.choices.possible_terms import possible_terms
from excite.identification.choices.scoring import scoring_of
from excite.identification.choices.trial import Trial, trial_of
from excite.identification.known_friction import beside_curves, check_joint_torques
from excite.identification.preparation import PreparedLog, prepare
from excite.identification.recipe import ALL, Recipe
from excite.information.target import IdentificationTarget, friction_of_moving, model_of, moving_robot, target_of
from excite.logs.log import Log
from excite.tasks.drive_choice import DriveChoice, without_curve
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.friction.curves import FrictionCurves
from regressors.robot.robot import Robot

_MOST_CUT = 0.1  # of a log, from each end
_TOO_SHORT = (
    "the cutoff is chosen from the motion, not by left-out torques: the log is too short to try lower ones than that"
)


@dataclass(frozen=True, eq=False)
class Chosen:
    """Settings with those that were chosen."""

    task: Task
    recipe: Recipe
    choices: tuple[Choice, ...] = ()
    notes: tuple[str, ...] = ()  # why some were not


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
    """Choose settings of a task and a recipe, as far as the logs allow."""
    chosen = Chosen(task, recipe)
    try:
        for further in _choices(robot, task, logs, recipe, free, friction, progress):
            chosen = further
    except (InputError, ConicSolverError) as error:
        return replace(chosen, notes=(*chosen.notes, f"not everything is chosen by left-out torques: {error}"))
    return chosen


def _choices(
    robot: Robot,
    asked: Task,
    logs: Sequence[Log],
    recipe: Recipe,
    free: frozenset[str],
    friction: FrictionCurves | None,
    progress: Callable[[str], None],
) -> Iterator[Chosen]:
    """The settings so far, after each choice."""
    if not free:
        return
    progress("choosing settings by left-out torques")
    moving = moving_robot(robot, asked)
    if friction is None and asked.known_friction is not None:
        friction = friction_of_moving(asked.known_friction, robot, moving)
    task = asked if friction is None else beside_curves(asked, robot, friction)
    free = possible_terms(robot, task, free)
    windows = model_of(moving_robot(robot, task), task).window is not None
    target = _widest(robot, task, free, without_curve(True, moving, friction))
    if friction is not None:
        check_joint_torques(target)
    tried = replace(recipe, rows=ALL, low_pass=None, every=None)
    if windows:  # they integrate friction along the path
        tried = replace(tried, sign_width=0.0, breakaway=0.0)
        free -= {"standstill"}
    first = replace(recipe, low_pass=None, every=None)
    prepared = [prepare(log, robot, target, first) for log in logs]
    pieces = [piece for part in prepared for piece in pieces_of(part)]
    cutoffs = _cutoffs(pieces, prepared) if "cutoff" in free else []
    notes = (_TOO_SHORT,) if "cutoff" in free and not cutoffs else ()
    trial = _trial(robot, pieces, target, tried, cutoffs[0] if cutoffs else None, friction)
    scoring = scoring_of(trial, target, tried, may_hold="estimator" in free)
    steps = ChoicesInTurn(robot, task, target, scoring, free, tried, progress, friction, len(pieces) == len(logs))
    for _ in steps.in_turn(cutoffs):
        own = {name: getattr(recipe, name) for name in ("rows", "low_pass", "every")}
        own |= {name: getattr(recipe, name) for name in ("sign_width", "breakaway") if windows}
        terms = {
            name: getattr(steps.task.model, name) for name in (*(TERM_SETTINGS & free), "carried", "stribeck_speed")
        }
        yield Chosen(asked.changed(**terms), replace(steps.tried, **own), steps.choices, notes)


def _cutoffs(pieces: Sequence[LogPiece], automatic: Sequence[PreparedLog]) -> list[float]:
    """Candidates, with the cutoff that the motion asks for where that is lower; none where it would cut too much."""
    duration = min(piece.log.duration for piece in pieces)
    cutoffs = cutoff_candidates(duration, min(piece.log.rate for piece in pieces))
    cut = max(float(part.samples.time[0] - part.log.time[0]) - 1 / part.log.rate for part in automatic)
    if not cutoffs or cut <= PERIODS / cutoffs[0]:
        return cutoffs
    return [PERIODS / cut, *cutoffs] if cut <= _MOST_CUT * duration else []


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
