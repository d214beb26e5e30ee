"""Stepwise choice of optional columns: friction terms of each drive, and rotor inertias."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from excite.identification.choices.block_statistics import BlockStatistics
from excite.identification.choices.choice import Candidate
from excite.identification.choices.left_out import Estimate, LeftOut, left_out

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
