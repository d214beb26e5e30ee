"""Damped BFGS sequential quadratic programming with feasible iterates, the default solver.

Where limits are linear, the quadratic programme's solution is inside all of them once it is inside all rows of the
grid; a step of any length up to one then stays inside (the set is convex). The programme contains only the rows near
their bounds, and is solved again with the rows that its solution violates. Limits that are not linear in x enter it as
tangents, with a reserve for their curvature; a step that still violates one is scaled into the limits where the problem
can do so, and shortened until it violates none.

Each descent takes the same steps as alone, to the last bit, whatever runs beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import replace

import numpy as np

from excite.design.problem import ObjectivePoint, Problem
from excite.design.solvers.descent import Descent, DescentStep, Programmes, SqpOptions
from excite.design.solvers.solver import Attempt, Solver, SolverResult, Status, Watcher
from regressors.samples import Array

_RACE = (25, 15)  # iterations of the first and of a middle stage that each of several starts gets
_HEATS = ((1, 8, 2), (-2, 20, 1))  # of combinations: stage, iterations, how many go on
_RETURNED = 0.3  # distance from a known motion, in parts of that from rest, at which a combination has returned to it
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


Plan = Generator[Sequence[Descent], None, SolverResult]

_ARMIJO = 1e-4
_FLAT = 1e-10  # predicted change of the objective that counts as zero
_LENGTHS = 12


def follow(problem: Problem, plans: Sequence[Plan]) -> Iterator[tuple[int, SolverResult]]:
    """Follow some plans until each has returned."""
    programmes = Programmes(problem)
    stages: dict[int, Sequence[Descent]] = dict.fromkeys(range(len(plans)), ())
    while stages:
        for k in list(stages):
            while k in stages and all(descent.status is not None for descent in stages[k]):
                try:
                    stages[k] = next(plans[k])
                except StopIteration as end:
                    del stages[k]
                    yield k, end.value
        _advance(problem, programmes, [one for stage in stages.values() for one in stage if one.status is None])


def _advance(problem: Problem, programmes: Programmes, descents: Sequence[Descent]) -> None:
    """Take one step of each."""
    new = [descent for descent in descents if descent.point is None]
    points = problem.points([descent.x for descent in new], [descent.sharpness for descent in new])
    for descent, point, g in zip(new, points, problem.gradients(points), strict=True):
        descent.set_out(point, g)
    descents = [descent for descent in descents if descent.status is None]
    searches = []
    for descent, solution in zip(descents, programmes.steps(descents), strict=True):
        if solution is None:
            descent.stop(Status.FAILED)
        elif (slope := float(descent.g @ solution[0][0])) > -_FLAT:
            descent.stop(Status.CONVERGED)
        else:
            searches.append(_LineSearch(descent, *solution, slope))
    _search(problem, searches)
    taken = [(search, search.taken) for search in searches if search.taken is not None]
    gradients = problem.gradients([search.point for search, _ in taken])
    for (search, step), g in zip(taken, gradients, strict=True):
        search.descent.learn(step, g)
    for search in searches:
        if search.taken is None:
            search.descent.stop(Status.NO_DESCENT)


class _LineSearch:
    """Accept the longest step that the limits allow and that lowers the objective enough, by backtracking."""

    def __init__(self, descent: Descent, step: DescentStep, length: float, slope: float) -> None:
        assert descent.point is not None
        self.descent, (self._d, self._w), self._length, self._slope = descent, step, length, slope
        self._before = descent.point.value
        self.point: ObjectivePoint = descent.point
        self.taken: DescentStep | None = None

    def trial(self) -> Array | None:
        """The next point, inside the limits; None where a shorter step is to be tried first."""
        problem, x = self.descent.problem, self.descent.x
        self._straight = x + self._length * self._d.reshape(x.shape)
        self._x = problem.inside(self._straight)
        if problem.nonlinear_hold(self._x):
            return self._x
        self._length *= 0.5
        return None

    def take(self, point: ObjectivePoint) -> bool:
        """Accept the point, or shorten the step."""
        length, slope, descent = self._length, self._slope, self.descent
        descent.evaluations += 1
        if point.value <= self._before + _ARMIJO * length * slope:
            straight = self._x is self._straight
            self.taken = (length * self._d, length * self._w) if straight else _between(descent, self._x)
            descent.arrive(self._x, point)
            self.point = point
            return True
        excess = point.value - self._before - length * slope
        self._length *= float(np.clip(-slope * length / (2 * excess), 0.2, 0.5)) if np.isfinite(excess) else 0.2
        return False


def _between(descent: Descent, end: Array) -> DescentStep:
    """The step to a point that is not on the straight line of a programme's solution."""
    assert descent.H is not None
    d = (end - descent.x).ravel()
    return d, descent.H.whitened(d)


def _search(problem: Problem, searches: Sequence[_LineSearch]) -> None:
    left = list(searches)
    for _ in range(_LENGTHS):
        trials = [(search, search.trial()) for search in left]
        inside = [(search, x) for search, x in trials if x is not None]
        points = problem.points([x for _, x in inside], [search.descent.sharpness for search, _ in inside])
        taken = [search for (search, _), point in zip(inside, points, strict=True) if search.take(point)]
        left = [search for search in left if search not in taken]
        if not left:
            return
