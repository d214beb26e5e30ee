"""What runs in a worker process of a search: it builds the problem once, and optimises starts."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import cloudpickle
from threadpoolctl import threadpool_limits

from excite.design.blueprint import Blueprint
from excite.design.interruption import SIGNALS
from excite.design.planned_start import PlannedStart
from excite.design.problem import Problem
from excite.design.single_start import optimise_starts
from excite.design.solvers.solver import Solver
from excite.design.start_results import Origin, StartResult
from excite.registry import instance

Job = tuple[int, Sequence[PlannedStart | int], Path]
Work = Callable[[Any], Any]

_PR_SET_PDEATHSIG = 1  # of Linux's prctl


class NotPreparedError(Exception):
    """A worker process cannot build the problem; what it says is why."""


def unpickled(content: bytes) -> Work:
    """Prepare the work in a process that has inherited nothing."""
    prepare, *arguments = cloudpickle.loads(content)
    work: Work = prepare(*arguments)
    return work


def work_on_starts(blueprint: Blueprint, origin: Origin) -> Work:
    """Build the problem of a search; what is returned optimises starts."""
    return partial(optimise_job, blueprint.problem(), instance("solver", blueprint.task.search.solver), origin)


def optimise_job(problem: Problem, method: Solver, origin: Origin, job: Job) -> list[StartResult]:
    """Optimise some starts together."""
    seed, starts, folder = job
    return optimise_starts(problem, method, seed, starts, folder, origin=origin)


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
