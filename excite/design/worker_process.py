"""What runs in a worker process of a search: it builds the problem once, and optimises one start after the other."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import sys
import threading
from contextlib import suppress
from pathlib import Path

import cloudpickle

from excite.design.blueprint import Blueprint
from excite.design.interruption import SIGNALS
from excite.design.problem import Problem
from excite.design.single_start import optimise_start
from excite.design.solvers.solver import Solver
from excite.design.start_results import Origin, StartResult
from excite.registry import instance

_PR_SET_PDEATHSIG = 1  # of Linux's prctl


class NotPreparedError(Exception):
    """A worker process cannot build the problem; what it says is why."""


_prepared: tuple[Problem, Solver, Origin] | None = None
_failure = ""


def prepare(content: bytes) -> None:
    """Build the problem once per process; only the parent answers signals, and this process ends with it.

    Parameters
    ----------
    content : bytes
        The pickled blueprint, and the origin of the starts.
    """
    global _prepared, _failure
    belong_to_parent()
    try:
        blueprint: Blueprint
        blueprint, origin = cloudpickle.loads(content)
        _prepared = blueprint.problem(), instance("solver", blueprint.task.search.solver), origin
    except Exception as error:
        _failure = f"{type(error).__name__}: {error}"


def work(seed: int, index: int, folder: Path) -> StartResult:
    """Optimise a start.

    Parameters
    ----------
    seed, index : int
    folder : Path

    Raises
    ------
    NotPreparedError
        The problem could not be built.
    """
    if _prepared is None:
        raise NotPreparedError(_failure)
    problem, method, origin = _prepared
    return optimise_start(problem, method, seed, index, folder, origin=origin)


def belong_to_parent() -> None:
    """Leave signals to the parent process, and end with it."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    _end_with_parent()


def _end_with_parent() -> None:
    """End this process with its parent: a killed parent would leave it waiting for work for ever."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    if sys.platform == "linux":  # by the kernel, whatever this process computes
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    threading.Thread(target=_wait_for, args=(parent,), daemon=True).start()


def _wait_for(parent: multiprocessing.process.BaseProcess) -> None:
    parent.join()
    os._exit(1)
