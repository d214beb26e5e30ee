"""Choice of the cutoff, the method of signals, the delay of torques, and how Coulomb friction changes its direction."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache

import numpy as np
import scipy.optimize
import scipy.stats

from excite.identification.choices.left_out import Choice, LeftOut, best_of, candidates_of, jackknife
from excite.identification.choices.scoring import Scoring
from excite.identification.equations import listed
from excite.identification.preparation import PreparedLog
from excite.identification.presliding import presliding_candidates
from excite.identification.recipe import Recipe
from regressors.errors import InputError, percent
from regressors.samples import Array

_TIMES_IN_TURN = 3
Chosen = tuple[Recipe, tuple[Choice, ...]]


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


Scored = Callable[[float], LeftOut]

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
    reason = f"positions are low-passed at {value:g} Hz, which predicts left-out torques to {scores[chosen].percent}"
    if chosen != best:
        gain, deviation = gains[chosen]
        reason += f" ({best:.3g} Hz: {scores[best].percent}, better by {100 * gain:.2g} +- {percent(deviation)} only)"
    elif last != best:
        reason += f" ({last:.3g} Hz: {scores[last].percent})"
    return value, Choice("cutoff", value, candidates_of(dict(sorted(scores.items()))), reason, "Hz")


LONGEST = 0.05  # [s]
_GRID = 0.01  # [s]
_PRECISION = 1e-5  # [s]
_CONVINCING = 2.0  # standard errors


def choose_delay(scored: Scored, step: float) -> tuple[float, Choice]:
    """Delay of the torques after the motion; zero where it does not predict left-out torques clearly better.

    Nor is a delay taken whose interval contains zero, or that is at the end of the range that is searched.
    """
    tried = {0.0: scored(0.0)}

    def score(delay: float) -> float:
        tried[float(delay)] = scored(float(delay))
        return tried[float(delay)].score

    near = min((-_GRID, 0.0, _GRID), key=score)
    while abs(near) < LONGEST and near and score(further := near + np.copysign(_GRID, near)) < tried[near].score:
        near = further
    scipy.optimize.minimize_scalar(
        score, bounds=(near - _GRID, near + _GRID), method="bounded", options={"xatol": max(_PRECISION, 0.01 * step)}
    )
    best, listed = best_of(tried), candidates_of(dict(sorted(tried.items())))
    gain, _ = tried[best].gain_over(tried[0.0])
    half = _half_width(scored, best, max(0.1 * step, 1e-4))
    if not half < abs(best) < LONGEST or not tried[best].is_better(tried[0.0], LEAST_GAIN, _CONVINCING):
        reason = "torques and positions are taken as recorded at the same time: no delay predicts clearly better"
        return 0.0, Choice("delay", 0.0, listed, reason, "s")
    best = round(best, 6)
    when = "before" if best > 0 else "after"
    reason = (
        f"torques are matched with the motion {1e3 * abs(best):.3g} +- {1e3 * half:.2g} ms {when} them, which lowers "
        f"the errors of left-out torques by {percent(1 - np.exp(-gain))}, the mean over the joints; what friction "
        "does at its reversals can look like a delay"
    )
    return best, Choice("delay", best, listed, reason, "s", (best - half, best + half))


LEAST_GAIN = 0.002  # of the score


def _half_width(scored: Scored, delay: float, h: float) -> float:
    """Half of the 99 % interval, by leaving one block after the other out of a parabola of the errors [s].

    Its points are h apart, which is added: friction jumps from row to row, so that nearer delays look alike.
    """
    below, at, above = (scored(delay + shift) for shift in (-h, 0.0, h))
    weights = at.weights
    rows = np.array([(s.squares * weights).sum(axis=1) for s in (below, at, above)])
    minima = np.array([_vertex(rows.sum(axis=1) - row, h) for row in rows.T])
    return h + float(scipy.stats.t.ppf(0.995, minima.size - 1) * jackknife(minima))


def _vertex(values: Array, h: float) -> float:
    """Place of the minimum of a parabola through three values, h apart, from the middle one."""
    curvature = values[0] - 2 * values[1] + values[2]
    return float(h / 2 * (values[0] - values[2]) / curvature) if curvature > 0 else 0.0


_SLIDING_WORTH = 0.005  # of the score: below that the exact sign stays
_HOLDING = 0.05  # of the score: what a direction at standstill is worth, where the logs do not show it
_FACTORS = (0.25, 0.5, 2**-0.5, 1.0, 2**0.5, 2.0, 4.0)


def choose_timing(scoring: Scoring, recipe: Recipe, free: frozenset[str]) -> Chosen:
    """Choose the presliding of friction and the delay of the torques.

    A friction that changes its direction late looks like a delay; so each kind of presliding is tried with its own best
    delay. Presliding over a distance is preferred where it predicts as well as the best, within a standard error or 5 %
    of the errors: only it has a direction at standstill, which exciting motions hardly show, but others do. No kind is
    preferred with a larger delay than that of the best.
    """
    parts = scoring.parts(recipe)
    softened = cache(scoring.softened)

    @cache
    def scored(recipe: Recipe, delay: float) -> LeftOut:
        return softened(recipe).of(softened(recipe).statistics(recipe, parts, delay))

    step = min(1 / part.log.rate for part in parts)
    timings = [_timing(scored, tried, step, free) for tried in _slidings(scoring, recipe, parts)]
    best = min(timings, key=lambda one: one[1].score)

    def with_no_more_delay(one: _Timing) -> _Timing:
        delay = best[0].delay
        if abs(one[0].delay) <= abs(delay):
            return one
        return replace(one[0], delay=delay), scored(one[0], delay), best[2]

    exact, last = with_no_more_delay(timings[0]), with_no_more_delay(timings[-1])
    chosen = best
    if best[1].score > exact[1].score - _SLIDING_WORTH:
        chosen = exact
    elif last[0].breakaway and not best[1].is_better(last[1], _HOLDING):
        chosen = last
    if len(timings) == 1:
        return chosen[0], chosen[2]
    words = _sliding_words(chosen[0])
    listed = candidates_of({_sliding_words(tried): errors for tried, errors, _ in timings})
    return chosen[0], (*chosen[2], Choice("presliding", words, listed, f"{words}, as left-out torques show"))


def _slidings(scoring: Scoring, recipe: Recipe, parts: Sequence[PreparedLog]) -> list[Recipe]:
    if recipe.sign_width is not None or recipe.breakaway is not None:
        return [replace(recipe, sign_width=recipe.sign_width or 0.0, breakaway=recipe.breakaway or 0.0)]
    found = presliding_candidates(recipe, scoring.target, parts, scoring.trial.friction)
    return [replace(recipe, **sliding) for sliding, _ in found]


_Timing = tuple[Recipe, LeftOut, tuple[Choice, ...]]


def _timing(scored: Callable[[Recipe, float], LeftOut], recipe: Recipe, step: float, free: frozenset[str]) -> _Timing:
    """Best delay of a kind of presliding, and then its best size at that delay."""
    if "delay" not in free:
        return recipe, scored(recipe, 0.0), ()
    delay, choice = choose_delay(lambda tried: scored(recipe, tried), step)
    resized = _resized(recipe, lambda tried: scored(tried, delay)) if delay else recipe
    if resized != recipe:
        delay, choice = choose_delay(lambda tried: scored(resized, tried), step)
    return replace(resized, delay=delay), scored(resized, delay), (choice,)


def _resized(recipe: Recipe, scored: Callable[[Recipe], LeftOut]) -> Recipe:
    """The presliding with a velocity or a distance that predicts best, up to four times or a quarter of the given."""
    kind = "breakaway" if recipe.breakaway else "sign_width"
    given = getattr(recipe, kind)
    if not given or isinstance(given, tuple):
        return recipe
    tried = [replace(recipe, **{kind: given * factor}) for factor in _FACTORS]
    return min(tried, key=lambda one: scored(one).score)


def _sliding_words(recipe: Recipe) -> str:
    if np.any(recipe.breakaway or 0.0):
        over = listed(recipe.breakaway)
        return f"Coulomb friction changes its direction over {over} rad (or m), and holds at standstill"
    if np.any(recipe.sign_width or 0.0):
        return f"Coulomb friction changes its sign over {listed(recipe.sign_width)} rad/s (or m/s)"
    return "Coulomb friction has the sign of the velocity"


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
        reason = f"positions {_METHODS[_LOW_PASS]}: no other method predicts left-out torques clearly better ({others})"
        return recipe, (Choice("signals", _LOW_PASS, listed, reason),)
    reason = (
        f"positions {_METHODS[best]}, which predicts left-out torques to {tried[best].percent}; after the low-pass "
        f"they are predicted to {tried[_LOW_PASS].percent}"
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
