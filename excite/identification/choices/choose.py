"""Choices made for the user, one after the other, each by the torques of left-out blocks of time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from excite.errors import ConicSolverError
from excite.identification.choices.bodies import choose_bodies
from excite.identification.choices.choice import Choice
from excite.identification.choices.curve_factors import choose_friction_scale
from excite.identification.choices.cutoffs import PERIODS, cutoff_candidates
from excite.identification.choices.free_settings import TERM_SETTINGS
from excite.identification.choices.friction_terms import choose_terms, possible_terms
from excite.identification.choices.moving_rows import choose_by_rows
from excite.identification.choices.pieces import LogPiece, pieces_of
from excite.identification.choices.scoring import Scoring, scoring_of
from excite.identification.choices.signal_methods import choose_signals
from excite.identification.choices.sliding import choose_timing, softened
from excite.identification.choices.standing import choose_standstill
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
from regressors.models.nominal import standard_values
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


_OF_TIMING = ("delay", "sign_width", "breakaway")
_TIMED = ("delay", "presliding")


class ChoicesInTurn:
    """Choices one after the other, each with what the earlier ones chose.

    `task`, `tried` and `choices` are what is chosen so far.
    """

    def __init__(
        self,
        robot: Robot,
        task: Task,
        target: IdentificationTarget,
        scoring: Scoring,
        free: frozenset[str],
        tried: Recipe,
        progress: Callable[[str], None],
        friction: FrictionCurves | None,
        undivided: bool,
    ) -> None:
        self.robot, self.task, self.target, self.free, self.friction = robot, task, target, free, friction
        self.whole = self.scoring = scoring
        self.tried = self.undirected = tried
        self.progress, self.undivided = progress, undivided
        self.timed, self.least, self.spoilt, self.choices = free, 0.0, True, tuple[Choice, ...]()
        self._own: tuple[Task, IdentificationTarget] | None = None

    def in_turn(self, cutoffs: Sequence[float]) -> Iterator[None]:
        """Make the choices that are free; each is complete where this yields."""
        if "friction_scale" in self.free:  # first as a guess, by which the others are chosen
            width, distance = self.tried.sign_width or 0.0, self.tried.breakaway or 0.0
            self._scale(replace(self.tried, sign_width=width, breakaway=distance))
        self.progress("choosing the cutoff, the delay of the torques, and the presliding of friction")
        self._cutoff_and_timing(cutoffs)
        yield
        if "friction_scale" in self.free:
            self._scale_by_choice()
            yield
        if TERM_SETTINGS & self.free and self.target.model.coulomb_friction() is not None:
            self._terms()
            yield
        if "standstill" in self.free and self.target.model.torque_equations() is not None:
            self._standstill()
            yield
        if "estimator" in self.free:
            self._bodies()
            yield

    def _cutoff_and_timing(self, cutoffs: Sequence[float]) -> None:
        rows = choose_by_rows(self.scoring, self.tried, cutoffs, self.free)
        self.scoring, self.tried, self.choices = rows.scoring, rows.recipe, rows.choices
        self.timed, self.least, self.spoilt = rows.free, rows.least, rows.spoilt
        if "signals" in self.free:
            self.tried, of_signals = choose_signals(self.scoring, self.tried, whole=self.undivided)
            timed = tuple(one for one in self.choices if one.name in _TIMED)
            self.choices = (*(one for one in self.choices if one.name not in _TIMED), *of_signals, *timed)

    def _scale(self, recipe: Recipe) -> tuple[Recipe, tuple[Choice, ...]]:
        """Scale known friction in what follows, where that predicts better."""
        if self.friction is None:
            return self.tried, ()
        as_given = replace(self.whole.trial, friction=self.friction)
        sliding = replace(self.whole, trial=as_given, target=softened(self.target, recipe))
        chosen = choose_friction_scale(sliding, recipe, as_given.prepared(sliding.target, recipe), self.friction)
        self.whole, self.scoring = (
            replace(one, trial=replace(one.trial, friction=chosen.friction)) for one in (self.whole, self.scoring)
        )
        return chosen.recipe, chosen.choices

    def _scale_by_choice(self) -> None:
        self.tried, choices = self._scale(self.tried)
        self.choices = (*self.choices, *choices)

    def _terms(self) -> None:
        self.progress("choosing the parameters of the drives")
        trial = self.scoring.trial
        sliding = replace(self.scoring, target=softened(self.target, self.tried))
        parts = trial.prepared(self.target, self.tried)
        self.task, choice = choose_terms(sliding, self.robot, self.task, self.tried, parts, self.free)
        self.progress("choosing the delay and the presliding again, with these parameters")
        again = [name for name in _OF_TIMING if name != "delay" or name in self.timed]
        plain = replace(self.tried, **{name: getattr(self.undirected, name) for name in again})
        target = self._own_target()
        # rows near standstill show how friction changes its direction
        scoring, parts = self.whole.with_target(target, self.tried), self.whole.trial.prepared(target, plain)
        timing = choose_timing(scoring, plain, parts, self.timed)
        self.tried = timing.recipe
        kept = (one for one in self.choices if one.name not in (*again, "presliding"))
        self.choices = (*kept, choice, *timing.choices)

    def _standstill(self) -> None:
        target = softened(self._own_target(), self.tried)
        scoring, parts = self.whole.with_target(target, self.tried), self.whole.trial.prepared(target, self.tried)
        self.tried, choices = choose_standstill(scoring, self.tried, parts, self.least, needed=self.spoilt)
        self.choices = (*self.choices, *choices)

    def _bodies(self) -> None:
        self.progress("choosing how bodies are held possible")
        target, trial = softened(self._own_target(), self.tried), self.scoring.trial
        statistics = trial.statistics(target, trial.prepared(target, self.tried), self.tried)
        self.tried, choice, _ = choose_bodies(statistics, target, standard_values(target.robot), self.tried)
        self.choices = (*self.choices, choice)

    def _own_target(self) -> IdentificationTarget:
        """With the chosen parameters, single instants, and the exact sign."""
        if self._own is None or self._own[0] is not self.task:
            self._own = self.task, target_of(self.robot, self.task, 0.0, instantaneous=True)
        return self._own[1]
