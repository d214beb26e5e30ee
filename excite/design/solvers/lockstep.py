"""Descents in lockstep: the points of all of them are evaluated together, which costs fewer calls.

Each descent takes the same steps as alone, to the last bit, whatever runs beside it.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence

import numpy as np

from excite.design.problem import Problem
from excite.design.smooth_objective import ObjectivePoint
from excite.design.solvers.descent import Descent, DescentStep
from excite.design.solvers.programmes import Programmes
from excite.design.solvers.solver import SolverResult, Status
from regressors.samples import Array

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
    _set_out(problem, [descent for descent in descents if descent.point is None])
    descents = [descent for descent in descents if descent.status is None]
    searches = []
    for descent, step in zip(descents, programmes.steps(descents), strict=True):
        if step is None:
            descent.stop(Status.FAILED)
        elif (slope := float(descent.g @ step.d)) > -_FLAT:
            descent.stop(Status.CONVERGED)
        else:
            searches.append(_LineSearch(descent, step, slope))
    _search(problem, searches)
    taken = [(search, search.taken) for search in searches if search.taken is not None]
    gradients = problem.gradients([search.point for search, _ in taken])
    for (search, step), g in zip(taken, gradients, strict=True):
        search.descent.learn(step, g)
    for search in searches:
        if search.taken is None:
            search.descent.stop(Status.NO_DESCENT)


def _set_out(problem: Problem, descents: Sequence[Descent]) -> None:
    points = problem.points([descent.x for descent in descents], [descent.sharpness for descent in descents])
    for descent, point, g in zip(descents, points, problem.gradients(points), strict=True):
        descent.set_out(point, g)


class _LineSearch:
    """Accept the longest step that the limits allow and that lowers the objective enough, by backtracking."""

    def __init__(self, descent: Descent, step: DescentStep, slope: float) -> None:
        assert descent.point is not None
        self.descent, self._step, self._slope = descent, step, slope
        self._before = descent.point.value
        self._length = step.length
        self.point: ObjectivePoint = descent.point
        self.taken: DescentStep | None = None

    def trial(self) -> Array | None:
        """The next point, inside the limits; None where a shorter step is to be tried first."""
        problem, x = self.descent.problem, self.descent.x
        self._straight = x + self._length * self._step.d.reshape(x.shape)
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
            self.taken = self._step.part(length) if straight else _between(descent, self._x)
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
    return DescentStep(d, descent.H.whitened(d))


def _search(problem: Problem, searches: Sequence[_LineSearch]) -> None:
    left = list(searches)
    for _ in range(_LENGTHS):
        trials = [(search, search.trial()) for search in left]
        inside = [(search, x) for search, x in trials if x is not None]
        sharpness = [search.descent.sharpness for search, _ in inside]
        points = problem.points([x for _, x in inside], sharpness)
        taken = {id(search) for (search, _), point in zip(inside, points, strict=True) if search.take(point)}
        left = [search for search in left if id(search) not in taken]
        if not left:
            return
