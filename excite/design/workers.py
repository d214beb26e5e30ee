"""Worker processes that optimise starts; one that ends unexpectedly is announced and replaced."""

from __future__ import annotations

import logging
import os
import signal
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.context import SpawnContext
from multiprocessing.process import BaseProcess
from multiprocessing.resource_tracker import ensure_running
from pathlib import Path
from typing import Any

from excite.design.interruption import SIGNALS, held_signals
from excite.design.planned_start import PlannedStart
from excite.design.start_results import StartResult
from excite.design.worker_process import prepare, work
from excite.errors import LostWorkersError

_THREAD_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
_NO_LEAKS = "ignore::UserWarning:multiprocessing.resource_tracker"  # of a process that is killed: it cannot clean up
_TOGETHER = 2  # times that a start may end its worker beside others; after that it runs alone, once
Start = PlannedStart | int
_log = logging.getLogger(__name__)


class _OneContext(SpawnContext):
    """Starts processes as usual, and remembers the last one."""

    started: BaseProcess | None = None

    def Process(self, *arguments: Any, **named: Any) -> BaseProcess:  # type: ignore[override]  # noqa: N802
        self.started = super().Process(*arguments, **named)
        return self.started


class Worker:
    """A pool of a single process: where it breaks, it is known which start it ran.

    Parameters
    ----------
    content : bytes
        See `excite.design.worker_process.prepare`.
    """

    def __init__(self, content: bytes) -> None:
        self._context = _OneContext()
        self._pool = ProcessPoolExecutor(1, mp_context=self._context, initializer=prepare, initargs=(content,))

    def submit(self, seed: int, start: PlannedStart | int, folder: Path) -> Future[StartResult]:
        """Run a start; the first one starts the process."""
        with held_signals(), _main_not_imported():
            return self._pool.submit(work, seed, start, folder)

    def how_it_ended(self) -> str:
        """How a process that ended unexpectedly did so."""
        self._pool.shutdown(wait=True)
        code = self._context.started.exitcode if self._context.started is not None else None
        if code is None or code >= 0:
            return f"exit code {code}"
        often = ", which is often a lack of memory" if -code == getattr(signal, "SIGKILL", 9) else ""
        return f"signal {-code}{often}"

    def end(self) -> None:
        """End the process at once, whatever it does."""
        if self._context.started is not None and self._context.started.is_alive():
            process = self._context.started
            (process.kill if hasattr(signal, "SIGKILL") else process.terminate)()  # the same on Windows
        self._pool.shutdown(wait=True, cancel_futures=True)


class Workers:
    """Worker processes at work on the starts of one problem.

    Parameters
    ----------
    content : bytes
    seed : int
    folder : Path
    count : int
        Number of processes.
    """

    def __init__(self, content: bytes, seed: int, folder: Path, count: int) -> None:
        self._content, self._seed, self._folder, self._count = content, seed, folder, count
        self._running: dict[Future[StartResult], tuple[Worker, Start]] = {}
        self._idle: list[Worker] = []
        self._all: set[Worker] = set()
        self._lost: Counter[Start] = Counter()
        self._in_a_row = 0

    def run(self, starts: Iterable[Start]) -> Iterator[StartResult]:
        """Results as the starts end; at most one start per process is on its way at a time. Processes live on after it.

        Starts that end their process twice run alone after all others, and are left out if they end it again.

        Raises
        ------
        LostWorkersError
            Processes end again and again, and no start does.
        NotPreparedError
            They cannot build the problem.
        """
        alone: list[Start] = []
        yield from self._run(iter(starts), self._count, alone)
        if alone:
            self.end()
        for start in alone:
            yield from self._run(iter([start]), 1, [])

    def end(self) -> None:
        """End all processes."""
        for worker in list(self._all):
            worker.end()
        self._all.clear()
        self._running.clear()
        self._idle.clear()

    def _run(self, left: Iterator[Start], count: int, alone: list[Start]) -> Iterator[StartResult]:
        for _ in range(count):
            self._start_next(None, left)
        while self._running:
            for future in wait(self._running, return_when=FIRST_COMPLETED).done:
                worker, start = self._running.pop(future)
                try:
                    result = future.result()
                except BrokenProcessPool:
                    worker = self._replaced(worker, start, alone)
                    again = self._lost[start] < _TOGETHER
                    self._start_next(worker, iter([start]) if again else left)
                    continue
                self._in_a_row = 0
                self._start_next(worker, left)
                yield result

    def _new(self) -> Worker:
        worker = Worker(self._content)
        self._all.add(worker)
        return worker

    def _start_next(self, worker: Worker | None, left: Iterator[Start]) -> None:
        """Give a process its next start; without one, an idle or a new process. With no start left it is idle."""
        start = next(left, None)
        if start is not None:
            worker = worker or (self._idle.pop() if self._idle else self._new())
            self._running[worker.submit(self._seed, start, self._folder)] = worker, start
        elif worker is not None:
            self._idle.append(worker)

    def _replaced(self, worker: Worker, start: Start, alone: list[Start]) -> Worker:
        """A new process in place of one that ended."""
        how = worker.how_it_ended()
        self._all.discard(worker)
        self._lost[start] += 1
        self._in_a_row += 1
        if self._in_a_row > 3 * self._count + 3:
            raise LostWorkersError(
                f"{self._in_a_row} worker processes ended one after the other ({how}), and no start did; finished "
                "starts are kept, and another try continues with the others: give fewer `workers`"
            )
        if self._lost[start] < _TOGETHER:
            then = "the start runs again"
        elif self._lost[start] == _TOGETHER:
            then = "the start runs alone after the others, since this is the second time"
            alone.append(start)
        else:
            then = "the start is left out, since this is the third time"
        number = start.index if isinstance(start, PlannedStart) else start
        _log.warning("a worker process ended at start %d (%s) and is replaced; %s", number, how, then)
        return self._new()


@contextmanager
def environment_of_workers() -> Iterator[None]:
    """Let processes started in the block use one thread for linear algebra, since the pool uses all cores."""
    before = {name: os.environ.get(name) for name in (*_THREAD_VARIABLES, "PYTHONWARNINGS")}
    with held_signals(SIGNALS[2:]):  # SIGINT and SIGTERM it lets through again once it has started its process
        os.environ["PYTHONWARNINGS"] = ",".join(filter(None, (before["PYTHONWARNINGS"], _NO_LEAKS)))
        try:
            ensure_running()
        finally:
            _restore({"PYTHONWARNINGS": before.pop("PYTHONWARNINGS")})
    os.environ.update(dict.fromkeys(_THREAD_VARIABLES, "1"))
    try:
        yield
    finally:
        _restore(before)


def _restore(before: dict[str, str | None]) -> None:
    for name, value in before.items():
        if value is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = value


@contextmanager
def _main_not_imported() -> Iterator[None]:
    """Keep processes started in the block from running the user's script again, so it needs no ``__main__`` guard.

    Objects that the script defines are pickled by value.
    """
    main = sys.modules["__main__"]
    hidden = {name: getattr(main, name) for name in ("__spec__", "__file__") if hasattr(main, name)}
    for name in hidden:
        setattr(main, name, None)
    try:
        yield
    finally:
        for name, value in hidden.items():
            setattr(main, name, value)
