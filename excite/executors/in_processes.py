"""Units of work in processes of this machine; one that ends unexpectedly is announced and replaced."""

from __future__ import annotations

import logging
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from excite.design.interruption import held_signals
from excite.design.worker_process import belong_to_parent
from excite.design.workers import Worker, _main_not_imported, _OneContext, environment_of_workers
from excite.errors import LostWorkersError
from excite.executors.unit_executor import LostUnit, Work

_MOST = 3  # times that a unit may end its process
_log = logging.getLogger(__name__)


class _UnitWorker(Worker):
    """A pool of a single process, for units of any kind."""

    def __init__(self) -> None:
        self._context = _OneContext()
        self._pool = ProcessPoolExecutor(1, mp_context=self._context, initializer=belong_to_parent)

    def submit_unit(self, work: Work, common: Any, unit: Any) -> Future[Any]:
        """Run a unit; the first one starts the process."""
        with held_signals(), _main_not_imported():
            return self._pool.submit(work, common, unit)


class InProcesses:
    """Runs units in processes of this machine.

    Parameters
    ----------
    count : int, optional
        Number of processes; one per core if not given.
    """

    shares_disk = True

    def __init__(self, count: int | None = None) -> None:
        self.count = count or os.cpu_count() or 1

    def run(self, work: Work, common: Any, units: Sequence[Any]) -> Iterator[tuple[int, Any]]:
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
        self._work, self._common, self._units = work, common, units
        self._running: dict[Future[Any], tuple[_UnitWorker, int]] = {}
        self._all: set[_UnitWorker] = set()
        self._lost: Counter[int] = Counter()
        self._in_a_row = 0

    def run(self, count: int) -> Iterator[tuple[int, Any]]:
        left = iter(range(len(self._units)))
        for _ in range(count):
            self._start(self._new(), next(left, None))
        while self._running:
            for future in wait(self._running, return_when=FIRST_COMPLETED).done:
                worker, index = self._running.pop(future)
                try:
                    result = future.result()
                    self._in_a_row = 0
                except BrokenProcessPool:
                    how, worker = self._replaced(worker, index, count)
                    if self._lost[index] < _MOST:
                        self._start(worker, index)
                        continue
                    result = LostUnit(f"its process ended {_MOST} times, at last with {how}")
                self._start(worker, next(left, None))
                yield index, result

    def end(self) -> None:
        """End all processes at once."""
        for worker in self._all:
            worker.end()

    def _new(self) -> _UnitWorker:
        worker = _UnitWorker()
        self._all.add(worker)
        return worker

    def _start(self, worker: _UnitWorker, index: int | None) -> None:
        if index is not None:
            self._running[worker.submit_unit(self._work, self._common, self._units[index])] = worker, index

    def _replaced(self, worker: _UnitWorker, index: int, count: int) -> tuple[str, _UnitWorker]:
        how = worker.how_it_ended()
        self._all.discard(worker)
        self._lost[index] += 1
        self._in_a_row += 1
        if self._in_a_row > _MOST * (count + 1):
            raise LostWorkersError(
                f"{self._in_a_row} worker processes ended one after the other ({how}); what is finished is kept, and "
                "another try continues with the rest: give fewer `workers`"
            )
        _log.warning("a worker process ended (%s) and is replaced", how)
        return how, self._new()
