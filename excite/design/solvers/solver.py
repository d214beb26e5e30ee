"""Interface of solvers, which improve a feasible motion within the limits."""

from __future__ import annotations

import enum
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal

from excite.design.problem import Problem
from regressors.samples import Array


class Status(enum.Enum):
    """How a solver ended, as a sentence."""

    CONVERGED = "the last steps brought no more than the tolerance"
    ITERATION_LIMIT = "the iteration limit was reached before the steps became small"
    NO_DESCENT = "no step along the search direction improved the criterion"
    FAILED = "the solver failed; the best point before that is kept"


@dataclass(frozen=True, eq=False)
class SolverResult:
    """Result of a solver.

    Parameters
    ----------
    x : ndarray, shape (n, size)
        Best accepted point; inside the limits.
    value : float
        The criterion there.
    status : Status
    history : list of float
        The criterion at every accepted iterate, the start first.
    evaluations : int
        Evaluations of the objective.
    """

    x: Array
    value: float
    status: Status
    history: list[float] = field(default_factory=list)
    evaluations: int = 0


Watcher = Callable[[Array, float], None]


@dataclass(frozen=True, eq=False)
class Attempt:
    """One call of a solver's methods, to be made beside others."""

    kind: Literal["solve", "combine", "refine"]
    starts: Sequence[Array]  # (n, size) one or more, inside the limits; only one to refine
    known: Sequence[Array] = ()  # see `Solver.combine`
    watch: Watcher | None = None  # see `Solver.solve`


class Solver(ABC):
    """A solver of design problems.

    Attributes
    ----------
    name : str
        Name on the command line.
    """

    name: str

    @abstractmethod
    def solve(self, problem: Problem, starts: Sequence[Array], watch: Watcher | None = None) -> SolverResult:
        """Improve the most promising of some starts.

        Parameters
        ----------
        problem : Problem
        starts : sequence of ndarray, shape (n, size)
            One or more, strictly inside the limits.
        watch : callable, optional
            Called with (x, criterion) after every accepted iterate.
        """

    def combine(
        self, problem: Problem, starts: Sequence[Array], known: Sequence[Array], watch: Watcher | None = None
    ) -> SolverResult:
        """Improve the most promising of some combinations of known motions; as `solve`, unless there is a better way.

        Parameters
        ----------
        problem : Problem
        starts : sequence of ndarray
            One or more, inside the limits.
        known : sequence of ndarray
            Local minima to which it does not pay to return; none where any end will do.
        watch : callable, optional
        """
        return self.solve(problem, starts, watch)

    def refine(self, problem: Problem, x: Array, watch: Watcher | None = None) -> SolverResult:
        """Go on from a motion that has been solved; as `solve`, unless there is a better way."""
        return self.solve(problem, [x], watch)

    def attempt(self, problem: Problem, attempts: Sequence[Attempt]) -> Iterator[tuple[int, SolverResult]]:
        """Make several attempts, one after the other unless there is a better way; no result depends on the others.

        Yields
        ------
        int, SolverResult
            Number and result of an attempt, as soon as it ends.
        """
        for k, one in enumerate(attempts):
            if one.kind == "solve":
                yield k, self.solve(problem, one.starts, one.watch)
            elif one.kind == "combine":
                yield k, self.combine(problem, one.starts, one.known, one.watch)
            else:
                yield k, self.refine(problem, one.starts[0], one.watch)
