"""Units of work that do not know of each other, and what runs them: this process, or several of this machine."""

from __future__ import annotations

import logging
import os
from collections import Counter
from collections.abc import Callable, Generator, Sequence
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
    """Runs units of work."""

    shares_disk: bool  # whether the units see the folders of this process

    def run(self, work: Work, common: Any, units: Sequence[Any]) -> Generator[tuple[int, Any], None, None]:
        """Call ``work(common, unit)`` for every unit, until the generator is closed.

        The work is a function of a module, so that another process finds it by its name; what is common to all units,
        and each of them, can be pickled. Yields the number of each unit as it ends, and what the call returned or a
        `LostUnit`; raises `LostWorkersError` where no worker is left to run the others.
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
        content, function = cloudpickle.dumps((partial, work, common)), partial(work, common)
        running: dict[Connection, tuple[Worker, int]] = {}
        lost: Counter[int] = Counter()
        left, count, in_a_row = iter(range(len(units))), min(self.count, len(units)), 0

        def start(worker: Worker, index: int | None) -> None:
            if index is None:
                worker.end()
                return
            running[worker.connection] = worker, index
            worker.submit(units[index])

        with environment_of_workers():
            try:
                for _ in range(count):
                    start(Worker(content, lambda: function), next(left, None))
                while running:
                    for connection in wait(list(running)):
                        worker, index = running.pop(connection)  # type: ignore[call-overload]
                        try:
                            result, in_a_row = worker.result(), 0
                        except EOFError:
                            lost[index] += 1
                            in_a_row += 1
                            how = _replaced(worker, in_a_row, _MOST * (count + 1))
                            worker = Worker(content, lambda: function)
                            if lost[index] < _MOST:
                                start(worker, index)
                                continue
                            result = LostUnit(f"its process ended {_MOST} times, at last with {how}")
                        start(worker, next(left, None))
                        yield index, result
            finally:
                for worker, _ in running.values():
                    worker.end()


def _replaced(worker: Worker, in_a_row: int, most: int) -> str:
    """Say how a worker ended; raise `LostWorkersError` where too many have ended one after the other."""
    how = worker.how_it_ended()
    if in_a_row > most:
        raise LostWorkersError(
            f"{in_a_row} worker processes ended one after the other ({how})",
            "what is finished is kept, and another try continues with the rest: give fewer `workers`",
        )
    _log.warning("a worker process ended (%s) and is replaced", how)
    return how
