"""Choices made for the user, one after the other, each by the torques of left-out blocks of time."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace

from excite.errors import ConicSolverError
from excite.identification.choices.cutoff_and_rows import (
    PERIODS,
    choose_by_rows,
    choose_signals,
    choose_standstill,
    cutoff_candidates,
)
from excite.identification.choices.friction_terms import (
    TERM_SETTINGS,
    choose_bias,
    choose_friction_scale,
    choose_terms,
    possible_terms,
)
from excite.identification.choices.left_out import Choice
from excite.identification.choices.scoring import LogPiece, Scoring, choose_bodies, pieces_of, scoring_of, trial_of
from excite.identification.choices.timing import choose_timing
from excite.identification.prediction import beside_curves, check_joint_torques
from excite.identification.preparation import PreparedLog, prepare
from excite.identification.recipe import ALL, Recipe
from excite.information.target import IdentificationTarget, friction_of_moving, model_of, target_of
from excite.logs.log import Log
from excite.registry import CHOSEN
from excite.tasks.model_choice import ModelChoice
from excite.tasks.model_options import without_curve
from excite.tasks.robot_of_task import moving_robot
from excite.tasks.task import Task
from regressors.errors import InputError, UnknownName
from regressors.models.nominal import standard_values
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.robot import Robot

_TOGETHER = {  # settings that decide on another one
    "cutoff": ("signals", "measured_velocity", "average"),
    "signals": ("measured_velocity", "average", "period", "harmonics"),
    "delay": ("average",),
    "estimator": ("described_within",),
}


def free_settings(
    choose: bool | Collection[str], recipe: Recipe, model: ModelChoice, given: Collection[str]
) -> frozenset[str]:
    """Settings that are left to be chosen."""
    wanted = (CHOSEN if choose else ()) if isinstance(choose, bool) else tuple(choose)
    for name in wanted:
        if name not in CHOSEN:
            raise UnknownName("setting to choose", name, CHOSEN)
    defaults = (recipe, Recipe()), (model, ModelChoice())

    def is_given(name: str) -> bool:
        own = (getattr(one, name) != getattr(default, name) for one, default in defaults if hasattr(default, name))
        return name in given or any(own)

    free = {name for name in wanted if not any(map(is_given, (name, *_TOGETHER.get(name, ()))))}
    if not isinstance(model.model, str):
        free -= TERM_SETTINGS
    return frozenset(free)


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
        return replace(chosen, notes=(*chosen.notes, f"not everything is chosen by cross-validation: {error}"))
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
    wide = {"offset": without_curve(True, moving, friction), "joint_rotors": True}
    widest = task.changed(**{name: value for name, value in wide.items() if name in free})
    target = target_of(robot, widest, 0.0, instantaneous=True)
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
    # the instants that are left under the lowest cutoff
    trial = trial_of(robot, pieces, target, replace(tried, cutoff=cutoffs[0]) if cutoffs else tried, friction)
    scoring = scoring_of(trial, target, tried, may_hold="estimator" in free)
    steps = ChoicesInTurn(robot, task, scoring, free, tried, progress, len(pieces) == len(logs))
    of_recipe = ("rows", "low_pass", "every", *(("sign_width", "breakaway") if windows else ()))
    of_model = (*(TERM_SETTINGS & free), "carried", "stribeck_speed")
    for _ in steps.in_turn(cutoffs):
        kept = replace(steps.tried, **{name: getattr(recipe, name) for name in of_recipe})
        terms = {name: getattr(steps.task.model, name) for name in of_model}
        yield Chosen(asked.changed(**terms), kept, steps.choices, notes)


def _cutoffs(pieces: Sequence[LogPiece], automatic: Sequence[PreparedLog]) -> list[float]:
    """Candidates, with the cutoff that the motion asks for where that is lower; none where it would cut too much."""
    duration = min(log.duration for log, _ in pieces)
    cutoffs = cutoff_candidates(duration, min(log.rate for log, _ in pieces))
    cut = max(float(part.samples.time[0] - part.log.time[0]) - 1 / part.log.rate for part in automatic)
    if not cutoffs or cut <= PERIODS / cutoffs[0]:
        return cutoffs
    return [PERIODS / cut, *cutoffs] if cut <= _MOST_CUT * duration else []


_OF_TIMING = ("delay", "log_delays", "sign_width", "breakaway")


@dataclass
class ChoicesInTurn:
    """Choices one after the other, each with what the earlier ones chose."""

    robot: Robot
    task: Task  # what is chosen so far, with `tried` and `choices`
    whole: Scoring  # by every row
    free: frozenset[str]
    tried: Recipe
    progress: Callable[[str], None]
    undivided: bool
    choices: tuple[Choice, ...] = ()

    def __post_init__(self) -> None:
        self.scoring, self.friction = self.whole, self.whole.trial.friction  # by the rows that settings are chosen by
        self.undirected = self.tried

    def in_turn(self, cutoffs: Sequence[float]) -> Iterator[None]:
        """Make the choices that are free; each is complete where this yields."""
        model = self.whole.target.model
        if "friction_scale" in self.free:  # first as a guess, by which the others are chosen
            width, distance = self.tried.sign_width or 0.0, self.tried.breakaway or 0.0
            self._scale(replace(self.tried, sign_width=width, breakaway=distance))
        self.progress("choosing the cutoff, the delay of the torques, and the presliding of friction")
        rows = choose_by_rows(self.scoring, self.tried, cutoffs, self.free)
        self.scoring, self.tried, self.choices = rows.scoring, rows.recipe, rows.choices
        if "signals" in self.free:
            self.tried, choices = choose_signals(self.scoring, self.tried, whole=self.undivided)
            timed = self._taken_out("delay", "presliding")
            self.choices += (*choices, *timed)
        yield
        if "bias" in self.free and model.channel == "wrench":
            self.tried, choice = choose_bias(self.scoring, self.tried)
            self.choices += (choice,)
            yield
        if "friction_scale" in self.free:
            self.tried, choices = self._scale(self.tried)
            self.choices += choices
            yield
        if TERM_SETTINGS & self.free and model.coulomb_friction() is not None:
            self._terms(rows.free)
            yield
        if "standstill" in self.free and model.torque_equations() is not None:
            own = self._own(self.tried).softened(self.tried)
            self.tried, choices = choose_standstill(own, self.tried, rows.least)
            self.choices += choices
            yield
        if "estimator" in self.free:
            self.progress("choosing how bodies are held possible")
            own = replace(self.scoring, target=self._own_target()).softened(self.tried)
            described = standard_values(own.target.robot)
            self.tried, choice = choose_bodies(own.statistics(self.tried), own.target, described, self.tried)
            self.choices += (choice,)
            yield

    def _scale(self, recipe: Recipe) -> tuple[Recipe, tuple[Choice, ...]]:
        """Scale known friction in what follows, where that predicts better."""
        if self.friction is None:
            return self.tried, ()
        as_given = replace(self.whole, trial=replace(self.whole.trial, friction=self.friction))
        recipe, friction, choices = choose_friction_scale(as_given.softened(recipe), recipe, self.friction)
        self.whole, self.scoring = (
            replace(one, trial=replace(one.trial, friction=friction)) for one in (self.whole, self.scoring)
        )
        return recipe, choices

    def _terms(self, timed: frozenset[str]) -> None:
        self.progress("choosing the parameters of the drives")
        sliding = self.scoring.softened(self.tried)
        self.task, choice = choose_terms(sliding, self.robot, self.task, self.tried, self.free)
        self.progress("choosing the delay and the presliding again, with these parameters")
        again = [name for name in _OF_TIMING if "delay" not in name or "delay" in timed]
        plain = replace(self.tried, **{name: getattr(self.undirected, name) for name in again})
        # rows near standstill show how friction changes its direction
        self.tried, choices = choose_timing(self._own(self.tried), plain, timed)
        self._taken_out(*again, "presliding")
        self.choices += (choice, *choices)

    def _taken_out(self, *names: str) -> tuple[Choice, ...]:
        """Choices that are made again or stand later, which are no longer among the others."""
        out = tuple(one for one in self.choices if one.name in names)
        self.choices = tuple(one for one in self.choices if one.name not in names)
        return out

    def _own_target(self) -> IdentificationTarget:
        """With the chosen parameters, single instants, and the exact sign."""
        return target_of(self.robot, self.task, 0.0, instantaneous=True)

    def _own(self, recipe: Recipe) -> Scoring:
        """By every row, in the columns of the chosen parameters."""
        return self.whole.with_target(self._own_target(), recipe)
