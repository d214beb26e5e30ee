"""One start: a random initial guess, or one that combines motions, optimised, and written to disk as it goes."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from excite.design.combinations import combinations
from excite.design.initial_guesses import candidates, shrunk
from excite.design.planned_start import PlannedStart
from excite.design.problem import Problem
from excite.design.solvers.solver import Solver, SolverResult
from excite.design.start_results import RUNNING, Origin, StartResult, write_start
from regressors.errors import NumericalError
from regressors.samples import Array

_SAVE_EVERY = 1.0  # seconds between saves of an unfinished start


def optimise_start(
    problem: Problem,
    method: Solver,
    seed: int,
    start: PlannedStart | int,
    folder: Path | None,
    answer: Callable[[], None] = lambda: None,
    origin: Origin | None = None,
) -> StartResult:
    """Draw the initial guess of a start and optimise it, saving the best point so far every second.

    Parameters
    ----------
    problem : Problem
    method : Solver
    seed : int
    start : PlannedStart or int
        A number is that of a random start; with the seed it determines the result.
    folder : Path, optional
        Folder for the start's file; no file is written if not given.
    answer : callable
        Called after every iterate; may raise to end the start.
    origin : Origin, optional
        What its file says of where it comes from; a start without it is not reused by a later search.
    """
    began = time.process_time()
    start = start if isinstance(start, PlannedStart) else PlannedStart(start)
    index = start.index
    watch = _Snapshots(start, folder, answer, origin)
    with threadpool_limits(1), np.errstate(all="ignore"):  # a point that overflows is worse than any, and left behind
        rng = np.random.default_rng([seed, index])
        outcome = _solve(problem, method, start, rng, watch)
        value = problem.exact_value(outcome.x)
    if not np.all(np.isfinite(outcome.x)):
        raise NumericalError(f"start {index} ended at a motion that is not finite; check `period` and the limits")
    cpu = time.process_time() - began
    result = StartResult(
        index,
        outcome.x.tolist(),
        value,
        outcome.status.value,
        outcome.history,
        outcome.evaluations,
        cpu,
        *_descent(start),
    )
    if folder is not None:
        write_start(folder, result, origin)
    return result


class _Snapshots:
    """Watcher of a search that writes its best point so far every second."""

    def __init__(
        self, start: PlannedStart, folder: Path | None, answer: Callable[[], None], origin: Origin | None
    ) -> None:
        self.start, self.folder, self.answer, self.origin = start, folder, answer, origin
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
            so_far = x.tolist(), value, RUNNING, history, len(history), cpu
            unfinished = StartResult(self.start.index, *so_far, *_descent(self.start))
            write_start(self.folder, unfinished, self.origin)
        self.answer()


def _descent(start: PlannedStart) -> tuple[tuple[int, ...], str]:
    return tuple(parent.index for parent in start.parents), start.lineage


def _solve(
    problem: Problem, method: Solver, start: PlannedStart, rng: np.random.Generator, watch: _Snapshots
) -> SolverResult:
    """Solve without the limits that hold by default, then with those that the motion breaks, until it breaks none.

    Most motions break none or few of them, and each makes an evaluation more expensive.
    """
    known = [parent.coefficients for parent in start.parents]
    if start.kind == "random":
        guesses = candidates(problem, start.index, rng)
        outcome = method.solve(problem, guesses, watch)
    elif start.kind == "combination":
        guesses = combinations(problem, known, rng)
        outcome = method.combine(problem, guesses, known, watch)
    else:
        guesses = [shrunk(problem, known[0])]
        outcome = method.refine(problem, guesses[0], watch)
    while method.takes_nonlinear_limits and (limited := problem.with_broken(outcome.x)) is not problem:
        problem, evaluations = limited, outcome.evaluations
        watch.restart()
        guesses = [shrunk(problem, x) for x in (outcome.x, *guesses)]
        outcome = method.solve(problem, guesses, watch)
        outcome = replace(outcome, evaluations=evaluations + outcome.evaluations)
    return outcome
