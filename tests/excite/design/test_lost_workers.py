"""Worker processes that end are announced and replaced; a start that ends them again and again is left out."""

from __future__ import annotations

import logging
import os
import signal
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from excite.design.formulation import formulate
from excite.design.initial_guesses import candidates
from excite.design.multistart import run_in_pool
from excite.design.optimisation import solve
from excite.design.problem import Problem
from excite.design.start_results import StartResult
from excite.errors import LostWorkersError, NoFeasibleMotionError
from excite.tasks.task import Task
from regressors.readers.library import load_robot
from regressors.samples import Array

pytestmark = pytest.mark.slow
ROBOT = load_robot("irp6")


def deadly(poison: Array | None) -> Any:
    """A solver that ends its process where a search begins at some point, or anywhere; sent to processes by value."""
    from excite.design.solvers.solver import Solver, SolverResult, Status

    class Deadly(Solver):
        name = "deadly"

        def solve(self, problem: Problem, starts: Sequence[Array], watch: object = None) -> SolverResult:
            if poison is None or np.array_equal(starts[0], poison):
                os.kill(os.getpid(), signal.SIGKILL)
            return SolverResult(starts[0], 1.0, Status.CONVERGED, [1.0], 1)

    return Deadly()


def first_guess(index: int) -> Array:
    problem = formulate(ROBOT, Task("irp6", harmonics=3)).problem
    return candidates(problem, index, np.random.default_rng([0, index]))[0]


def test_a_start_that_ends_its_process_is_left_out(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    task = Task("irp6", harmonics=3, starts=4, workers=2, solver=deadly(first_guess(1)))
    reported: list[StartResult] = []
    with caplog.at_level(logging.WARNING):
        design = solve(ROBOT, formulate(ROBOT, task), tmp_path, reported.append)
    assert sorted(result.index for result in reported) == [0, 2, 3]
    assert [start.index for start in design.starts] == [0, 2, 3]
    assert "1 of 4 starts are left out: their processes ended each time" in design.notes
    told = [record.getMessage() for record in caplog.records]
    assert [text.partition("; ")[0] for text in told] == 3 * [
        "a worker process ended at start 1 (signal 9, which is often a lack of memory) and is replaced"
    ]
    assert [text.partition("; ")[2] for text in told] == [
        "the start runs again",
        "the start runs alone after the others, since this is the second time",
        "the start is left out, since this is the third time",
    ]


def test_replacements_are_bounded(tmp_path: Path) -> None:
    made = formulate(ROBOT, Task("irp6", harmonics=3, starts=9, workers=1, solver=deadly(None)))
    with pytest.raises(LostWorkersError, match="7 worker processes ended one after the other"):
        run_in_pool(made, [range(9)], tmp_path, lambda _: None)


def test_no_start_at_all_is_an_error(tmp_path: Path) -> None:
    made = formulate(ROBOT, Task("irp6", harmonics=3, starts=1, workers=1, solver=deadly(None)))
    with pytest.raises(NoFeasibleMotionError, match="no start has a result"):
        solve(ROBOT, made, tmp_path)
