"""Choice of how Coulomb friction changes its direction, together with the delay of the torques."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from excite.identification.adjustment import undirected_equations
from excite.identification.choices.choice import Candidate, Choice
from excite.identification.choices.cutoffs import choose_delay
from excite.identification.choices.left_out import LeftOut
from excite.identification.choices.scoring import Scoring
from excite.identification.friction_directions import listed
from excite.identification.preparation import PreparedLog
from excite.identification.presliding import Presliding, presliding_candidates
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget

_WORTH = 0.005  # of the score: below that the exact sign stays
_HOLDING = 0.05  # of the score: what a direction at standstill is worth, where the logs do not show it
_FACTORS = (0.25, 0.5, 2**-0.5, 1.0, 2**0.5, 2.0, 4.0)


@dataclass(frozen=True, eq=False)
class Timing:
    """When friction and torques act."""

    recipe: Recipe  # with presliding and delay
    errors: LeftOut
    choices: tuple[Choice, ...]


def choose_timing(scoring: Scoring, recipe: Recipe, parts: Sequence[PreparedLog], free: frozenset[str]) -> Timing:
    """Choose the presliding of friction and the delay of the torques.

    A friction that changes its direction late looks like a delay; so each kind of presliding is tried with its own best
    delay. Presliding over a distance is preferred where it predicts as well as the best, within a standard error or 5 %
    of the errors: only it has a direction at standstill, which exciting motions hardly show, but others do.
    """
    step = min(1 / part.log.rate for part in parts)
    timings = [_timing(scoring, tried, parts, free, step) for tried in _slidings(scoring, recipe, parts)]
    exact = timings[0]
    best = min(timings, key=lambda timing: timing.errors.score)
    if best.errors.score > exact.errors.score - _WORTH:
        best = exact
    elif timings[-1].recipe.breakaway:
        gain, deviation = best.errors.gain_over(timings[-1].errors)
        best = timings[-1] if gain <= max(deviation, _HOLDING) else best
    if len(timings) == 1:
        return best
    listed = tuple(Candidate(_name(t.recipe), t.errors.error, t.errors.score) for t in timings)
    choice = Choice("presliding", _name(best.recipe), listed, f"{_name(best.recipe)}, as left-out torques show")
    return replace(best, choices=(*best.choices, choice))


def with_sliding(recipe: Recipe, sliding: Presliding) -> Recipe:
    """A recipe with some presliding."""
    return replace(recipe, sign_width=sliding.sign_width, breakaway=sliding.breakaway)


def softened(target: IdentificationTarget, recipe: Recipe) -> IdentificationTarget:
    """A target whose friction changes its sign over the recipe's velocity, where trials cannot write it themselves."""
    if not recipe.common_width or target.model.coulomb_friction() is not None:
        return target
    return replace(target, model=target.model.softened(recipe.common_width))


def _slidings(scoring: Scoring, recipe: Recipe, parts: Sequence[PreparedLog]) -> list[Recipe]:
    if recipe.sign_width is not None or recipe.breakaway is not None:
        return [replace(recipe, sign_width=recipe.sign_width or 0.0, breakaway=recipe.breakaway or 0.0)]
    equations = undirected_equations(recipe, scoring.target, parts)
    found = presliding_candidates(scoring.target, equations, friction=scoring.trial.friction)
    return [with_sliding(recipe, candidate.presliding) for candidate in found]


def _timing(
    scoring: Scoring, recipe: Recipe, parts: Sequence[PreparedLog], free: frozenset[str], step: float
) -> Timing:
    """Best delay of a kind of presliding, and then its best size at that delay."""
    targets: dict[Recipe, IdentificationTarget] = {}

    def scored(recipe: Recipe, delay: float) -> LeftOut:
        if recipe not in targets:
            targets[recipe] = softened(scoring.target, recipe)
        return scoring.of(scoring.trial.statistics(targets[recipe], parts, recipe, delay))

    if "delay" not in free:
        return Timing(recipe, scored(recipe, 0.0), ())
    delay, choice = choose_delay(lambda tried: scored(recipe, tried), step)
    resized = _resized(recipe, lambda tried: scored(tried, delay)) if delay else recipe
    if resized != recipe:
        recipe = resized
        delay, choice = choose_delay(lambda tried: scored(recipe, tried), step)
    return Timing(replace(recipe, delay=delay), scored(recipe, delay), (choice,))


def _resized(recipe: Recipe, scored: Callable[[Recipe], LeftOut]) -> Recipe:
    """The presliding with a velocity or a distance that predicts best, up to four times or a quarter of the given."""
    kind = "breakaway" if recipe.breakaway else "sign_width"
    given = getattr(recipe, kind)
    if not given or isinstance(given, tuple):
        return recipe
    tried = [replace(recipe, **{kind: given * factor}) for factor in _FACTORS]
    return min(tried, key=lambda one: scored(one).score)


def _name(recipe: Recipe) -> str:
    if np.any(recipe.breakaway or 0.0):
        over = listed(recipe.breakaway)
        return f"Coulomb friction changes its direction over {over} rad (or m), and holds at standstill"
    if np.any(recipe.sign_width or 0.0):
        return f"Coulomb friction changes its sign over {listed(recipe.sign_width)} rad/s (or m/s)"
    return "Coulomb friction has the sign of the velocity"
