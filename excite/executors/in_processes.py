"""Units of work in processes of this machine; one that ends unexpectedly is announced and replaced."""

from __future__ import annotations

import logging
import os
from collections import Counter
from collections.abc import Generator, Iterator, Sequence
from functools import partial
from multiprocessing.connection import Connection, wait
from typing import Any

import cloudpickle

from excite.design.workers import Worker, environment_of_workers
from excite.errors import LostWorkersError
from excite.executors.unit_executor import LostUnit, Work

SHORT = 10.0  # seconds of work below which worker processes are not worth their start
_MOST = 3  # times that a unit may end its process
_log = logging.getLogger(__name__)


class InProcesses:
    """Runs units in processes of this machine."""

    shares_disk = True

    def __init__(self, count: int | None = None) -> None:
        self.count = count or os.cpu_count() or 1

    def run(self, work: Work, common: Any, units: Sequence[Any]) -> Generator[tuple[int, Any], None, None]:
        """See `UnitExecutor.run`."""
        with environment_of_workers():
            processes = _Processes(work, common, units)
            try:
                yield from processes.run(min(self.count, len(units)))
            finally:
                processes.end()


class _Processes:
    """Processes at work on units; every process has one unit at a time."""

    def __init__(self, work: Work, common: Any, units: Sequence[Any]) -> None:
        self._content, self._work = cloudpickle.dumps((partial, work, common)), partial(work, common)
        self._units = units
        self._running: dict[Connection, tuple[Worker, int]] = {}
        self._lost: Counter[int] = Counter()
        self._in_a_row = 0

    def run(self, count: int) -> Iterator[tuple[int, Any]]:
        left = iter(range(len(self._units)))
        for _ in range(count):
            self._start(self._new(), next(left, None))
        while self._running:
            for connection in wait(list(self._running)):
                worker, index = self._running.pop(connection)  # type: ignore[call-overload]
                try:
                    result = worker.result()
                    self._in_a_row = 0
                except EOFError:
                    how = self._lose(worker, index, count)
                    worker = self._new()
                    if self._lost[index] < _MOST:
                        self._start(worker, index)
                        continue
                    result = LostUnit(f"its process ended {_MOST} times, at last with {how}")
                self._start(worker, next(left, None))
                yield index, result

    def end(self) -> None:
        """End all processes at once."""
        for worker, _ in self._running.values():
            worker.end()

    def _new(self) -> Worker:
        return Worker(self._content, lambda: self._work)

    def _start(self, worker: Worker, index: int | None) -> None:
        if index is None:
            worker.end()
            return
        self._running[worker.connection] = worker, index
        worker.submit(self._units[index])

    def _lose(self, worker: Worker, index: int, count: int) -> str:
        how = worker.how_it_ended()
        self._lost[index] += 1
        self._in_a_row += 1
        if self._in_a_row > _MOST * (count + 1):
            raise LostWorkersError(
                f"{self._in_a_row} worker processes ended one after the other ({how})",
                "what is finished is kept, and another try continues with the rest: give fewer `workers`",
            )
        _log.warning("a worker process ended (%s) and is replaced", how)
        return how
