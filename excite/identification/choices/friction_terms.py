"""Choice of the drives' optional parameters: friction terms and rotor inertias."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from excite.identification.choices.block_statistics import BlockStatistics
from excite.identification.choices.bodies import of_base_columns, possible_estimate_of_products
from excite.identification.choices.choice import Candidate, Choice
from excite.identification.choices.columns import Estimates, Group, choose_columns
from excite.identification.choices.drive_terms import NAMES, OPTIONS, WORDS, drive_terms, with_terms
from excite.identification.choices.left_out import Estimate, LeftOut, least_squares_of_products, left_out
from excite.identification.choices.pulled import pulled_least_squares
from excite.identification.choices.scoring import Scoring
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget, target_of
from excite.tasks.drive_choice import without_curve
from excite.tasks.task import Task
from regressors.models.carried_torque import standard_of
from regressors.models.columns import LOAD_SHARE, ROTOR, STRIBECK
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
