"""Worker processes that optimise starts; one that ends unexpectedly is announced and replaced."""

from __future__ import annotations

import ctypes
import logging
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from itertools import chain, islice
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from multiprocessing.resource_tracker import ensure_running
from pathlib import Path
from typing import Any

import cloudpickle
from threadpoolctl import threadpool_limits

from excite.design.blueprint import Blueprint
from excite.design.interruption import SIGNALS, deferred_interruption, held_signals
from excite.design.problem import Problem
from excite.design.start_results import Origin, StartResult, Starts, number_of
from excite.design.starts import optimise_starts
from excite.errors import LostWorkersError
from excite.operating_system import THREADS, can_fork
from excite.registry import instance

_TOGETHER = 2  # times that a start may end its worker beside other processes; after that it runs alone, once
_log = logging.getLogger(__name__)


class Worker:
    """One process, which is known to work on one job at a time."""

    def __init__(self, content: bytes, prepared: Callable[[], Work]) -> None:
        self._process, self.connection = _forked(prepared) if can_fork() else _spawned(content)

    def submit(self, job: Any) -> None:
        """Run a job; where the process has ended, that shows when its result is read."""
        with suppress(OSError):
            self.connection.send(job)

    def result(self) -> Any:
        """Result of the job, or the error that it has ended with."""
        try:
            outcome = self.connection.recv()
        except OSError as error:
            raise EOFError from error
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    def how_it_ended(self) -> str:
        """How a process that ended unexpectedly did so."""
        self._process.join()
        code = self._process.exitcode
        self.end()
        if code is None or code >= 0:
            return f"exit code {code}"
        often = ", which is often a lack of memory" if -code == getattr(signal, "SIGKILL", 9) else ""
        return f"signal {-code}{often}"

    def end(self) -> None:
        """End the process at once, whatever it does."""
        (self._process.kill if hasattr(signal, "SIGKILL") else self._process.terminate)()  # the same on Windows
        self._process.join()
        self.connection.close()


def _forked(prepared: Callable[[], Work]) -> tuple[BaseProcess, Connection]:
    """A copy of this process, which has imported and built everything."""
    ready = prepared()
    return _started(multiprocessing.get_context("fork"), lambda: ready)


def _spawned(content: bytes) -> tuple[BaseProcess, Connection]:
    """A process that imports everything anew."""
    if hasattr(os, "fork"):  # multiprocessing's own process, which lets SIGINT and SIGTERM through once it is there
        with held_signals(SIGNALS[2:]):
            ensure_running()
    with main_not_imported():
        return _started(multiprocessing.get_context("spawn"), partial(unpickled, content))


def _started(context: Any, prepare: Callable[[], Work]) -> tuple[BaseProcess, Connection]:
    ours, theirs = context.Pipe()
    process = context.Process(target=serve, args=(theirs, prepare))
    with held_signals():
        process.start()
    theirs.close()
    return process, ours


class Workers:
    """Worker processes for the starts of one problem; they are kept from one run to the next."""

    def __init__(self, content: bytes, prepared: Callable[[], Work], count: int) -> None:
        self._content, self._prepared, self.count = content, prepared, count
        self._idle: list[Worker] = []
        self._running: dict[Connection, tuple[Worker, Job]] = {}
        self._lost: Counter[int] = Counter()
        self._in_a_row = 0

    def start(self) -> None:
        """Start all processes."""
        while len(self._idle) + len(self._running) < self.count:
            self._add()

    def run(self, jobs: Iterable[Job]) -> Iterator[StartResult]:
        """Results as the jobs end; at most one job per process is on its way at a time.

        The starts of a job that ends its process run again one by one. Starts that end their process twice more
        run alone after all others, and are left out if they end it again.
        """
        alone: list[Job] = []
        self._lost.clear()
        yield from self._run(iter(jobs), self.count, alone)
        if alone:
            self.end()
        for job in alone:
            yield from self._run(iter([job]), 1, [])

    def end(self) -> None:
        """End all processes; a further run starts new ones."""
        for worker in (*self._idle, *(worker for worker, _ in self._running.values())):
            worker.end()
        self._idle.clear()
        self._running.clear()

    def _run(self, left: Iterator[Job], count: int, alone: list[Job]) -> Iterator[StartResult]:
        self._submit_next(left, count)
        while self._running:
            for connection in wait(list(self._running)):
                worker, job = self._running[connection]  # type: ignore[index]
                try:
                    results = worker.result()
                except EOFError:
                    left = chain(self._lose(worker, job, alone), left)
                    self._submit_next(left)
                    continue
                del self._running[worker.connection]
                self._idle.append(worker)
                self._in_a_row = 0
                self._submit_next(left)
                yield from results

    def _add(self) -> None:
        """Start a process; a signal waits until it is known here, since nobody would end it otherwise."""
        with deferred_interruption() as answer:
            self._idle.append(Worker(self._content, self._prepared))
        answer()

    def _submit_next(self, left: Iterator[Job], count: int = 1) -> None:
        for job in islice(left, count):
            if not self._idle:
                self._add()
            worker = self._idle.pop()
            self._running[worker.connection] = worker, job
            worker.submit(job)

    def _lose(self, worker: Worker, job: Job, alone: list[Job]) -> list[Job]:
        """Say that a process has ended; return the jobs that are to run again at once, one for each start."""
        seed, starts, folder = job
        del self._running[worker.connection]
        how = worker.how_it_ended()
        self._in_a_row += 1
        if self._in_a_row > 3 * self.count + 3:
            raise LostWorkersError(
                f"{self._in_a_row} worker processes ended one after the other ({how}), and no start did; finished "
                "starts are kept, and another try continues with the others: give fewer `workers`"
            )
        if len(starts) > 1:
            numbers = ", ".join(str(number_of(start)) for start in starts)
            then = "they run again one by one"
            _log.warning("a worker process ended at starts %s (%s) and is replaced; %s", numbers, how, then)
            return [(seed, [start], folder) for start in starts]
        index = number_of(starts[0])
        self._lost[index] += 1
        if self._lost[index] < _TOGETHER:
            then = "the start runs again"
        elif self._lost[index] == _TOGETHER:
            then = "the start runs alone after the others, since this is the second time"
            alone.append(job)
        else:
            then = "the start is left out, since this is the third time"
        _log.warning("a worker process ended at start %d (%s) and is replaced; %s", index, how, then)
        return [job] if self._lost[index] < _TOGETHER else []


@contextmanager
def environment_of_workers() -> Iterator[None]:
    """Let processes started in the block use one thread for linear algebra, since the pool uses all cores."""
    before = {name: os.environ[name] for name in THREADS if name in os.environ}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name in THREADS:
            os.environ.pop(name, None)
        os.environ.update(before)


@contextmanager
def main_not_imported() -> Iterator[None]:
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


Job = tuple[int, Starts, Path | None]  # seed, starts, and the folder that they are written to
Work = Callable[[Any], Any]

_PR_SET_PDEATHSIG = 1  # of Linux's prctl


class NotPreparedError(Exception):
    """A worker process cannot build the problem; what it says is why."""


def unpickled(content: bytes) -> Work:
    """Prepare the work in a process that has inherited nothing."""
    prepare, *arguments = cloudpickle.loads(content)
    work: Work = prepare(*arguments)
    return work


def work_on_starts(blueprint: Blueprint, origin: Origin, problem: Problem | None = None) -> Work:
    """Build the problem of a search, if it is not given; what is returned optimises starts."""
    built = blueprint.problem() if problem is None else problem
    method = instance("solver", blueprint.task.search.solver)

    def work(job: Job) -> list[StartResult]:
        seed, starts, folder = job
        return optimise_starts(built, method, seed, starts, folder, origin=origin)

    return work


def serve(connection: Connection, prepare: Callable[[], Work]) -> None:
    """Do the jobs that are asked for; only the parent answers signals, and this process ends with it."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    _end_with_parent()
    threadpool_limits(1)  # since the pool uses all cores
    failure = None
    try:
        work = prepare()
    except Exception as error:
        failure = NotPreparedError(f"{type(error).__name__}: {error}")
    with suppress(EOFError, OSError):  # the parent has no further jobs
        while True:
            job = connection.recv()
            connection.send(_outcome(work, job) if failure is None else failure)


def _outcome(work: Work, job: Any) -> Any:
    try:
        return work(job)
    except Exception as error:
        error.add_note(f"In a worker process:\n{traceback.format_exc()}")
        return _sent(error)


def _sent(error: Exception) -> Exception:
    """The error itself if the parent can unpickle it."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError("\n".join([f"{type(error).__name__}: {error}", *error.__notes__]))
    return error


def _end_with_parent() -> None:
    """End this process with its parent: a killed parent would leave it waiting for work for ever."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    if _killed_with_parent():
        if os.getppid() != parent.pid:  # it has ended before
            os._exit(1)
        return
    threading.Thread(target=_wait_for, args=(parent,), daemon=True).start()


def _killed_with_parent() -> bool:
    """Have the kernel end this process, whatever it computes; Linux alone can."""
    if sys.platform != "linux":
        return False
    try:
        return bool(ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL) == 0)
    except (OSError, AttributeError):
        return False


def _wait_for(parent: BaseProcess) -> None:
    parent.join()
    os._exit(1)
