"""Units of work that do not know of each other, and what runs them: this process, or several of this machine."""

from __future__ import annotations

import logging
import os
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection, wait
from typing import Any, Protocol, TypeAlias

import cloudpickle

from excite.design.workers import Worker, environment_of_workers
from excite.errors import LostWorkersError

Work: TypeAlias = Callable[[Any, Any], Any]


@dataclass(frozen=True)
class LostUnit:
    """A unit whose worker ended each time that it ran."""

    reason: str  # how, in words


class UnitExecutor(Protocol):
    """Runs units of work.

    Attributes
    ----------
    shares_disk : bool
        Whether the units see the folders of this process.
    """

    shares_disk: bool

    def run(self, work: Work, common: Any, units: Sequence[Any]) -> Generator[tuple[int, Any], None, None]:
        """Call ``work(common, unit)`` for every unit, until the generator is closed.

        Parameters
        ----------
        work : callable
            A function of a module, so that another process finds it by its name.
        common : object
            What is the same for all units; it can be pickled.
        units : sequence
            Each can be pickled.

        Yields
        ------
        index : int
            Of the unit.
        result : object
            What the call returned, or a `LostUnit`; in the order in which the units end.

        Raises
        ------
        LostWorkersError
            No worker is left to run the other units.
        """
        ...


class InThisProcess:
    """Runs units one after the other in this process."""

    shares_disk = True

    def run(self, work: Work, common: Any, units: Sequence[Any]) -> Generator[tuple[int, Any], None, None]:
        """See `UnitExecutor.run`."""
        for index, unit in enumerate(units):
            yield index, work(common, unit)


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
