"""The starts of a search: optimised and written to disk as they go, and kept for when the search is resumed."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from excite.design.formulation import Formulation
from excite.design.initial_guesses import candidates, combinations, shrunk
from excite.design.problem import Problem
from excite.design.problem_identity import ProblemIdentity
from excite.design.solvers.solver import Attempt, Solver, SolverResult
from excite.design.start_results import (
    RUNNING,
    Origin,
    PlannedStart,
    Start,
    StartResult,
    Starts,
    read_start,
    start_files,
    write_start,
)
from excite.storage.manifest import EditedError
from regressors.errors import InputError, NumericalError
from regressors.samples import Array

_REMEDY = "`fresh` removes them, or choose another `folder`"


@dataclass(frozen=True)
class KeptStarts:
    """Finished starts of a problem in a folder, and those that are left."""

    folder: Path
    count: int | None  # number of starts of the task; None where the search adapts it
    done: Mapping[int, str] = field(default_factory=dict)  # lineage of those that are finished, by their number
    best: float = float("inf")  # least value among them
    cpu: float = 0.0  # processor time that they took [s]
    notes: tuple[str, ...] = ()  # what was found, in sentences

    def left(self, starts: Starts) -> Starts:
        """Those of some planned starts that are still to run."""
        return [start for start in starts if not self.has(start)] if self.done else starts

    def has(self, start: Start) -> bool:
        """Whether a start is finished, and descends from what is planned now."""
        index, lineage = (start, "") if isinstance(start, int) else (start.index, start.lineage)
        return self.done.get(index) == lineage


def keep_starts(
    folder: Path, formulation: Formulation, *, fresh: bool = False, shown: Path | None = None
) -> KeptStarts:
    """Find the finished starts of a problem in a folder, and remove files of starts that did not end."""
    shown = folder if shown is None else shown
    remove_temporary(folder)
    search, identity = formulation.task.search, formulation.identity
    count = None if search.adaptive else search.first
    if fresh:
        remove_starts(folder)
        return KeptStarts(folder, count)
    done: dict[int, str] = {}
    unfinished, errors, best, cpu = list[Path](), list[InputError](), float("inf"), 0.0
    for index, path in start_files(folder):
        try:
            start, origin = read_start(path)
        except InputError as error:
            errors.append(error)
            unfinished.append(path)
            continue
        _check_origin(origin, identity, shown)
        if start.status == RUNNING or start.index != index or identity.sha256 is None:
            unfinished.append(path)
        elif count is None or (index < count and not start.lineage):
            done[index] = start.lineage
            best, cpu = min(best, start.value), cpu + start.cpu
    _remove(unfinished)
    edited = sum(isinstance(error, EditedError) for error in errors)
    notes = _notes(shown, count, len(done), edited, len(errors) - edited)
    if identity.doubt and unfinished:
        notes.append(f"the starts in {shown} are not reused: {identity.doubt}")
    return KeptStarts(folder, count, done, best, cpu, tuple(notes))


def _notes(shown: Path, count: int | None, done: int, edited: int, unreadable: int) -> list[str]:
    which = f"{done} start{'s' if done > 1 else ''}" if count is None else f"{done} of {count} starts"
    then = "the search goes on from there" if count is None else f"{count - done} {_are(count - done)} left"
    notes = [f"{which} {_are(done)} already done in {shown}; {then}"] if done else []
    for number, one, several in (
        (edited, "was changed after it was written", "were changed after they were written"),
        (unreadable, "cannot be read", "cannot be read"),
    ):
        if number == 1:
            notes.append(f"1 file in {shown} {one}; its start runs again")
        elif number:
            notes.append(f"{number} files in {shown} {several}; their starts run again")
    return notes


def _are(count: int) -> str:
    return "is" if count == 1 else "are"


def _check_origin(origin: Origin | None, identity: ProblemIdentity, shown: Path) -> None:
    """Refuse a start of another problem; of one that cannot be compared, it is not known."""
    if origin is None:
        raise InputError(f"{shown} holds starts that do not state their problem; {_REMEDY}")
    if origin["sha256"] == identity.sha256:
        return
    told = identity.differences(origin["problem"])
    raise InputError(f"{shown} holds starts of another problem{f' ({told})' if told else ''}; {_REMEDY}")


def remove_starts(folder: Path) -> None:
    """Remove all starts of a folder."""
    _remove([path for _, path in start_files(folder)])


def remove_temporary(folder: Path) -> None:
    """Remove the temporary files of processes that were killed while they wrote a start."""
    _remove(list(folder.glob(".start-*")))


def _remove(paths: Sequence[Path]) -> None:
    for path in paths:
        path.unlink(missing_ok=True)


_SAVE_EVERY = 1.0  # seconds between saves of an unfinished start


def optimise_starts(
    problem: Problem,
    method: Solver,
    seed: int,
    starts: Starts,
    folder: Path | None,
    answer: Callable[[], None] = lambda: None,
    origin: Origin | None = None,
) -> list[StartResult]:
    """Draw the initial guesses of some starts and optimise them beside each other; no result depends on the others.

    The best point so far of each is saved every second. A start's processor time is its share of that of all at work.
    """
    planned = [start if isinstance(start, PlannedStart) else PlannedStart(start) for start in starts]
    results = []
    with threadpool_limits(1), np.errstate(all="ignore"):  # a point that overflows is worse than any, and left behind
        for parents, group in groupby(planned, key=lambda start: start.parents):
            family, near = list(group), problem.with_near([parent.coefficients for parent in parents])
            times = _SharedTime(len(family))
            attempts = [_attempt(near, start, seed, _Snapshots(start, folder, answer, origin)) for start in family]
            for k, first in method.attempt(near, attempts):
                outcome = _within_broken(near, method, attempts[k], first)
                if not np.all(np.isfinite(outcome.x)):
                    raise NumericalError(
                        f"start {family[k].index} ended at a motion that is not finite; check `period` and the limits"
                    )
                value = near.exact_value(outcome.x)
                end = value, outcome.status.value, outcome.history, outcome.evaluations, times.end(k)
                results.append(_result(family[k], outcome.x, end))
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
    parents, avoided = ([each.coefficients for each in group] for group in (start.parents, start.avoided))
    if start.kind == "random":
        return Attempt("solve", candidates(problem, start.index, rng), watch=watch)
    if start.kind == "combination":
        return Attempt("combine", combinations(problem, parents, rng), avoided, watch)
    return Attempt("refine", [shrunk(problem, parents[0])], watch=watch)


def _within_broken(problem: Problem, method: Solver, attempt: Attempt, outcome: SolverResult) -> SolverResult:
    """Solve again with the limits that hold by default and that the motion breaks, until it breaks none.

    Most motions break none or few of them, and each makes an evaluation more expensive.
    """
    watch = attempt.watch
    while (limited := problem.with_broken(outcome.x)) is not problem:
        problem, evaluations = limited, outcome.evaluations
        if isinstance(watch, _Snapshots):
            watch.restart()
        outcome = method.solve(problem, [shrunk(problem, outcome.x)], watch)
        outcome = replace(outcome, evaluations=evaluations + outcome.evaluations)
    return outcome
