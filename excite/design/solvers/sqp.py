"""Damped BFGS sequential quadratic programming with feasible iterates, the default solver.

Where limits are linear, the quadratic programme's solution is inside all of them once it is inside all rows of the
grid; a step of any length up to one then stays inside (the set is convex). The programme contains only the rows near
their bounds, and is solved again with the rows that its solution violates. Limits that are not linear in x enter it as
tangents, with a reserve for their curvature; a step that still violates one is scaled into the limits where the problem
can do so, and shortened until it violates none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from excite.design.problem import Problem
from excite.design.solvers.descent import Descent, SqpOptions
from excite.design.solvers.lockstep import Plan, follow
from excite.design.solvers.solver import Attempt, Solver, SolverResult, Watcher
from regressors.samples import Array

_RACE = (25, 15)  # iterations of the first and of a middle stage that each of several starts gets
_HEATS = ((1, 8, 2), (-2, 20, 1))  # of combinations: stage, iterations, how many go on
_RETURNED = 0.1  # distance from a known motion, in parts of that from rest, at which a combination has returned to it
_SHARPER = 4.0  # than the last stage: for the motion that is the result


class SequentialQuadratic(Solver):
    """Damped BFGS SQP with a working set of limit rows."""

    name = "sqp"

    def __init__(self, options: SqpOptions | None = None) -> None:
        self.options = options if options is not None else SqpOptions()

    def solve(self, problem: Problem, starts: Sequence[Array], watch: Watcher | None = None) -> SolverResult:
        """Race the starts over a few iterations, then take the best one through the criterion's stages."""
        return self._alone(problem, Attempt("solve", starts, watch=watch))

    def combine(
        self, problem: Problem, starts: Sequence[Array], known: Sequence[Array], watch: Watcher | None = None
    ) -> SolverResult:
        """Race the starts in the later stages of the criterion, without those that return to a known motion."""
        return self._alone(problem, Attempt("combine", starts, known, watch))

    def refine(self, problem: Problem, x: Array, watch: Watcher | None = None) -> SolverResult:
        """Solve a sharper approximation of a criterion that is one of the extreme eigenvalues."""
        return self._alone(problem, Attempt("refine", [x], watch=watch))

    def _alone(self, problem: Problem, attempt: Attempt) -> SolverResult:
        return next(self.attempt(problem, [attempt]))[1]

    def attempt(self, problem: Problem, attempts: Sequence[Attempt]) -> Iterator[tuple[int, SolverResult]]:
        """All of them in lockstep: their points are evaluated together. What else runs changes no result."""
        plans: dict[str, Callable[[Problem, Attempt], Plan]] = {
            "solve": self._solution, "combine": self._combination, "refine": self._refinement
        }  # fmt: skip
        return follow(problem, [plans[attempt.kind](problem, attempt) for attempt in attempts])

    def _solution(self, problem: Problem, attempt: Attempt) -> Plan:
        descents = [Descent(problem, start, attempt.watch) for start in attempt.starts]
        stages = problem.criterion.stages
        middle = stages[len(stages) // 2]
        best = descents[0]
        if len(descents) > 1:
            for sharpness, iterations in zip((stages[0], middle), _RACE, strict=True):
                yield [descent.begin(sharpness, replace(self.options, iterations=iterations)) for descent in descents]
            stages = stages[1:] or stages
            best = min(descents, key=lambda descent: problem.point(descent.x, middle).value)
        for sharpness in stages[:-1]:
            yield [best.begin(sharpness, self.options)]
        yield [best.begin(stages[-1], self.options.last)]
        return best.result(among=descents)

    def _combination(self, problem: Problem, attempt: Attempt) -> Plan:
        descents = every = [Descent(problem, start, attempt.watch) for start in attempt.starts]
        stages = problem.criterion.stages
        for stage, iterations, most in _HEATS:
            sharpness = stages[stage] if len(stages) > 1 else stages[0]
            yield [descent.begin(sharpness, replace(self.options, iterations=iterations)) for descent in descents]
            new = [one for one in descents if not _is_near(one.x, attempt.known, problem.rest)] or descents
            descents = sorted(new, key=lambda descent: descent.value)[:most]
        yield [descents[0].begin(stages[-1], self.options.last)]
        return descents[0].result(among=every)

    def _refinement(self, problem: Problem, attempt: Attempt) -> Plan:
        descent, stages = Descent(problem, attempt.starts[0], attempt.watch), problem.criterion.stages
        yield [descent.begin(stages[-1], self.options.last)]
        if len(stages) > 1:
            yield [descent.begin(_SHARPER * stages[-1], self.options.last)]
        return descent.result()


def _is_near(x: Array, known: Sequence[Array], rest: Array) -> bool:
    return any(np.linalg.norm(x - other) <= _RETURNED * np.linalg.norm(other - rest) for other in known)
