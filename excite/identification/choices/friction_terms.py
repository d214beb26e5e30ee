"""Choice of the drives' optional parameters, and of factors of known friction curves."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from excite.identification.allowances import curves_of_moving, friction_torques, scaled_curves
from excite.identification.choices.left_out import (
    BlockStatistics,
    Candidate,
    Choice,
    Estimate,
    LeftOut,
    best_of,
    candidates_of,
    least_squares_of_products,
    left_out,
    weighted_sum,
)
from excite.identification.choices.scoring import (
    WITHIN,
    Scoring,
    of_base_columns,
    possible_estimate_of_products,
    pulled_least_squares,
)
from excite.identification.equations import constants, nearest
from excite.identification.estimators.possible_set import near_described
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget, model_of, target_of
from excite.registry import CHOSEN
from excite.tasks.model_options import without_curve
from excite.tasks.robot_of_task import moving_robot
from excite.tasks.task import Task
from regressors.errors import InputError, listed_names
from regressors.models.differential import standard_of
from regressors.models.load import EQUATIONS
from regressors.models.nominal import standard_values
from regressors.robot.columns import ASYMMETRY, LOAD_SHARE, OFFSET, ROOT, ROTOR, STRIBECK
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.robot import Robot
from regressors.samples import Array

TERM_SETTINGS = frozenset(CHOSEN) - {"cutoff", "signals", "delay", "bias", "friction_scale", "standstill", "estimator"}
_TERMS: Mapping[str, tuple[str, str, str]] = {  # option, name and words of each kind of optional parameter
    OFFSET: ("offset", "offset", "a constant offset"),
    LOAD_SHARE: ("load_share", "load share", "a share of the carried torque"),
    ROOT: ("root_friction", "root of the speed", "a part with the square root of the speed"),
    ASYMMETRY: ("asymmetric_friction", "asymmetry", "viscous friction that differs by direction"),
    STRIBECK: ("stribeck", "Stribeck part", "a Stribeck part"),
    ROTOR: ("joint_rotors", "rotor inertia", "rotor inertias"),
}
_SPEED = 0.2  # of the Stribeck part, in typical speeds


def choose_terms(
    scoring: Scoring, robot: Robot, task: Task, recipe: Recipe, free: frozenset[str]
) -> tuple[Task, Choice]:
    """Choose the optional parameters of each drive."""
    kinds = frozenset(kind for kind, (option, *_) in _TERMS.items() if option in free)
    scoring = scoring.prepared_by(recipe)
    wide_task = _with_all(task, kinds, scoring, recipe)
    wide = target_of(robot, wide_task, recipe.common_width, instantaneous=True)
    statistics = replace(scoring, target=wide).statistics(recipe)
    always, optional = drive_terms(wide, kinds)
    estimates = () if scoring.estimate is None else _with_bodies(wide, statistics, always)
    groups, steps, tried = choose_columns(statistics, always, optional, *estimates)
    chosen = with_terms(wide_task, groups, kinds)
    chosen_kinds = {kind for kind, _ in groups}
    carried = task.model.carried
    if LOAD_SHARE in chosen_kinds:
        own = scoring.with_target(target_of(robot, chosen, recipe.common_width, instantaneous=True), recipe)
        carried = _carried(own, own.statistics(recipe))
    speed = chosen.model.stribeck_speed if STRIBECK in chosen_kinds else task.model.stribeck_speed
    chosen = chosen.changed(carried=carried, stribeck_speed=speed)
    return chosen, Choice("terms", tuple(map(_label, groups)), tried, _reason(groups, steps, kinds))


def _with_all(task: Task, kinds: frozenset[str], scoring: Scoring, recipe: Recipe) -> Task:
    """The task with every term that may be chosen, of the drives whose friction is not known."""
    every = without_curve(True, scoring.target.robot, scoring.trial.friction)
    changes: dict[str, object] = {_TERMS[kind][0]: True if kind == ROTOR else every for kind in kinds}
    if LOAD_SHARE in kinds:
        changes["carried"] = _carried(scoring, scoring.statistics(recipe))
    if STRIBECK in kinds:
        speeds = np.concatenate([np.sqrt(np.mean(part.samples.dq**2, axis=0)) for part in scoring.parts(recipe)])
        changes["stribeck_speed"] = float(f"{_SPEED * np.median(speeds):.2g}")
    return task.changed(**changes)


def _carried(scoring: Scoring, statistics: BlockStatistics) -> dict[str, float]:
    """Standard parameters of the estimate, whose torques are carried."""
    beta = scoring.fitted(statistics, scoring.of(statistics).weights)
    return standard_of(scoring.target.model, scoring.target.base, beta)


def _with_bodies(
    target: IdentificationTarget, statistics: BlockStatistics, columns: Sequence[int]
) -> tuple[EstimateOf, EstimateOf]:
    """Possible bodies; and, to be quick, the described ones as prior knowledge, as near as is best."""
    described = standard_values(target.robot)
    few = statistics.of_columns(columns)
    pulls = {within: near_described(target.model, described, within) for within in WITHIN}
    scores = {within: left_out(few, pulled_least_squares(target, pull, columns)) for within, pull in pulls.items()}
    best = pulls[best_of(scores)]

    def possible(columns: Sequence[int]) -> Estimate:
        return possible_estimate_of_products(of_base_columns(target, columns), described, None)

    return possible, lambda columns: pulled_least_squares(target, best, columns)


def _label(group: Group) -> str:
    kind, drive = group
    return f"{kind} {drive}" if drive else kind


def _reason(groups: Sequence[Group], steps: Sequence[LeftOut], kinds: Collection[str]) -> str:
    if not groups:
        *others, last = [name for kind, (_, name, _) in _TERMS.items() if kind in kinds]
        either = f"{', '.join(others)} or {last}" if others else last
        return f"no {either} is added: none is clearly better in cross-validation"
    by_kind: dict[str, list[int]] = {}
    for kind, drive in groups:
        by_kind.setdefault(kind, []).append(drive)
    words = [_TERMS[kind][2] + _of(drives) for kind, drives in by_kind.items()]
    return f"added: {', '.join(words)}; error in cross-validation {steps[-1].percent} instead of {steps[0].percent}"


def _of(drives: Sequence[int]) -> str:
    numbers = ", ".join(str(drive) for drive in sorted(drives) if drive)
    return f" of drive{'s' * (len(drives) > 1)} {numbers}" if numbers else ""


_WORTH = 0.01  # gain of one equation's score
_TRIED = 8  # groups that a careful estimate tries at most in one step, where a quick one guesses

Group = tuple[str, int]
EstimateOf = Callable[[Sequence[int]], Estimate | None]


def choose_columns(
    statistics: BlockStatistics,
    always: Sequence[int],
    optional: Mapping[Group, Sequence[int]],
    careful: EstimateOf = lambda columns: None,
    quick: EstimateOf | None = None,
) -> tuple[list[Group], list[LeftOut], tuple[Candidate, ...]]:
    """Add the group of columns that lowers the left-out errors most, as long as the gain is clear.

    A gain is clear where it exceeds its standard error over the blocks, and a hundredth of one equation's error. The
    careful estimate decides, by the columns that are in it. A quick one guesses the gains: groups are tried in their
    order, until no other would be the best even if its guess missed as much as those before, of earlier steps half.
    """
    columns = list(always)
    chosen: list[Group] = []
    steps = [_errors(statistics, columns, careful)]
    least = _WORTH / statistics.products.shape[1]
    scores: dict[Group, LeftOut] = {}
    missed = 2.0 * least
    while remaining := {group: added for group, added in optional.items() if group not in chosen}:
        guesses = dict.fromkeys(remaining, np.inf)
        if quick is not None:
            before = _errors(statistics, columns, quick)
            guess = {g: _errors(statistics, [*columns, *added], quick, before) for g, added in remaining.items()}
            promising = sorted(remaining, key=lambda group: guess[group].score)[:_TRIED]
            guesses = {group: before.score - guess[group].score for group in promising}
            scores = {**{group: guess[group] for group in promising}, **scores}  # of all that could have been chosen
        clear, most, missed = dict[Group, LeftOut](), least, missed / 2
        for group, guessed in guesses.items():
            if guessed + missed < most:
                break
            errors = _errors(statistics, [*columns, *remaining[group]], careful, steps[-1])
            scores[group], gain = errors, steps[-1].score - errors.score
            missed = max(missed, gain - guessed)
            if errors.is_better(steps[-1], least):
                clear[group], most = errors, max(most, gain)
        if not clear:
            break
        best = best_of(clear)
        chosen.append(best)
        columns += optional[best]
        steps.append(clear[best])
    listed = {"none": steps[0], **{_label(group): errors for group, errors in scores.items()}}
    return chosen, steps, candidates_of(listed)


def _errors(
    statistics: BlockStatistics, columns: Sequence[int], estimate: EstimateOf, before: LeftOut | None = None
) -> LeftOut:
    weights = None if before is None else before.weights
    return left_out(statistics.of_columns(columns), estimate(columns), weights)


def drive_terms(
    target: IdentificationTarget, free: frozenset[str]
) -> tuple[tuple[int, ...], dict[Group, tuple[int, ...]]]:
    """Base columns that are kept, and the others by kind and drive; rotor inertias together, as of drive 0."""
    optional: dict[Group, tuple[int, ...]] = {}
    always = []
    for k, index in enumerate(target.base.index):
        column = target.model.columns[index]
        owner = 0 if column.kind == ROTOR else column.owner
        if column.kind in free and owner is not None:
            group = column.kind, owner
            optional[group] = (*optional.get(group, ()), k)
        else:
            always.append(k)
    return tuple(always), optional


def with_terms(task: Task, groups: list[Group], free: frozenset[str]) -> Task:
    """A task with the chosen terms, and without the others that were free."""
    drives = {kind: tuple(str(drive) for k, drive in sorted(groups) if k == kind) for kind in free}
    return task.changed(
        **{_TERMS[kind][0]: bool(own) if kind == ROTOR else own or False for kind, own in drives.items()}
    )


def added_columns(target: IdentificationTarget, names: Sequence[str]) -> list[int]:
    """Places of the base parameters that chosen terms are."""
    columns = [target.model.columns[index] for index in target.base.index]
    called = [c.kind if c.kind == ROTOR else f"{c.kind} {c.owner}" for c in columns]
    return [k for k, name in enumerate(called) if name in names]


def possible_terms(robot: Robot, task: Task, free: frozenset[str]) -> frozenset[str]:
    """The settings without parameters that a task's model refuses, such as load shares of the energy model."""
    for name in free & TERM_SETTINGS:
        wide = task.changed(**{name: True})
        try:
            model_of(moving_robot(robot, wide), wide)
        except InputError:
            free -= {name}
    return free


_SCALE_WORTH = 0.005  # of the score: below that the curves stay as they are given
_HIDDEN = 1e-3  # of a curve's torque: what the parameters must leave of it, if its factor is to be found
_LARGEST_FACTOR = 10.0  # and its inverse the least


def choose_friction_scale(
    scoring: Scoring, recipe: Recipe, friction: FrictionCurves
) -> tuple[Recipe, FrictionCurves, tuple[Choice, ...]]:
    """Scale known friction where this predicts left-out torques better by more than a standard error, and 0.5 %.

    The curves have the factors that the trial instants ask for, or are as given; no choice where no moving one has any.
    """
    names = curves_of_moving(scoring.target, friction)
    if not names:
        return recipe, friction, ()
    statistics = _beside(scoring, recipe, lambda part: friction_torques(scoring.target, part, friction, recipe))
    given = scoring.of(statistics.of_columns(range(scoring.target.base.rank)))
    fitted = scoring.of(statistics)
    factors = _factors(scoring, statistics, fitted, len(names))
    if factors is not None and fitted.is_better(given, _SCALE_WORTH):
        reason = (
            f"known friction is scaled by one fitted factor for each curve: error in cross-validation "
            f"{fitted.percent} instead of {given.percent}"
        )
        friction = scaled_curves(friction, dict(zip(names, factors.tolist(), strict=True)))
        recipe = replace(recipe, friction_scale=True)
    else:
        reason = (
            f"known friction is subtracted as given: error in cross-validation {given.percent}, not clearly better "
            f"with one fitted factor for each curve ({fitted.percent})"
        )
    choice = Choice("friction_scale", recipe.friction_scale, candidates_of({False: given, True: fitted}), reason)
    return recipe, friction, (choice,)


def _beside(scoring: Scoring, recipe: Recipe, signals: Callable[[PreparedLog], Array]) -> BlockStatistics:
    """Statistics with k signals like the measured one, (k, N, n) along each log, as the last columns."""
    trial, target, parts = scoring.trial, scoring.target, scoring.parts(recipe)
    equations = trial.equations(target, parts, recipe)
    W, width = [], target.base.rank
    for part, time, (regressor, _) in zip(parts, trial.instants, equations, strict=True):
        rows = nearest(part.samples.time, time)
        samples = part.samples.rows(rows)
        added = np.array([target.model.right_side(samples, y[rows]).reshape(rows.size, -1).T for y in signals(part)])
        more, width = target.base.rank + np.arange(len(added)), target.base.rank + len(added)
        beside = zip(regressor, added.transpose(1, 0, 2), strict=True)
        W.append([(np.append(place, more), np.concatenate([entries, own])) for (place, entries), own in beside])
    return BlockStatistics.of(W, [right for _, right in equations], trial.blocks, width)


def _factors(scoring: Scoring, statistics: BlockStatistics, errors: LeftOut, count: int) -> Array | None:
    """Factors of the curves, or None where they are not determined, or are none of friction."""
    if not np.all(_told_apart(statistics, errors.weights, count) > _HIDDEN):
        return None
    factors = 1.0 + scoring.fitted(statistics, errors.weights)[-count:]
    return factors if np.all((factors > 1.0 / _LARGEST_FACTOR) & (factors < _LARGEST_FACTOR)) else None


def _told_apart(statistics: BlockStatistics, weights: Array, count: int) -> Array:
    """Share of each of the last columns that all others leave, shape (count,)."""
    both = weighted_sum(statistics.total, weights)[:-1, :-1]
    length = np.sqrt(np.diag(both))
    length = np.where(length > 0.0, length, 1.0)
    both = both / np.outer(length, length)
    left = []
    for k in range(len(both) - count, len(both)):
        own, others = both[k, k], np.delete(both[k], k)
        known = np.linalg.pinv(np.delete(np.delete(both, k, 0), k, 1), hermitian=True)
        left.append(own - others @ known @ others)
    return np.sqrt(np.maximum(left, 0.0))


_TOLD_APART = 0.05  # of a bias that the parameters must leave


def choose_bias(scoring: Scoring, recipe: Recipe) -> tuple[Recipe, Choice]:
    """The bias of the force/torque sensor as constants, of the components where the motion tells it from the bodies."""
    rank, statistics = scoring.target.base.rank, _beside(scoring, recipe, constants)
    none = left_out(statistics.of_columns(range(rank)))
    used = np.flatnonzero(np.diag(statistics.total.sum(axis=0))[rank:-1] > 0)  # components that have equations
    every = statistics.of_columns([*range(rank), *(rank + used)])
    shown = used[_told_apart(every, none.weights, used.size) > _HIDDEN]  # the others are parameters too
    few = statistics.of_columns([*range(rank), *(rank + shown)])
    if not shown.size or np.any(_told_apart(few, none.weights, shown.size) <= _TOLD_APART):
        reason = "no bias is subtracted, since the motion hardly tells it from the bodies: tare the sensor"
        return recipe, Choice("bias", "none", candidates_of({"none": none}), reason)
    fitted, bias = left_out(few), np.zeros(len(EQUATIONS))
    bias[shown] = least_squares_of_products(weighted_sum(few.total, fitted.weights))[-shown.size :]
    values = tuple(float(f"{b:.6g}") for b in bias)
    hidden = listed_names([EQUATIONS[k] for k in used if k not in shown])
    reason = (
        f"a bias of the sensor is subtracted, {', '.join(f'{b:.3g}' for b in values)} N and Nm, which the intervals "
        f"include; error in cross-validation {fitted.percent} instead of {none.percent}"
        + (f"; {hidden}: the motion hardly tells a bias from the bodies, tare the sensor" if hidden else "")
    )
    listed = candidates_of({"none": none, "constants": fitted})
    return replace(recipe, bias=values), Choice("bias", values, listed, reason)
