"""Rounds of a search: which starts run next, from the results of earlier ones.

The first round is random. Later ones combine the best motions so far, until a few rounds in a row bring next to
nothing; then another population begins with random motions. The search ends where three populations have come to the
same best end, and after a number of rounds at the latest; it estimates what one more population would bring: had each
one been left out, how much worse would the best be, on average? The clock, the number of workers and the order in which
starts end have no say, so that the same seed gives the same motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from excite.design.planned_start import Kind, PlannedStart
from excite.design.population import Population
from excite.design.start_results import StartResult
from excite.tasks.search import RANDOM_STARTS, Search


@dataclass(frozen=True)
class RoundSizes:
    """Sizes, chosen by trials on an IRp-6, a Panda and a UR10; ``benchmarks/search.py`` measures what they reach."""

    combined: int = 4  # starts of a later round; also the number of processes that can share it
    parents: int = 3  # motions that are combined
    # rounds in a row without gain after which the population ends; it ends at once where an earlier one has
    patience: int = 3
    gain: float = 1e-3  # relative decrease of the criterion that counts as a gain, and difference that counts as none
    repetitions: int = 3  # populations that come to the same end, the best of all, before the search ends
    rounds: int = 32  # largest number of rounds after the first, where neither rounds nor a budget are stated


SIZES = RoundSizes()


@dataclass(frozen=True)
class SearchSummary:
    """What became of a search.

    Parameters
    ----------
    rounds : int
        Rounds after the first.
    populations : int
        Populations that ended since they brought next to nothing any more.
    left : float, optional
        Estimated relative gain of one more population; None with fewer than two.
    """

    rounds: int
    populations: int
    left: float | None


class Rounds:
    """Plan of the rounds of one search."""

    def __init__(self, search: Search, sizes: RoundSizes = SIZES) -> None:
        self.sizes, self.search = sizes, search
        self.planned = self.count = 0
        self.population = Population()
        self.ends: list[float] = []
        self._stall = 0
        self._best: StartResult | None = None
        self._over = False

    @property
    def largest(self) -> int:
        """Number of starts in the largest round."""
        return max(self.search.first, self.sizes.combined if self.search.adaptive else 0)

    def following(self, results: Sequence[StartResult], spent: float = 0.0) -> Sequence[PlannedStart | int]:
        """Starts of the next round, given the results of the last one; none at the end."""
        if self.planned == 0:
            return self._random(self.search.first)
        if self._over or not self.search.adaptive:
            return ()
        self._take(results)
        if self._best is None:
            return ()
        if self._ends_here(spent):
            self._over = True
            return self._descending("refinement", 1, (self._best,))
        self.count += 1
        if not self.population.members:
            return self._random(RANDOM_STARTS)
        return self._descending("combination", self.sizes.combined, self.population.members[: self.sizes.parents])

    @property
    def left(self) -> float:
        """Estimated relative gain of one more population: the mean over those that ended of what each has brought."""
        if len(self.ends) < 2:
            return np.inf
        ends = np.sort(self.ends)
        return float((ends[1] - ends[0]) / ends[0] / ends.size)

    @property
    def summary(self) -> SearchSummary:
        """What became of the search."""
        return SearchSummary(self.count, len(self.ends), self.left if np.isfinite(self.left) else None)

    def _take(self, results: Sequence[StartResult]) -> None:
        before = self.population.best
        self.population.add(results)
        for result in sorted(results, key=lambda result: result.index):
            if np.isfinite(result.value) and (self._best is None or result.value < self._best.value):
                self._best = result
        gained = self.population.best < before * (1.0 - self.sizes.gain)
        self._stall = 0 if gained else self._stall + 1
        best = self.population.best
        repeated = any(abs(best - end) <= self.sizes.gain * end for end in self.ends)
        if repeated or self._stall >= self.sizes.patience:
            self.ends.append(self.population.best)
            self.population, self._stall = Population(), 0

    def _random(self, count: int) -> range:
        self.planned += count
        return range(self.planned - count, self.planned)

    def _descending(self, kind: Kind, count: int, parents: tuple[StartResult, ...]) -> tuple[PlannedStart, ...]:
        return tuple(PlannedStart(index, kind, parents) for index in self._random(count))

    def _ends_here(self, spent: float) -> bool:
        if self.search.rounds is not None:
            return self.count >= self.search.rounds
        if self.search.budget is not None:
            return spent >= self.search.budget
        return self._found_again() or self.count >= self.sizes.rounds

    def _found_again(self) -> bool:
        """Whether as many populations as are wanted have come to the same end, the best of all."""
        ends = np.sort(self.ends)[: self.sizes.repetitions]
        return ends.size == self.sizes.repetitions and ends[-1] <= (1.0 + self.sizes.gain) * ends[0]
