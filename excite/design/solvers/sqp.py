"""Damped BFGS sequential quadratic programming with feasible iterates, the default solver.

Where limits are linear, the quadratic programme's solution is inside all of them once it is inside all rows of the
grid; a step of any length up to one then stays inside (the set is convex). The programme contains only the rows near
their bounds, and is solved again with the rows that its solution violates. Limits that are not linear in x enter it as
tangents, with a reserve for their curvature; a step that still violates one is scaled into the limits where the problem
can do so, and shortened until it violates none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from excite.design.problem import Problem
from excite.design.smooth_objective import ObjectivePoint
from excite.design.solvers.bfgs import BfgsFactor
from excite.design.solvers.least_distance import FREE, LeastDistance, Rows, Sides
from excite.design.solvers.linear_rows import LinearRows, peaks
from excite.design.solvers.nonlinear_rows import NearRows
from excite.design.solvers.solver import Solver, SolverResult, Status, Watcher
from regressors.samples import Array, Index

_INSIDE = 0.9995  # fraction of each bound that the quadratic programme may use: violations between rows fit in the rest
_NEAR = 0.7  # rows used beyond this fraction of their bound enter the programme at once
_ARMIJO = 1e-4
_FLAT = 1e-10  # predicted change of the objective that counts as zero
_STEEPEST = 1e100  # a gradient beyond it is of a motion that identifies next to nothing
_ROUNDS = 8
_RACE = (25, 15)  # iterations of the first and of a middle stage that each of several starts gets
_HEATS = ((1, 8, 2), (-2, 20, 1))  # of combinations: stage, iterations, how many go on
_RETURNED = 0.1  # distance from a known motion, in parts of that from rest, at which a combination has returned to it
_SHARPER = 4.0  # than the last stage: for the motion that is the result


@dataclass(frozen=True)
class SqpOptions:
    """Settings of the solver.

    Parameters
    ----------
    iterations : int
        Limit per stage of the criterion.
    tolerance : float
        A step that improves the smooth approximation of ``log`` criterion by less is small.
    patience : int
        Small steps in a row that end a stage.
    """

    iterations: int = 80
    tolerance: float = 2e-4
    patience: int = 3

    @property
    def last(self) -> SqpOptions:
        """Settings of the criterion's last stage, solved more exactly: some motions improve slowly for long."""
        return replace(
            self, iterations=2 * self.iterations, tolerance=0.25 * self.tolerance, patience=self.patience + 2
        )


class SequentialQuadratic(Solver):
    """Damped BFGS SQP with a working set of limit rows."""

    name = "sqp"

    def __init__(self, options: SqpOptions | None = None) -> None:
        self.options = options if options is not None else SqpOptions()

    def solve(self, problem: Problem, starts: Sequence[Array], watch: Watcher | None = None) -> SolverResult:
        """Race the starts over a few iterations, then take the best one through the criterion's stages."""
        runs = [_Run(problem, start, watch) for start in starts]
        stages = problem.criterion.stages
        if len(runs) > 1:
            for run in runs:
                for sharpness, iterations in zip((stages[0], stages[len(stages) // 2]), _RACE, strict=True):
                    run.stage(sharpness, replace(self.options, iterations=iterations))
            stages = stages[1:] or stages
        run = min(runs, key=lambda run: problem.point(run.x, stages[len(stages) // 2]).value)
        for sharpness in stages[:-1]:
            run.stage(sharpness, self.options)
        status = run.stage(stages[-1], self.options.last)
        return SolverResult(run.best, run.best_value, status, run.history, sum(r.evaluations for r in runs))

    def combine(
        self, problem: Problem, starts: Sequence[Array], known: Sequence[Array], watch: Watcher | None = None
    ) -> SolverResult:
        """Race the starts in the later stages of the criterion, without those that return to a known motion."""
        runs = every = [_Run(problem, start, watch) for start in starts]
        stages = problem.criterion.stages
        for stage, iterations, most in _HEATS:
            sharpness = stages[stage] if len(stages) > 1 else stages[0]
            for run in runs:
                run.stage(sharpness, replace(self.options, iterations=iterations))
            new = [run for run in runs if not _is_near(run.x, known, problem.rest)] or runs
            runs = sorted(new, key=lambda run: run.value)[:most]
        status = runs[0].stage(stages[-1], self.options.last)
        evaluations = sum(run.evaluations for run in every)
        return SolverResult(runs[0].best, runs[0].best_value, status, runs[0].history, evaluations)

    def refine(self, problem: Problem, x: Array, watch: Watcher | None = None) -> SolverResult:
        """Solve a sharper approximation of a criterion that is one of the extreme eigenvalues."""
        run, stages = _Run(problem, x, watch), problem.criterion.stages
        status = run.stage(stages[-1], self.options.last)
        if len(stages) > 1:
            status = run.stage(_SHARPER * stages[-1], self.options.last)
        return SolverResult(run.best, run.best_value, status, run.history, run.evaluations)


def _is_near(x: Array, known: Sequence[Array], rest: Array) -> bool:
    return any(np.linalg.norm(x - other) <= _RETURNED * np.linalg.norm(other - rest) for other in known)


class _Run:
    """State of one solve: the iterate, the Hessian approximation, the best point so far."""

    def __init__(self, problem: Problem, start: Array, watch: Watcher | None) -> None:
        self.problem, self.watch = problem, watch
        self.x = start
        self.H: BfgsFactor | None = None
        self.best, self.best_value = start, np.inf
        self.value = np.inf  # the criterion at x
        self.history: list[float] = []
        self.evaluations = 0
        self.programme = _Programme(problem)

    def _accept(self, x: Array, point: ObjectivePoint) -> None:
        self.x = x
        self.value = value = self.problem.criterion_value(point)
        self.history.append(value)
        if value < self.best_value:
            self.best, self.best_value = x, value
        if self.watch is not None:
            self.watch(x, value)

    def stage(self, sharpness: float, options: SqpOptions) -> Status:
        problem = self.problem
        point = problem.point(self.x, sharpness)
        g = problem.gradient(point).ravel()
        if not self.history:
            self._accept(self.x, point)
        if not np.abs(g).max(initial=0.0) < _STEEPEST:
            return Status.FAILED
        H, fresh, small = self.H or BfgsFactor(g), self.H is None, 0
        for _ in range(options.iterations):
            best, end = self._iterate(H, g, point, sharpness)
            if best is None:
                if fresh or end is Status.CONVERGED:
                    return end
                H, fresh = BfgsFactor(g), True  # the BFGS matrix may be outdated: try once more without it
                continue
            step, new = best
            g_new = problem.gradient(new).ravel()
            H.update(step.d, g_new - g, step.w)
            self.H = H
            small = small + 1 if point.value - new.value < options.tolerance else 0
            point, g, fresh = new, g_new, False
            if small >= options.patience:
                return Status.CONVERGED
        return Status.ITERATION_LIMIT

    def _iterate(
        self, H: BfgsFactor, g: Array, point: ObjectivePoint, sharpness: float
    ) -> tuple[tuple[_Step, ObjectivePoint] | None, Status]:
        """Take one step; return None and the reason where there is none."""
        step = self.programme.solution(self.x, H, g)
        if step is None:
            return None, Status.FAILED
        slope = float(g @ step.d)
        if slope > -_FLAT:
            return None, Status.CONVERGED
        return self._line_search(step, slope, point, sharpness, H), Status.NO_DESCENT

    def _line_search(
        self, step: _Step, slope: float, point: ObjectivePoint, sharpness: float, H: BfgsFactor
    ) -> tuple[_Step, ObjectivePoint] | None:
        """Accept the longest step that the limits allow and that lowers the objective enough, by backtracking."""
        direction = step.d.reshape(self.x.shape)
        length = 1.0 if self.programme.whole else self.problem.first_length(self.x, direction)
        for _ in range(12):
            straight = self.x + length * direction
            x = self.problem.inside(straight)
            if not self.problem.nonlinear_hold(x):
                length *= 0.5
                continue
            new = self.problem.point(x, sharpness)
            self.evaluations += 1
            excess = new.value - point.value - length * slope
            if new.value <= point.value + _ARMIJO * length * slope:
                taken = step.part(length) if x is straight else _Step.between(self.x, x, H)
                self._accept(x, new)
                return taken, new
            length *= float(np.clip(-slope * length / (2 * excess), 0.2, 0.5)) if np.isfinite(excess) else 0.2
        return None


@dataclass(frozen=True, eq=False)
class _Step:
    """A step, and the same in whitened coordinates, ``d = J w``.

    Parameters
    ----------
    d, w : ndarray, shape (n,)
    """

    d: Array
    w: Array

    @classmethod
    def between(cls, x: Array, end: Array, H: BfgsFactor) -> _Step:
        """The step from one point to another."""
        d = (end - x).ravel()
        return cls(d, H.whitened(d))

    def part(self, length: float) -> _Step:
        """A fraction of the step."""
        return self if length == 1.0 else _Step(length * self.d, length * self.w)


class _Programme:
    """The quadratic programme ``min g'd + d'Hd/2`` within the limits, on a growing set of rows."""

    def __init__(self, problem: Problem) -> None:
        linear = problem.limits.linear_in_x
        self.linear = LinearRows(linear, problem.shape) if linear else None
        self.nonlinear = problem.limits.nonlinear_in_x
        self.whole = False  # whether the whole last step is inside the limits that are linear in x
        self._sides = np.zeros(self.linear.count if self.linear is not None else 0, dtype=np.int32)

    def solution(self, x: Array, H: BfgsFactor, g: Array) -> _Step | None:
        """Solution of the programme; None if its solver fails."""
        J = H.J
        programme = LeastDistance(g @ J)
        linear = _Working(self.linear, x, J, programme, self._sides) if self.linear is not None else None
        near = NearRows(self.nonlinear, x) if self.nonlinear else None
        d, w = np.zeros_like(g), np.zeros_like(g)
        self.whole = False
        for _ in range(_ROUNDS):
            found = programme.solve([] if near is None else [_whitened(near.rows(), J)])
            if found is None:
                return None
            d, w = J @ found, found
            broken = near is not None and near.broken(d)
            self.whole = linear is None or linear.hold(d)
            if self.whole and not broken:
                break
        if linear is not None:
            self._remember(linear.chosen, programme.sides)
        return _Step(d, w)

    def _remember(self, rows: Index, sides: Sides) -> None:
        """Expect the active rows and their neighbours in time to be active in the next programme."""
        active = sides != FREE
        rows, sides = rows[active], sides[active]
        self._sides[:] = FREE
        for shift in (-1, 1, 0):
            self._sides.put(rows + shift, sides, mode="clip")


class _Working:
    """Rows of a programme for the limits that are linear in x, about one x; more are added when needed."""

    def __init__(self, linear: LinearRows, x: Array, J: Array, programme: LeastDistance, expected: Sides) -> None:
        self._linear, self._J, self._programme, self._expected = linear, J, programme, expected
        self._at = linear.values(x)
        self._is_chosen = np.zeros(self._at.size, dtype=bool)
        self.chosen: Index = np.zeros(0, dtype=np.intp)
        self._add(peaks(np.abs(self._at), _NEAR))

    def _add(self, rows: Index) -> None:
        self._is_chosen[rows] = True
        self.chosen = np.concatenate([self.chosen, rows])
        self._programme.add(self._linear.bounded(self._at, rows, self._J, _INSIDE), self._expected[rows])

    def hold(self, d: Array) -> bool:
        """Whether a step keeps the limits; if not, add the rows that it violates."""
        use = self._linear.uses(self._at, d)
        if float(use.max()) <= 1.0:
            return True
        rows = peaks(use, _INSIDE)
        self._add(rows[~self._is_chosen[rows]])
        return False


def _whitened(rows: Rows, J: Array) -> Rows:
    A, lower, upper = rows
    return A @ J, lower, upper
