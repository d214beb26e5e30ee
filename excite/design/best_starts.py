"""The best of all starts on disk, read one after the other, so that a million of them fit into memory."""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from pathlib import Path

from excite.design.start_results import RUNNING, StartResult, iterate_starts

MOST_KEPT = 1000  # starts that a design keeps


@dataclass(frozen=True)
class BestStarts:
    """The best starts of a search, and how many there are."""

    best: tuple[StartResult, ...]  # by number; all of them, where there are not too many
    ended: int  # numbers of starts that ended, of those stopped before, and of those without a result
    unfinished: int
    missing: int = 0

    @classmethod
    def of(cls, results: tuple[StartResult, ...]) -> BestStarts:
        """Of starts in memory."""
        unfinished = sum(result.status == RUNNING for result in results)
        return cls(results, len(results) - unfinished, unfinished)

    @property
    def further(self) -> int:
        """Number of starts beside the best."""
        return self.ended + self.unfinished - len(self.best)

    def note(self, *, interrupted: bool) -> str:
        """A sentence on starts that did not end; empty where all did."""
        if interrupted:
            return f"interrupted: best of {self.ended} finished and {self.unfinished} unfinished starts"
        if self.missing:
            return f"{self.missing} of {self.ended + self.missing} starts are left out: their processes ended each time"
        return ""


def best_starts(folder: Path, count: int, most: int = MOST_KEPT) -> BestStarts:
    """Read the starts below a number, and keep the best."""
    kept: list[tuple[float, int, StartResult]] = []  # the worst of them first
    ended = unfinished = 0
    for start in iterate_starts(folder):
        if start.index >= count:
            continue
        ended, unfinished = ended + (start.status != RUNNING), unfinished + (start.status == RUNNING)
        entry = (-start.value, -start.index, start)
        if len(kept) < most:
            heapq.heappush(kept, entry)
        else:
            heapq.heappushpop(kept, entry)
    best = tuple(sorted((start for *_, start in kept), key=lambda start: start.index))
    return BestStarts(best, ended, unfinished, count - ended - unfinished)
