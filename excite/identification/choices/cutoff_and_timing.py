"""Choice of the cutoff together with when friction and torques act."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from excite.identification.choices.choice import Choice
from excite.identification.choices.cutoffs import choose_cutoff
from excite.identification.choices.left_out import LeftOut
from excite.identification.choices.scoring import Scoring
from excite.identification.choices.sliding import choose_timing, softened
from excite.identification.recipe import Recipe

_ROUNDS = 3


def choose_cutoff_and_timing(
    scoring: Scoring, recipe: Recipe, cutoffs: Sequence[float], free: frozenset[str]
) -> tuple[Recipe, tuple[Choice, ...]]:
    """Choose the cutoff, the presliding of friction and the delay of the torques.

    The errors of a delay that is not known hide what a cutoff does. So where a delay is found, the cutoff is chosen
    again with it, and the delay again with that cutoff, until the cutoff stays.
    """
    known = recipe
    of_timing: tuple[Choice, ...] = ()
    for _ in range(_ROUNDS):
        plain, of_cutoff = _with_cutoff(scoring, recipe, known, cutoffs)
        if of_timing and plain.cutoff == known.cutoff:
            break
        timing = choose_timing(scoring, plain, scoring.trial.prepared(scoring.target, plain), free)
        known, of_timing = timing.recipe, timing.choices
        if not cutoffs or known.delay == recipe.delay:
            break
    return known, (*of_cutoff, *of_timing)


def _with_cutoff(
    scoring: Scoring, recipe: Recipe, known: Recipe, cutoffs: Sequence[float]
) -> tuple[Recipe, tuple[Choice, ...]]:
    """A recipe with the cutoff that is best under what is known of the timing."""
    if not cutoffs:
        return recipe, ()
    timed = replace(scoring, target=softened(scoring.target, known))

    def scored(tried: Recipe) -> LeftOut:
        return timed.of(timed.statistics(tried))

    chosen, choice = choose_cutoff(cutoffs, known, scored)
    return replace(recipe, cutoff=chosen.cutoff), (choice,)
