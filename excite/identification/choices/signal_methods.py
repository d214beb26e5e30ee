"""Choice of the method from positions to velocities and accelerations."""

from __future__ import annotations

from dataclasses import replace

from excite.identification.choices.choice import Candidate, Choice
from excite.identification.choices.left_out import LeftOut
from excite.identification.choices.scoring import Scoring
from excite.identification.choices.sliding import softened
from excite.identification.recipe import Recipe
from regressors.errors import InputError

_WORTH = 0.01  # of the score: below that the low-pass stays
_LOW_PASS = "butterworth"
_METHODS = {
    _LOW_PASS: "are differentiated after the low-pass",
    "savitzky-golay": "are differentiated by polynomials over moving windows of that bandwidth (savitzky-golay)",
    "spline": "are differentiated by splines with knots of that bandwidth (spline)",
    "measured velocity": "are low-passed, and the measured velocities are used (`measured_velocity`)",
    "fourier": "are fitted by Fourier series, since the motion repeats itself (fourier)",
}


def choose_signals(scoring: Scoring, recipe: Recipe, *, whole: bool) -> tuple[Recipe, tuple[Choice, ...]]:
    """Choose the method: another than the low-pass where it predicts better by more than a standard error, and 1 %.

    The others have the bandwidth of the low-pass, so that one evaluation of each is enough. Averages over periods are
    not among them: they have other rows.
    """
    timed = replace(scoring, target=softened(scoring.target, recipe))
    recipes = _recipes(recipe, whole=whole, velocities=all(log.dq is not None for log in scoring.trial.logs))
    tried = {name: errors for name, one in recipes.items() if (errors := _errors(timed, one)) is not None}
    if len(tried) < 2 or _LOW_PASS not in tried:
        return recipe, ()
    listed = tuple(Candidate(name, errors.error, errors.score) for name, errors in tried.items())
    best = min(tried, key=lambda name: tried[name].score)
    gain, deviation = tried[best].gain_over(tried[_LOW_PASS])
    if gain <= max(deviation, _WORTH):
        others = ", ".join(name for name in tried if name != _LOW_PASS)
        reason = f"positions {_METHODS[_LOW_PASS]}: no other method predicts left-out torques clearly better ({others})"
        return recipe, (Choice("signals", _LOW_PASS, listed, reason),)
    reason = (
        f"positions {_METHODS[best]}, which predicts left-out torques to {_percent(tried[best])}; after the low-pass "
        f"they are predicted to {_percent(tried[_LOW_PASS])}"
    )
    return replace(recipes[best], cutoff=recipe.cutoff, signals_chosen=True), (Choice("signals", best, listed, reason),)


def _recipes(recipe: Recipe, *, whole: bool, velocities: bool) -> dict[str, Recipe]:
    names = [_LOW_PASS, "savitzky-golay", *(["spline"] if recipe.cutoff is not None else [])]
    recipes = {name: replace(recipe, signals=name) for name in names}
    if velocities:
        recipes["measured velocity"] = replace(recipe, measured_velocity=True)
    if whole:
        recipes["fourier"] = replace(recipe, signals="fourier", cutoff=None)
    return recipes


def _errors(scoring: Scoring, recipe: Recipe) -> LeftOut | None:
    """Left-out errors, or None where a method does not apply, such as a Fourier series to what does not repeat."""
    try:
        return scoring.of(scoring.statistics(recipe))
    except InputError:
        return None


def _percent(score: LeftOut) -> str:
    return f"{100 * score.error:.3g} %"
