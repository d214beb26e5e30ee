"""Choice of the speed below which rows of drives that friction may hold are left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from excite.identification.choices.block_statistics import BlockStatistics
from excite.identification.choices.choice import Candidate, Choice
from excite.identification.choices.left_out import LeftOut, left_out
from excite.identification.choices.scoring import Scoring
from excite.identification.choices.trial import Mask
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.identification.standstill_bias import SPEEDS, least_speeds, standstill_candidates
from regressors.samples import Array

_WORTH = 0.01  # of the score: below that every row stays


def choose_standstill(
    scoring: Scoring, recipe: Recipe, parts: Sequence[PreparedLog], least: float = 0.0, *, needed: bool = True
) -> tuple[Recipe, tuple[Choice, ...]]:
    """Choose the speed below which rows are left out, by the rows that every candidate keeps.

    The smallest speed is taken that is as good as the best within a standard error, and clearly better than none.
    """
    candidates = standstill_candidates(scoring.target, parts)
    if len(candidates) < 2:
        return recipe, ()
    speeds = [least_speeds(part, scoring.target) for part in parts]
    statistics = {
        v: scoring.trial.statistics(scoring.target, parts, recipe, kept=_faster(speeds, v)) for v in candidates
    }
    judged = statistics[candidates[-1]]
    scores = {v: _left_out(scoring, one, judged) for v, one in statistics.items()}
    listed = tuple(Candidate(v, s.error, s.score) for v, s in scores.items())
    if not needed:
        reason = "rows of slow drives are kept: left-out torques are predicted as well there as in the others"
        return recipe, (Choice("standstill", 0.0, listed, reason, "rad/s or m/s"),)
    allowed = [v for share, v in zip(SPEEDS, candidates, strict=True) if share >= least]
    best = min(allowed, key=lambda v: scores[v].score)
    chosen = next(v for v in allowed if _as_good(scores[best], scores[v]))
    if chosen == 0.0:
        return recipe, (Choice("standstill", 0.0, listed, "rows of slow drives are kept", "rad/s or m/s"),)
    value = float(f"{chosen:.3g}")
    reason = (
        f"rows are left out while a drive is slower than {value:g} rad/s (or m/s), where friction may hold it: the "
        f"others are then predicted to {100 * scores[chosen].error:.3g} % instead of {100 * scores[0.0].error:.3g} %"
    )
    return replace(recipe, standstill=value), (Choice("standstill", value, listed, reason, "rad/s or m/s"),)


def _faster(speeds: Sequence[Array], least: float) -> list[Mask]:
    return [speed >= least for speed in speeds]


def _left_out(scoring: Scoring, statistics: BlockStatistics, judged: BlockStatistics) -> LeftOut:
    plain = left_out(statistics, judged=judged)
    if scoring.estimate is None:
        return plain
    return left_out(statistics, scoring.estimate, plain.weights, judged=judged)


def _as_good(best: LeftOut, other: LeftOut) -> bool:
    gain, deviation = best.gain_over(other)
    return gain <= max(deviation, _WORTH)
