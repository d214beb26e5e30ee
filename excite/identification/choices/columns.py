"""Stepwise choice of optional columns: friction terms of each drive, and rotor inertias."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from excite.identification.choices.block_statistics import BlockStatistics
from excite.identification.choices.choice import Candidate
from excite.identification.choices.left_out import Estimate, LeftOut, left_out

_CONVINCING = 2.0  # standard errors over the blocks
_WORTH = 0.01  # gain of one equation's score

Group = tuple[str, int]


def choose_columns(
    statistics: BlockStatistics,
    always: Sequence[int],
    optional: Mapping[Group, Sequence[int]],
    estimate: Callable[[Sequence[int]], Estimate] | None = None,
) -> tuple[list[Group], list[LeftOut], list[Candidate]]:
    """Add the group of columns that lowers the left-out errors most, as long as the gain is clear.

    A gain is clear where it exceeds two standard errors over the blocks, and one equation's error by a hundredth.

    Parameters
    ----------
    statistics : BlockStatistics
        With all columns.
    always : sequence of int
        Columns that are kept.
    optional : mapping of (str, int) to sequence of int
        Columns that are added together, by kind and drive.
    estimate : callable, optional
        Estimate of some columns; weighted least squares if not given.

    Returns
    -------
    groups : list of (str, int)
        In the order in which they were added.
    steps : list of LeftOut
        Errors without any of them, and after each.
    candidates : list of Candidate
        Every group with its errors when it was added, or last tried.
    """
    columns = list(always)
    chosen: list[Group] = []
    steps = [_errors(statistics, columns, estimate)]
    least = _WORTH / statistics.products.shape[1]
    scores: dict[Group, LeftOut] = {}
    while remaining := [group for group in optional if group not in chosen]:
        gains = {}
        for group in remaining:
            scores[group] = _errors(statistics, [*columns, *optional[group]], estimate, steps[-1])
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


def _errors(
    statistics: BlockStatistics,
    columns: Sequence[int],
    estimate: Callable[[Sequence[int]], Estimate] | None,
    before: LeftOut | None = None,
) -> LeftOut:
    weights = None if before is None else before.weights
    return left_out(statistics.of_columns(columns), None if estimate is None else estimate(columns), weights)
