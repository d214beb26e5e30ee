"""Multistart: every start is optimised independently, in worker processes, and written to disk as soon as it ends."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cloudpickle

from excite.design.formulation import Formulation
from excite.design.interruption import deferred_interruption
from excite.design.kept_starts import remove_temporary
from excite.design.single_start import optimise_start
from excite.design.start_results import RUNNING, StartResult, read_starts, start_file, write_start
from excite.design.worker_process import NotPreparedError
from excite.design.workers import Workers, environment_of_workers
from excite.registry import instance
from regressors.errors import InputError

__all__ = [
    "RUNNING",
    "Progress",
    "StartResult",
    "optimise_start",
    "read_starts",
    "run_in_pool",
    "serial",
    "start_file",
    "write_start",
]

Progress = Callable[[StartResult], None]
_log = logging.getLogger(__name__)


def pickled(*content: Any) -> bytes:
    """A blueprint and more, pickled for other processes, with classes of the user's script by value.

    Raises
    ------
    InputError
        A part of the user's own that cannot be pickled.
    """
    try:
        return bytes(cloudpickle.dumps(content))
    except Exception as error:
        raise InputError(
            f"a part of this task cannot be sent to other processes ({error}); Search(executor='serial') keeps it in "
            "this one"
        ) from error


def serial(formulation: Formulation, indices: Sequence[int], folder: Path, progress: Progress) -> None:
    """Optimise starts one after the other in this process."""
    search, origin = formulation.task.search, formulation.identity.origin
    with deferred_interruption() as answer:
        problem, method = formulation.problem, instance("solver", search.solver)
        answer()
        for index in indices:
            progress(optimise_start(problem, method, search.seed, index, folder, answer, origin))
            answer()


def run_in_pool(formulation: Formulation, indices: Sequence[int], folder: Path, progress: Progress) -> None:
    """Optimise starts in worker processes; one that ends unexpectedly is announced and replaced.

    Where worker processes cannot build the problem, a warning is logged, and the starts run in this process.

    Raises
    ------
    KeyboardInterrupt
        After the processes were ended; their best points are on disk.
    LostWorkersError
        Processes end again and again, and no start does.
    """
    search = formulation.task.search
    content = pickled(formulation.blueprint, formulation.identity.origin)
    count = min(search.workers or os.cpu_count() or 1, len(indices))
    with environment_of_workers():
        workers = Workers(content, search.seed, folder, count)
        try:
            for result in workers.run(indices):
                progress(result)
            return
        except NotPreparedError as error:
            _log.warning("worker processes cannot build the problem (%s): the starts run in this process", error)
        finally:
            workers.end()
            remove_temporary(folder)
    serial(formulation, indices, folder, progress)
