"""Choice of the cutoff and of the method of signals, by all rows or, where friction holds others, by those that move.

Friction at standstill takes any value, and jumps where a drive breaks loose. To predict such rows, a low cutoff and a
delay help that blur them, and bias what moving drives show.

Where friction is not a function of the motion, rows may also be left out of the estimate: those of slow drives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from excite.identification.biases import SPEEDS, standstill_candidates
from excite.identification.choices.delays import LONGEST, Scored
from excite.identification.choices.left_out import Choice, LeftOut, best_of, candidates_of, differ, jackknife
from excite.identification.choices.scoring import Mask, Scoring, masked
from excite.identification.choices.timing import Chosen, DelayFit, choose_timing, delay_of
from excite.identification.equations import nearest
from excite.identification.recipe import Recipe
from excite.information.target import least_speeds, typical_speed
from regressors.errors import InputError, percent
from regressors.robot.columns import ASYMMETRY, ROOT, STRIBECK
from regressors.samples import Array

_TIMES_IN_TURN = 3


def choose_cutoff_and_timing(
    scoring: Scoring, recipe: Recipe, cutoffs: Sequence[float], free: frozenset[str]
) -> Chosen:
    """Choose the cutoff, the presliding of friction and the delay of the torques.

    The errors of a delay or a friction that is not known hide what a cutoff does. So where one is found, the cutoff is
    chosen again with it, and the timing again with that cutoff, until the cutoff stays.
    """
    if not cutoffs:
        return choose_timing(scoring, recipe, free)
    known, of_timing = recipe, tuple[Choice, ...]()

    def scored(cutoff: float) -> LeftOut:
        timed = scoring.softened(known)  # with what is known of the timing
        return timed.of(timed.statistics(replace(known, cutoff=cutoff)))

    for _ in range(_TIMES_IN_TURN):
        cutoff, choice = choose_cutoff(cutoffs, scored)
        if of_timing and cutoff == known.cutoff:
            break
        known, of_timing = choose_timing(scoring, replace(recipe, cutoff=cutoff), free)
        if known == replace(recipe, cutoff=cutoff):
            break
    return known, (choice, *of_timing)


_STEP = 2.0  # between the cutoffs that are tried first
PERIODS = 2.0  # of the cutoff that are cut from each end, see `excite.logs.signals.filters.edge`
_CUT = 0.05  # largest share of a log that may be cut from each end
HIGHEST = 0.35  # of the sample rate
_PLATEAU = 0.001, 0.005  # of the score: a gain that counts as none, within its standard error up to the second


def cutoff_candidates(duration: float, rate: float) -> list[float]:
    """Cutoffs to try, from the lowest that leaves nine tenths of a log to 0.35 of the sample rate [Hz].

    None where a log has too few rows for both.
    """
    highest = HIGHEST * rate
    lowest = PERIODS / (_CUT * duration)
    if lowest > highest:
        return []
    count = int(np.floor(np.log(highest / lowest) / np.log(_STEP))) + 1
    return [float(highest / _STEP**k) for k in range(count)][::-1]


def choose_cutoff(candidates: Sequence[float], scored: Scored) -> tuple[float, Choice]:
    """Highest cutoff that predicts as well as the best, within the standard error: by octaves, then beside the best.

    A cutoff that is too low loses motion; one that is too high lets noise through, which spoils the accelerations.
    """
    scores = {cutoff: scored(cutoff) for cutoff in candidates}
    for ratio in (np.sqrt(_STEP), np.sqrt(np.sqrt(_STEP))):
        best = best_of(scores)
        for near in (best / ratio, best * ratio):
            if min(scores) < near < max(scores) and not any(abs(np.log(near / c)) < 1e-6 for c in scores):
                scores[near] = scored(near)
    best, last = best_of(scores), max(scores)
    gains = {cutoff: scores[best].gain_over(errors) for cutoff, errors in scores.items()}
    chosen = max(cutoff for cutoff, (gain, e) in gains.items() if gain <= min(max(e, _PLATEAU[0]), _PLATEAU[1]))
    value = float(f"{chosen:.3g}")
    reason = f"positions are low-passed at {value:g} Hz: error in cross-validation {scores[chosen].percent}"
    if chosen != best:
        gain, deviation = gains[chosen]
        reason += f" ({best:.3g} Hz: {scores[best].percent}, better by {100 * gain:.2g} +- {percent(deviation)} only)"
    elif last != best:
        reason += f" ({last:.3g} Hz: {scores[last].percent})"
    return value, Choice("cutoff", value, candidates_of(dict(sorted(scores.items()))), reason, "Hz")


_METHOD_WORTH = 0.01  # of the score: below that the low-pass stays
_LOW_PASS = "butterworth"
_METHODS = {
    _LOW_PASS: "are differentiated after the low-pass",
    "savitzky-golay": "are differentiated by polynomials over moving windows of that bandwidth (savitzky-golay)",
    "spline": "are differentiated by splines with knots of that bandwidth (spline)",
    "measured velocity": "are low-passed, and the measured velocities are used (`measured_velocity`)",
    "fourier": "are fitted by Fourier series, since the motion repeats itself (fourier)",
}


def choose_signals(scoring: Scoring, recipe: Recipe, *, whole: bool) -> Chosen:
    """Choose the method: another than the low-pass where it predicts better by more than a standard error, and 1 %.

    The others have the bandwidth of the low-pass, so that one evaluation of each is enough. Averages over periods are
    not among them: they have other rows.
    """
    timed, recipes, tried = scoring.softened(recipe), _recipes(scoring, recipe, whole=whole), dict[str, LeftOut]()
    for name, one in recipes.items():
        with suppress(InputError):  # it does not apply, as a Fourier series to what does not repeat
            tried[name] = timed.of(timed.statistics(one))
    if len(tried) < 2 or _LOW_PASS not in tried:
        return recipe, ()
    best, listed = best_of(tried), candidates_of(tried)
    if not tried[best].is_better(tried[_LOW_PASS], _METHOD_WORTH):
        others = ", ".join(name for name in tried if name != _LOW_PASS)
        reason = f"positions {_METHODS[_LOW_PASS]}: no other method is clearly better in cross-validation ({others})"
        return recipe, (Choice("signals", _LOW_PASS, listed, reason),)
    reason = (
        f"positions {_METHODS[best]}: error in cross-validation {tried[best].percent}, after the low-pass "
        f"{tried[_LOW_PASS].percent}"
    )
    return replace(recipes[best], cutoff=recipe.cutoff, signals_chosen=True), (Choice("signals", best, listed, reason),)


def _recipes(scoring: Scoring, recipe: Recipe, *, whole: bool) -> dict[str, Recipe]:
    names = [_LOW_PASS, "savitzky-golay", *(["spline"] if recipe.cutoff is not None else [])]
    recipes = {name: replace(recipe, signals=name) for name in names}
    if all(log.dq is not None for log in scoring.trial.logs):
        recipes["measured velocity"] = replace(recipe, measured_velocity=True)
    if whole:
        recipes["fourier"] = replace(recipe, signals="fourier", cutoff=None)
    return recipes


MOVING = 0.1  # of the typical speed
_ALL, _MOVING, _FAST_DELAY = "all", "of moving drives", "all, but for the delay"
_FAST = 0.4  # of the typical speed: rows that what happens at reversals does not reach
_LEAST = 0.05  # of the rows of an equation, that others can be compared with
_WORTH = 0.01  # of the score
_HIGHER = 2.0  # times the cutoff


@dataclass(frozen=True, eq=False)
class RowChoice:
    """By which rows settings are chosen, and what was chosen by them."""

    scoring: Scoring
    recipe: Recipe
    choices: tuple[Choice, ...]
    free: frozenset[str]  # settings that are still to be chosen by these rows
    least: float = 0.0  # speed below which rows have no part in it, of the typical one


def choose_by_rows(scoring: Scoring, plain: Recipe, cutoffs: Sequence[float], free: frozenset[str]) -> RowChoice:
    """Choose cutoff and timing by all rows; or by those of moving drives, where the others spoil the choice.

    Where rows near standstill are predicted worse than the others, beyond a standard error, everything is chosen by the
    rows of moving drives as well, with the delay of fast ones; and where the delay predicts the rows of fast drives no
    better than none, which is what friction does near standstill, by all rows with the delay of fast ones. The best of
    these is taken if it predicts the rows of moving drives clearly better, or alike with a much higher cutoff.
    """
    recipe, choices = choose_cutoff_and_timing(scoring, plain, cutoffs, free)
    every = RowChoice(scoring, recipe, choices, free)
    if not {"cutoff", "delay"} & free or "standstill" not in free or scoring.target.model.torque_equations() is None:
        return every
    moving, fast = (_of_faster(scoring, recipe, share) for share in (MOVING, _FAST))
    if moving is None or fast is None or not _spoilt(scoring, moving, recipe):
        return every
    timed, of_delay = _timed_by(fast, plain, every)

    def by(rows: Scoring) -> RowChoice:
        """Cutoff and presliding by some rows, with that delay."""
        settled, others = choose_cutoff_and_timing(rows, timed, cutoffs, free - {"delay"})
        return RowChoice(rows, settled, (*others, *of_delay), free - {"delay"})

    tried = {_ALL: every, _MOVING: replace(by(moving), least=MOVING)}
    if _misled(fast, recipe, plain):
        tried[_FAST_DELAY] = by(scoring)
    errors = {name: _errors(one.scoring, one.recipe, moving) for name, one in tried.items()}
    name, reason = preferred_rows({name: one.recipe.cutoff for name, one in tried.items()}, errors)
    choice = Choice("rows", name, candidates_of(errors), reason)
    return replace(tried[name], choices=(*tried[name].choices, choice))


def preferred_rows(cutoffs: Mapping[str, float | None], errors: Mapping[str, LeftOut]) -> tuple[str, str]:
    """By which rows settings are chosen, and why, from the cutoff that each found and the errors it leaves.

    A low cutoff blurs what friction does near standstill into rows that all parameters are then estimated from. So
    those of moving drives are taken if they predict as well with a cutoff that is more than twice as high.
    """
    best, low, high = best_of(errors), cutoffs[_ALL], cutoffs.get(_MOVING)
    if errors[best].is_better(errors[_ALL], _WORTH):
        what, instead = ("the delay is" if best == _FAST_DELAY else "settings are"), errors[_ALL].percent
        return best, (
            f"{what} chosen by the rows of moving drives, since friction near standstill misleads the choice by all "
            f"rows: their error in cross-validation is then {errors[best].percent} instead of {instead}"
        )
    if low and high and high > _HIGHER * low and not errors[_ALL].is_better(errors[_MOVING], _WORTH):
        return _MOVING, (
            f"settings are chosen by the rows of moving drives, which are predicted as well with a cutoff of {high:g} "
            f"Hz ({errors[_MOVING].percent}) as with one of {low:g} Hz by all rows ({errors[_ALL].percent}), which "
            "blurs friction near standstill into the others"
        )
    return (_ALL, "settings are chosen by all rows: without those near standstill others are predicted no better")


def _timed_by(fast: Scoring, plain: Recipe, every: RowChoice) -> Chosen:
    """The recipe with the delay of the rows of fast drives, or of every row if these cannot tell."""
    if "delay" not in every.free:
        return plain, ()
    recipe = replace(every.recipe, delay=plain.delay, log_delays=plain.log_delays)
    soft = fast.softened(recipe)
    delay, choice = delay_of(soft, DelayFit(recipe))
    if choice.interval and np.ptp(choice.interval) > LONGEST:
        choice = next(one for one in every.choices if one.name == "delay")
        delay = choice.value
    return replace(plain, delay=delay), (choice,)


def _of_faster(scoring: Scoring, recipe: Recipe, share: float) -> Scoring | None:
    """Scoring by rows whose drives are faster than a share of the typical speed; None where no others are there."""
    parts = scoring.parts(recipe)
    least = share * typical_speed(scoring.target.robot, [part.samples for part in parts])
    masks: list[Mask] = [
        least_speeds(scoring.target, part.samples)[nearest(part.samples.time, time)] >= least
        for part, time in zip(parts, scoring.trial.instants, strict=True)
    ]
    shares = np.concatenate(masks).mean(axis=0)
    if np.any(shares < _LEAST) or np.all(shares > 1 - _LEAST):
        return None
    return replace(scoring, trial=replace(scoring.trial, rows=tuple(masks)))


def _misled(fast: Scoring, recipe: Recipe, plain: Recipe) -> bool:
    """True if a chosen delay predicts the rows of fast drives no better than none, by a standard error."""
    if recipe.delay == plain.delay:
        return False
    gain, deviation = _errors(fast, recipe, fast).gain_over(_errors(fast, replace(recipe, delay=plain.delay), fast))
    return gain < deviation


def _spoilt(scoring: Scoring, moving: Scoring, recipe: Recipe) -> bool:
    """True if rows of slow drives are predicted worse than those of moving ones, beyond a standard error."""
    fast = _errors(scoring, recipe, moving).squares
    slow = np.maximum(_errors(scoring, recipe, scoring).squares - fast, 0.0)
    masks = moving.trial.rows or ()
    moved, total = _counts(scoring, masks), _counts(scoring, [np.ones_like(mask) for mask in masks])

    def excess(blocks: Array) -> float:
        """Mean over the equations of the logarithm of the ratio of errors."""
        squares, rows = (np.array([blocks @ x for x in pair]) for pair in ((slow, fast), (total - moved, moved)))
        shown = np.all((squares > 0) & (rows > 0), axis=0)
        ratio = np.log(squares[:, shown] / rows[:, shown])
        return float(np.mean(ratio[0] - ratio[1])) / 2 if np.any(shown) else 0.0

    count = len(slow)
    deviation = jackknife(np.array([excess(1.0 - one) for one in np.eye(count)]))
    return excess(np.ones(count)) > max(deviation, _WORTH)


def _counts(scoring: Scoring, masks: Sequence[Mask]) -> Array:
    """Rows of each block and equation, shape (B, r)."""
    logs = zip(masks, scoring.trial.blocks, strict=True)
    sums = [mask[block == k].sum(axis=0) for mask, block in logs for k in np.unique(block[block >= 0])]
    return np.array(sums, dtype=float)


def _errors(scoring: Scoring, recipe: Recipe, judge: Scoring) -> LeftOut:
    """Left-out errors of the judge's rows, with estimates from those of the scoring."""
    soft = scoring.softened(recipe)
    equations = soft.equations(recipe)
    statistics, judged = (one.trial.statistics_of(equations, soft.target.base.rank) for one in (scoring, judge))
    return soft.of(statistics, judged)


_KEPT_WORTH = 0.01  # of the score: below that every row stays
_STILL_TOLD = 0.1  # of what all rows tell of a term of friction


def choose_standstill(scoring: Scoring, recipe: Recipe, least: float = 0.0) -> tuple[Recipe, tuple[Choice, ...]]:
    """Choose the speed below which rows are left out, by the rows that every candidate keeps.

    The smallest speed is taken that is as good as the best within a standard error, and clearly better than none; and
    the next one, as long as its rows give clearly other estimates and the others are predicted no worse. None is taken
    whose rows tell less than a tenth of what all rows tell of a term by which friction depends on the speed.
    """
    parts = scoring.parts(recipe)
    candidates = standstill_candidates(scoring.target, parts)
    if len(candidates) < 2:
        return recipe, ()
    trial, target, times = scoring.trial, scoring.target, scoring.trial.instants
    rows = [part.samples.rows(nearest(part.samples.time, time)) for part, time in zip(parts, times, strict=True)]
    speeds = [least_speeds(target, samples) for samples in rows]
    equations = trial.equations(target, parts, recipe)
    kept = {v: masked(equations, [speed >= v for speed in speeds]) for v in candidates}
    statistics = {v: trial.statistics_of(one, target.base.rank) for v, one in kept.items()}
    scores = {v: scoring.of(one, statistics[candidates[-1]]) for v, one in statistics.items()}
    fast = [v for share, v in zip(SPEEDS, candidates, strict=False) if share >= least] or [candidates[-1]]
    terms = [target.base.columns[int(k)].kind in (ASYMMETRY, ROOT, STRIBECK) for k in target.base.index]
    told = {v: one.information(scores[0.0].weights)[terms] for v, one in statistics.items()}
    allowed = {v: scores[v] for v in fast if np.all(told[v] >= _STILL_TOLD * told[0.0])} or {fast[0]: scores[fast[0]]}
    best = allowed[best_of(allowed)]
    hidden = ", or do not show how friction depends on the speed" if len(allowed) < len(fast) else ""
    reason = f"rows of slow drives are kept: without them the others are predicted no better{hidden}"
    chosen = next(v for v, errors in allowed.items() if not best.is_better(errors, _KEPT_WORTH))
    for faster in [v for v in allowed if v > chosen] if chosen else ():
        still = differ(statistics[chosen], statistics[faster], scores[chosen].weights)
        if not still or scores[chosen].is_better(scores[faster], _KEPT_WORTH):
            break
        chosen = faster
    value = float(f"{chosen:.3g}")
    if chosen:
        reason = (
            f"rows are left out while a drive is slower than {value:g} rad/s (or m/s), where friction may hold it: the "
            f"error of the others in cross-validation is then {scores[chosen].percent} instead of {scores[0.0].percent}"
        )
        recipe = replace(recipe, standstill=value)
    return recipe, (Choice("standstill", value, candidates_of(scores), reason, "rad/s or m/s"),)
