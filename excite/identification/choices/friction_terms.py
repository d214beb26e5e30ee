"""Choice of the drives' optional parameters: friction terms and rotor inertias."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from excite.identification.choices.block_statistics import BlockStatistics
from excite.identification.choices.bodies import of_base_columns, possible_estimate_of_products
from excite.identification.choices.choice import Candidate, Choice
from excite.identification.choices.free_settings import TERM_SETTINGS
from excite.identification.choices.left_out import Estimate, LeftOut, least_squares_of_products, left_out
from excite.identification.choices.scoring import Scoring, pulled_least_squares
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget, model_of, moving_robot, target_of
from excite.tasks.drive_choice import without_curve
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.models.carried_torque import standard_of
from regressors.models.columns import ASYMMETRY, LOAD_SHARE, OFFSET, ROOT, ROTOR, STRIBECK
from regressors.models.nominal import standard_values
from regressors.robot.robot import Robot

_WITHIN = (10.0, 3.0, 1.0)  # of the described bodies, in their sizes
_SPEED = 0.2  # of the Stribeck part, in typical speeds


def choose_terms(
    scoring: Scoring, robot: Robot, task: Task, recipe: Recipe, parts: Sequence[PreparedLog], free: frozenset[str]
) -> tuple[Task, Choice]:
    """Choose the optional parameters of each drive."""
    kinds = frozenset(kind for kind, option in OPTIONS.items() if option in free)
    kinds |= {ROTOR} if "joint_rotors" in free else set()
    wide_task = _with_all(task, kinds, scoring, scoring.trial.statistics(scoring.target, parts, recipe), parts)
    wide = target_of(robot, wide_task, recipe.common_width, instantaneous=True)
    statistics = scoring.trial.statistics(wide, parts, recipe)
    terms = drive_terms(wide, kinds)
    estimates = None if scoring.estimate is None else _with_bodies(wide, statistics, terms.always)
    groups, steps, tried = choose_columns(statistics, terms.always, terms.optional, estimates)
    chosen = with_terms(wide_task, groups, kinds)
    if any(kind == LOAD_SHARE for kind, _ in groups):
        chosen = _carrying(chosen, robot, scoring, recipe, parts)
    else:
        chosen = chosen.changed(carried=task.model.carried)
    if not any(kind == STRIBECK for kind, _ in groups):
        chosen = chosen.changed(stribeck_speed=task.model.stribeck_speed)
    listed = (Candidate("none", steps[0].error, steps[0].score), *tried)
    return chosen, Choice("terms", _names(groups), listed, _reason(groups, steps, kinds))


def _with_all(
    task: Task,
    kinds: frozenset[str],
    scoring: Scoring,
    statistics: BlockStatistics,
    parts: Sequence[PreparedLog],
) -> Task:
    """The task with every term that may be chosen, of the drives whose friction is not known."""
    every = without_curve(True, scoring.target.robot, scoring.trial.friction)
    changes: dict[str, object] = {OPTIONS[kind]: every for kind in kinds if kind != ROTOR}
    if ROTOR in kinds:
        changes["joint_rotors"] = True
    if LOAD_SHARE in kinds:
        errors = scoring.of(statistics)
        estimate = scoring.estimate or least_squares_of_products
        changes["carried"] = standard_of(
            scoring.target.model, scoring.target.base, estimate(statistics.total, errors.weights)
        )
    if STRIBECK in kinds:
        speeds = np.concatenate([np.sqrt(np.mean(part.samples.dq**2, axis=0)) for part in parts])
        changes["stribeck_speed"] = float(f"{_SPEED * np.median(speeds):.2g}")
    return task.changed(**changes)


def _carrying(task: Task, robot: Robot, scoring: Scoring, recipe: Recipe, parts: Sequence[PreparedLog]) -> Task:
    """The task with the carried torques of its own estimate."""
    target = target_of(robot, task, recipe.common_width, instantaneous=True)
    own = scoring.with_target(target, recipe)
    statistics = scoring.trial.statistics(target, parts, recipe)
    estimate = own.estimate or least_squares_of_products
    beta = estimate(statistics.total, own.of(statistics).weights)
    return task.changed(carried=standard_of(target.model, target.base, beta))


def _with_bodies(target: IdentificationTarget, statistics: BlockStatistics, columns: Sequence[int]) -> Estimates:
    """Possible bodies; and, to be quick, the described ones as prior knowledge, as near as is best."""
    described = standard_values(target.robot)
    few = statistics.of_columns(columns)
    scores = {within: left_out(few, pulled_least_squares(target, described, within, columns)) for within in _WITHIN}
    best = min(scores, key=lambda within: scores[within].score)

    def possible(columns: Sequence[int]) -> Estimate:
        return possible_estimate_of_products(of_base_columns(target, columns), described, None)

    return Estimates(possible, lambda columns: pulled_least_squares(target, described, best, columns))


def _names(groups: Sequence[Group]) -> tuple[str, ...]:
    return tuple(f"{kind} {drive}" if drive else kind for kind, drive in groups)


def _reason(groups: Sequence[Group], steps: Sequence[LeftOut], kinds: Collection[str]) -> str:
    if not groups:
        return f"no {_either(kinds)} is added: none predicts left-out torques clearly better"
    by_kind: dict[str, list[int]] = {}
    for kind, drive in groups:
        by_kind.setdefault(kind, []).append(drive)
    said = [WORDS[kind] + _of(drives) for kind, drives in by_kind.items()]
    return (
        f"added, since left-out torques are predicted to {100 * steps[-1].error:.3g} % instead of "
        f"{100 * steps[0].error:.3g} %: {', '.join(said)}"
    )


def _of(drives: Sequence[int]) -> str:
    numbers = ", ".join(str(drive) for drive in sorted(drives) if drive)
    return f" of drive{'s' * (len(drives) > 1)} {numbers}" if numbers else ""


def _either(kinds: Collection[str]) -> str:
    """Names of kinds of terms, the last after an or."""
    *others, last = [name for kind, name in NAMES.items() if kind in kinds]
    return f"{', '.join(others)} or {last}" if others else last


_CONVINCING = 1.0  # standard errors over the blocks [Breiman et al. 1984]
_WORTH = 0.01  # gain of one equation's score

_TRIED = 8  # groups that a slow estimate tries in one step

Group = tuple[str, int]
EstimateOf = Callable[[Sequence[int]], Estimate | None]


@dataclass(frozen=True, eq=False)
class Estimates:
    """Estimates of some columns."""

    careful: EstimateOf  # what decides: an estimate from the columns that are in it
    quick: EstimateOf | None = None  # A fast one, by which the most promising groups are found first


def choose_columns(
    statistics: BlockStatistics,
    always: Sequence[int],
    optional: Mapping[Group, Sequence[int]],
    estimates: Estimates | None = None,
) -> tuple[list[Group], list[LeftOut], list[Candidate]]:
    """Add the group of columns that lowers the left-out errors most, as long as the gain is clear.

    A gain is clear where it exceeds its standard error over the blocks, and a hundredth of one equation's error.
    """
    estimates = Estimates(lambda columns: None) if estimates is None else estimates
    columns = list(always)
    chosen: list[Group] = []
    steps = [_errors(statistics, columns, estimates.careful)]
    least = _WORTH / statistics.products.shape[1]
    scores: dict[Group, LeftOut] = {}
    while remaining := {group: added for group, added in optional.items() if group not in chosen}:
        if estimates.quick is not None:
            remaining = _promising(statistics, columns, remaining, estimates.quick)
        gains = {}
        for group, added in remaining.items():
            scores[group] = _errors(statistics, [*columns, *added], estimates.careful, steps[-1])
            gain, deviation = scores[group].gain_over(steps[-1])
            gains[group] = gain if gain > max(_CONVINCING * deviation, least) else 0.0
        best = max(gains, key=lambda group: gains[group])
        if not gains[best]:
            break
        chosen.append(best)
        columns += optional[best]
        steps.append(scores[best])
    listed = [Candidate(f"{kind} {drive}" if drive else kind, s.error, s.score) for (kind, drive), s in scores.items()]
    return chosen, steps, listed


def _promising(
    statistics: BlockStatistics, columns: Sequence[int], groups: Mapping[Group, Sequence[int]], quick: EstimateOf
) -> dict[Group, Sequence[int]]:
    """The groups that a fast estimate gains most with."""
    before = _errors(statistics, columns, quick)
    scores = {group: _errors(statistics, [*columns, *added], quick, before).score for group, added in groups.items()}
    return {group: groups[group] for group in sorted(scores, key=lambda group: scores[group])[:_TRIED]}


def _errors(
    statistics: BlockStatistics, columns: Sequence[int], estimate: EstimateOf, before: LeftOut | None = None
) -> LeftOut:
    weights = None if before is None else before.weights
    return left_out(statistics.of_columns(columns), estimate(columns), weights)


OPTIONS: Mapping[str, str] = {
    OFFSET: "offset",
    LOAD_SHARE: "load_share",
    ROOT: "root_friction",
    ASYMMETRY: "asymmetric_friction",
    STRIBECK: "stribeck",
}
WORDS: Mapping[str, str] = {
    OFFSET: "a constant offset",
    LOAD_SHARE: "a share of the carried torque",
    ROOT: "a part with the square root of the speed",
    ASYMMETRY: "viscous friction that differs by direction",
    STRIBECK: "a Stribeck part",
    ROTOR: "rotor inertias",
}
NAMES: Mapping[str, str] = {
    OFFSET: "offset",
    LOAD_SHARE: "load share",
    ROOT: "root of the speed",
    ASYMMETRY: "asymmetry",
    STRIBECK: "Stribeck part",
    ROTOR: "rotor inertia",
}
EVERY_DRIVE = 0  # number that stands for all drives together


@dataclass(frozen=True, eq=False)
class DriveTerms:
    """Columns of a target by whether they are optional."""

    always: tuple[int, ...]  # base columns that are kept
    optional: Mapping[Group, tuple[int, ...]]  # base columns by kind and drive; rotor inertias of all drives together


def drive_terms(target: IdentificationTarget, free: frozenset[str]) -> DriveTerms:
    """Sort a target's base columns."""
    optional: dict[Group, tuple[int, ...]] = {}
    always = []
    for k, index in enumerate(target.base.index):
        column = target.model.columns[index]
        owner = column.owner
        if column.kind == ROTOR and ROTOR in free:
            group = ROTOR, EVERY_DRIVE
        elif column.kind in OPTIONS and column.kind in free and owner is not None:
            group = column.kind, owner
        else:
            always.append(k)
            continue
        optional[group] = (*optional.get(group, ()), k)
    return DriveTerms(tuple(always), optional)


def with_terms(task: Task, groups: list[Group], free: frozenset[str]) -> Task:
    """A task with the chosen terms, and without the others that were free."""
    changes: dict[str, object] = {}
    for kind in free:
        drives = tuple(str(drive) for k, drive in sorted(groups) if k == kind)
        if kind == ROTOR:
            changes["joint_rotors"] = bool(drives)
        else:
            changes[OPTIONS[kind]] = drives or False
    return task.changed(**changes)


def added_columns(target: IdentificationTarget, names: Sequence[str]) -> list[int]:
    """Places of the base parameters that chosen terms are."""
    columns = [target.model.columns[index] for index in target.base.index]
    called = [c.kind if c.kind == ROTOR else f"{c.kind} {c.owner}" for c in columns]
    return [k for k, name in enumerate(called) if name in names]


def possible_terms(robot: Robot, task: Task, free: frozenset[str]) -> frozenset[str]:
    """The settings without parameters that a task's model refuses, such as load shares of the energy model."""
    return free - {name for name in free & TERM_SETTINGS if not _is_possible(robot, task, name)}


def _is_possible(robot: Robot, task: Task, name: str) -> bool:
    try:
        wide = task.changed(**{name: True})
        model_of(moving_robot(robot, wide), wide)
    except InputError:
        return False
    return True
