"""Multistart: every start is optimised independently on a process pool and written to disk as soon as it ends."""

from __future__ import annotations

import multiprocessing
import os
import re
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from multiprocessing.resource_tracker import ensure_running
from pathlib import Path
from types import FrameType
from typing import Any

import cloudpickle
import numpy as np
from threadpoolctl import threadpool_limits

from excite.design.blueprint import Blueprint
from excite.design.formulation import Formulation
from excite.design.initial_guesses import candidates, shrunk
from excite.design.problem import Problem
from excite.design.solvers.solver import Solver, SolverResult
from excite.registry import instance
from excite.storage.atomic import read_json, write_json
from regressors.errors import InputError, NumericalError
from regressors.samples import Array

_THREAD_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
_SAVE_EVERY = 1.0  # seconds between saves of an unfinished start
RUNNING = "running; this is the best point so far"


@dataclass(frozen=True)
class StartResult:
    """Final point of a start, or its best point so far.

    Parameters
    ----------
    index : int
        Number of the start; with the seed it determines the result.
    x : list
        Coefficients, shape (n, size), or the flat x of a family that is not linear in it; inside the limits.
    value : float
        The criterion at the task's rate with exact friction; while running, the solver's smooth value.
    status : str
        How it ended, as a sentence.
    history : list of float
        The criterion at every accepted iterate, with the smooth friction sign of the solver.
    evaluations : int
    cpu : float
        Processor time [s].
    """

    index: int
    x: list[Any]
    value: float
    status: str
    history: list[float]
    evaluations: int
    cpu: float

    @property
    def coefficients(self) -> Array:
        """`x` as an array."""
        return np.array(self.x)


Progress = Callable[[StartResult], None]


def start_file(folder: Path, index: int) -> Path:
    """File of a start."""
    return folder / f"start-{index:04d}.json"


def optimise_start(
    problem: Problem,
    method: Solver,
    seed: int,
    index: int,
    folder: Path | None,
    answer: Callable[[], None] = lambda: None,
) -> StartResult:
    """Draw start ``index`` and optimise it, saving the best point so far every second.

    Parameters
    ----------
    problem : Problem
    method : Solver
    seed, index : int
        Together they seed the random start.
    folder : Path, optional
        Folder for the start's file; no file is written if not given.
    answer : callable
        Called after every iterate; may raise to end the start.
    """
    began = time.process_time()
    watch = _Snapshots(index, folder, answer)
    with threadpool_limits(1), np.errstate(all="ignore"):  # a point that overflows is worse than any, and left behind
        rng = np.random.default_rng([seed, index])
        outcome = _solve(problem, method, candidates(problem, index, rng), watch)
        value = problem.exact_value(outcome.x)
    if not np.all(np.isfinite(outcome.x)):
        raise NumericalError(f"start {index} ended at a motion that is not finite; check `period` and the limits")
    cpu = time.process_time() - began
    result = StartResult(
        index, outcome.x.tolist(), value, outcome.status.value, outcome.history, outcome.evaluations, cpu
    )
    if folder is not None:
        write_start(folder, result)
    return result


class _Snapshots:
    """Watcher of a search that writes its best point so far every second."""

    def __init__(self, index: int, folder: Path | None, answer: Callable[[], None]) -> None:
        self.index, self.folder, self.answer = index, folder, answer
        self.began, self.saved = time.process_time(), time.monotonic()
        self.restart()

    def restart(self) -> None:
        """Forget the points so far: those to come keep more limits."""
        self.best, self.history = np.inf, list[float]()

    def __call__(self, x: Array, value: float) -> None:
        self.history.append(value)
        self.best = min(self.best, value)
        if self.folder is not None and value == self.best and time.monotonic() - self.saved > _SAVE_EVERY:
            self.saved = time.monotonic()
            cpu, history = time.process_time() - self.began, list(self.history)
            write_start(self.folder, StartResult(self.index, x.tolist(), value, RUNNING, history, len(history), cpu))
        self.answer()


def _solve(problem: Problem, method: Solver, guesses: list[Array], watch: _Snapshots) -> SolverResult:
    """Solve without the limits that hold by default, then with those that the motion breaks, until it breaks none.

    Most motions break none or few of them, and each makes an evaluation more expensive.
    """
    outcome = method.solve(problem, guesses, watch)
    while method.takes_nonlinear_limits and (limited := problem.with_broken(outcome.x)) is not problem:
        problem, evaluations = limited, outcome.evaluations
        watch.restart()
        guesses = [shrunk(problem, x) for x in (outcome.x, *guesses)]
        outcome = method.solve(problem, guesses, watch)
        outcome = replace(outcome, evaluations=evaluations + outcome.evaluations)
    return outcome


def write_start(folder: Path, result: StartResult) -> None:
    """Write one start's file; infinite values, of a motion that does not identify every parameter, become null."""
    content = asdict(result)
    content["value"] = _or_none(result.value)
    content["history"] = [_or_none(value) for value in result.history]
    write_json(start_file(folder, result.index), content)


def _or_none(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _or_infinite(value: float | None) -> float:
    return np.inf if value is None else value


def read_starts(folder: Path) -> list[StartResult]:
    """Read all starts on disk, by number."""
    paths = sorted(path for path in folder.iterdir() if re.fullmatch(r"start-\d+\.json", path.name))
    return [_start_result(read_json(path)) for path in paths]


def _start_result(content: dict[str, Any]) -> StartResult:
    history = [_or_infinite(value) for value in content["history"]]
    return StartResult(**{**content, "value": _or_infinite(content["value"]), "history": history})


_worker: tuple[Problem, Solver] | None = None


def _prepare(content: bytes) -> None:
    """Build the problem once per process; only the parent handles Ctrl-C."""
    global _worker
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    blueprint: Blueprint = cloudpickle.loads(content)
    _worker = blueprint.problem(), instance("solver", blueprint.task.search.solver)


def _end_with_parent() -> None:
    """End this process with its parent: a killed parent would leave it waiting for work for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _work(seed: int, index: int, folder: Path) -> StartResult:
    assert _worker is not None
    problem, method = _worker
    return optimise_start(problem, method, seed, index, folder)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Let processes started in the block use one thread for linear algebra, since the pool uses all cores."""
    before = {name: os.environ.get(name) for name in _THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(_THREAD_VARIABLES, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Block Ctrl-C until the block ends; processes started in it inherit that and never handle it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _interrupts_noted() -> Iterator[Callable[[], None]]:
    """Note the first Ctrl-C and raise it when asked: CasADi swallows what is raised inside it."""
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield lambda: None
        return
    noted = False

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal noted
        if noted:
            before(number, frame)
        noted = True

    def answer() -> None:
        if noted:
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, note)
    try:
        yield answer
    finally:
        signal.signal(signal.SIGINT, before)


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


def _pickled(blueprint: Blueprint) -> bytes:
    """The blueprint pickled for other processes, with classes of the user's script by value.

    Raises
    ------
    InputError
        A part of the user's own that cannot be pickled.
    """
    try:
        return bytes(cloudpickle.dumps(blueprint))
    except Exception as error:
        raise InputError(
            f"a part of this task cannot be sent to other processes ({error}); Search(executor='serial') keeps it in "
            "this one"
        ) from error


def serial(formulation: Formulation, indices: list[int], folder: Path, progress: Progress) -> None:
    """Optimise starts one after the other in this process."""
    with _interrupts_noted() as answer:
        problem, method = formulation.problem, instance("solver", formulation.task.search.solver)
        answer()
        for index in indices:
            progress(optimise_start(problem, method, formulation.task.search.seed, index, folder, answer))
            answer()


def run_in_pool(formulation: Formulation, indices: list[int], folder: Path, progress: Progress) -> None:
    """Optimise starts on a pool of processes; starts that a broken pool leaves unfinished run in this process.

    Raises
    ------
    KeyboardInterrupt
        After the processes were ended; their best points are on disk.
    """
    task, content = formulation.task, _pickled(formulation.blueprint)
    workers = min(task.search.workers or os.cpu_count() or 1, len(indices))
    left = set(indices)
    context = multiprocessing.get_context("spawn")
    others = set(multiprocessing.active_children())
    with _one_thread_each():
        pool: ProcessPoolExecutor | None = None
        try:
            ensure_running()  # it lets interrupts through again once it has started its process
            with _interrupts_held(), _main_not_imported():
                pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_prepare, initargs=(content,))
                futures = [pool.submit(_work, task.search.seed, index, folder) for index in indices]
            for future in as_completed(futures):
                result = future.result()
                left.discard(result.index)
                progress(result)
        except BrokenProcessPool:
            serial(formulation, sorted(left), folder, progress)
        except BaseException:
            for process in set(multiprocessing.active_children()) - others:
                process.terminate()
            raise
        finally:
            if pool is not None:
                pool.shutdown(wait=True, cancel_futures=True)
            for unfinished in folder.glob(".start-*"):  # a process that was ended while it wrote
                unfinished.unlink(missing_ok=True)
