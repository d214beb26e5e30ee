"""Starts: random initial guesses, or ones that combine motions, optimised, and written to disk as they go."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from excite.design.initial_guesses import candidates, combinations, shrunk
from excite.design.problem import Problem
from excite.design.solvers.solver import Attempt, Solver, SolverResult
from excite.design.start_results import RUNNING, Origin, PlannedStart, Start, StartResult, Starts, write_start
from regressors.errors import NumericalError
from regressors.samples import Array

_SAVE_EVERY = 1.0  # seconds between saves of an unfinished start


def optimise_start(problem: Problem, method: Solver, seed: int, start: Start, folder: Path | None) -> StartResult:
    """Draw the initial guess of a start and optimise it, saving the best point so far every second."""
    return optimise_starts(problem, method, seed, [start], folder)[0]


def optimise_starts(
    problem: Problem,
    method: Solver,
    seed: int,
    starts: Starts,
    folder: Path | None,
    answer: Callable[[], None] = lambda: None,
    origin: Origin | None = None,
) -> list[StartResult]:
    """Optimise several starts beside each other, as `optimise_start` does each; no result depends on the others.

    A start's processor time is its share of that of all that were at work with it.
    """
    planned = [start if isinstance(start, PlannedStart) else PlannedStart(start) for start in starts]
    times = _SharedTime(len(planned))
    results = []
    with threadpool_limits(1), np.errstate(all="ignore"):  # a point that overflows is worse than any, and left behind
        attempts = [_attempt(problem, start, seed, _Snapshots(start, folder, answer, origin)) for start in planned]
        for k, first in method.attempt(problem, attempts):
            outcome = _within_broken(problem, method, attempts[k], first)
            if not np.all(np.isfinite(outcome.x)):
                raise NumericalError(
                    f"start {planned[k].index} ended at a motion that is not finite; check `period` and the limits"
                )
            value = problem.exact_value(outcome.x)
            end = value, outcome.status.value, outcome.history, outcome.evaluations, times.end(k)
            results.append(_result(planned[k], outcome.x, end))
            if folder is not None:
                write_start(folder, results[-1], origin)
    return results


def _result(start: PlannedStart, x: Array, so_far: tuple[float, str, list[float], int, float]) -> StartResult:
    parents = tuple(parent.index for parent in start.parents)
    return StartResult(start.index, x.tolist(), *so_far, parents, start.lineage)


class _SharedTime:
    """Processor time of jobs that are at work beside each other: each instant counts for those that have not ended."""

    def __init__(self, count: int) -> None:
        self._used = dict.fromkeys(range(count), 0.0)
        self._before = time.process_time()

    def end(self, job: int) -> float:
        """Processor time of a job that ends now [s]."""
        now = time.process_time()
        for k in self._used:
            self._used[k] += (now - self._before) / len(self._used)
        self._before = now
        return self._used.pop(job)


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
            unfinished = _result(self.start, x, (value, RUNNING, history, len(history), cpu))
            write_start(self.folder, unfinished, self.origin)
        self.answer()


def _attempt(problem: Problem, start: PlannedStart, seed: int, watch: _Snapshots) -> Attempt:
    rng = np.random.default_rng([seed, start.index])
    known = [parent.coefficients for parent in start.parents]
    if start.kind == "random":
        return Attempt("solve", candidates(problem, start.index, rng), watch=watch)
    if start.kind == "combination":
        return Attempt("combine", combinations(problem, known, rng), known, watch)
    return Attempt("refine", [shrunk(problem, known[0])], watch=watch)


def _within_broken(problem: Problem, method: Solver, attempt: Attempt, outcome: SolverResult) -> SolverResult:
    """Solve again with the limits that hold by default and that the motion breaks, until it breaks none.

    Most motions break none or few of them, and each makes an evaluation more expensive.
    """
    guesses, watch = attempt.starts, attempt.watch
    while method.takes_nonlinear_limits and (limited := problem.with_broken(outcome.x)) is not problem:
        problem, evaluations = limited, outcome.evaluations
        if isinstance(watch, _Snapshots):
            watch.restart()
        guesses = [shrunk(problem, x) for x in (outcome.x, *guesses)]
        outcome = method.solve(problem, guesses, watch)
        outcome = replace(outcome, evaluations=evaluations + outcome.evaluations)
    return outcome
