"""The rounds of a search as executors ask for them: without the starts that an earlier run has finished."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence

from excite.design.kept_starts import KeptStarts
from excite.design.planned_start import PlannedStart, number_of
from excite.design.search_rounds import Rounds
from excite.design.start_results import StartResult, read_start, start_file


class RunningRounds:
    """Starts that are left, round by round."""

    def __init__(
        self,
        rounds: Rounds,
        kept: KeptStarts,
        progress: Callable[[StartResult], None] | None = None,
        *,
        in_processes: bool = False,
    ) -> None:
        self.rounds, self._kept, self._progress = rounds, kept, progress
        self._beside = in_processes
        self._results: list[StartResult] = []
        self._began = time.process_time()  # what a longer session has computed before is not of this search
        self.in_processes = 0.0

    @property
    def spent(self) -> float:
        """Processor time of the search in all its processes, and of starts that an earlier run finished [s]."""
        return time.process_time() - self._began + self.in_processes + self._kept.cpu

    def report(self, result: StartResult) -> None:
        """Take the result of a start."""
        if self._beside:
            self.in_processes += result.cpu
        self._take(result)
        if self._progress is not None:
            self._progress(result)

    def __iter__(self) -> Iterator[Sequence[PlannedStart | int]]:
        while starts := self.rounds.following(self._results, self.spent):
            self._results = []
            left = self._kept.left(starts)
            if self.rounds.search.adaptive and len(left) < len(starts):
                for start in starts:
                    if self._kept.has(start):
                        self._take(read_start(start_file(self._kept.folder, number_of(start)))[0])
            for start in left:
                if number_of(start) in self._kept.done:  # of another lineage
                    start_file(self._kept.folder, number_of(start)).unlink(missing_ok=True)
            if left:
                yield left

    def _take(self, result: StartResult) -> None:
        if self.rounds.search.adaptive:
            self._results.append(result)
