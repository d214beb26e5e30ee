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

import daqp
import numpy as np

from excite.design.problem import Problem
from excite.design.smooth_objective import ObjectivePoint
from excite.design.solvers.linear_rows import LinearRows, peaks
from excite.design.solvers.nonlinear_rows import NearRows
from excite.design.solvers.solver import Solver, SolverResult, Status, Watcher
from regressors.samples import Array, Index

_INSIDE = 0.9995  # fraction of each bound that the quadratic programme may use: violations between rows fit in the rest
_NEAR = 0.7  # rows used beyond this fraction of their bound enter the programme at once
_ARMIJO = 1e-4
_FLAT = 1e-10  # predicted change of the objective that counts as zero
_RIDGE = 1e-9  # of the largest curvature: keeps the quadratic programme well conditioned
_STEEPEST = 1e100  # a gradient beyond it is of a motion that identifies next to nothing
_ROUNDS = 8
_RACE = (25, 15)  # iterations of the first and of a middle stage that each of several starts gets


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


class _Run:
    """State of one solve: the iterate, the Hessian approximation, the best point so far."""

    def __init__(self, problem: Problem, start: Array, watch: Watcher | None) -> None:
        self.problem, self.watch = problem, watch
        self.x = start
        self.H: Array | None = None
        self.best, self.best_value = start, np.inf
        self.history: list[float] = []
        self.evaluations = 0
        self.step = _Step(problem)

    def _accept(self, x: Array, point: ObjectivePoint) -> None:
        self.x = x
        value = self.problem.criterion_value(point)
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
        H = self.H if self.H is not None else _scaled_identity(g)
        small, fresh = 0, self.H is None
        for _ in range(options.iterations):
            best, end = self._iterate(H, g, point, sharpness)
            if best is None:
                if fresh or end is Status.CONVERGED:
                    return end
                H, fresh = _scaled_identity(g), True  # the BFGS matrix may be outdated: try once more without it
                continue
            step, new = best
            g_new = problem.gradient(new).ravel()
            self.H = H = _damped_bfgs(H, step, g_new - g)
            small = small + 1 if point.value - new.value < options.tolerance else 0
            point, g, fresh = new, g_new, False
            if small >= options.patience:
                return Status.CONVERGED
        return Status.ITERATION_LIMIT

    def _iterate(
        self, H: Array, g: Array, point: ObjectivePoint, sharpness: float
    ) -> tuple[tuple[Array, ObjectivePoint] | None, Status]:
        """Take one step; return None and the reason where there is none."""
        d = self.step.direction(self.x, H, g)
        if d is None:
            return None, Status.FAILED
        slope = float(g @ d)
        if slope > -_FLAT:
            return None, Status.CONVERGED
        return self._line_search(d, slope, point, sharpness), Status.NO_DESCENT

    def _line_search(
        self, d: Array, slope: float, point: ObjectivePoint, sharpness: float
    ) -> tuple[Array, ObjectivePoint] | None:
        """Accept the longest step that the limits allow and that lowers the objective enough, by backtracking."""
        direction = d.reshape(self.x.shape)
        length = 1.0 if self.step.whole else self.problem.first_length(self.x, direction)
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
                step = length * d if x is straight else (x - self.x).ravel()
                self._accept(x, new)
                return step, new
            length *= float(np.clip(-slope * length / (2 * excess), 0.2, 0.5)) if np.isfinite(excess) else 0.2
        return None


def _scaled_identity(g: Array) -> Array:
    return np.eye(g.size) * max(float(np.linalg.norm(g)), 1e-8)


def _damped_bfgs(H: Array, s: Array, y: Array) -> Array:
    """BFGS update damped so that H stays positive definite [Powell 1978]."""
    Hs = H @ s
    curvature = float(s @ Hs)
    if curvature <= 0.0:
        return H
    sy = float(s @ y)
    theta = 1.0 if sy >= 0.2 * curvature else 0.8 * curvature / (curvature - sy)
    r = theta * y + (1 - theta) * Hs
    return np.asarray(H - np.outer(Hs, Hs) / curvature + np.outer(r, r) / float(s @ r))


class _Step:
    """The quadratic programme ``min g'd + d'Hd/2`` within the limits, on a growing set of rows."""

    def __init__(self, problem: Problem) -> None:
        linear = problem.limits.linear_in_x
        self.linear = LinearRows(linear, problem.shape) if linear else None
        self.nonlinear = problem.limits.nonlinear_in_x
        self.whole = False  # whether the whole last step is inside the limits that are linear in x

    def direction(self, x: Array, H: Array, g: Array) -> Array | None:
        """Solution of the programme; None if its solver fails."""
        H = H.copy()
        H.flat[:: g.size + 1] += _RIDGE * float(H.flat[:: g.size + 1].max())
        linear = self.linear
        at = linear.values(x) if linear is not None else np.zeros((1, 1))
        rows = peaks(np.abs(at), _NEAR)
        near = NearRows(self.nonlinear, x) if self.nonlinear else None
        d = np.zeros(g.size)
        self.whole = False
        for _ in range(_ROUNDS):
            A, lower, upper = self._programme(at, rows, near)
            d, _, flag, _ = daqp.solve(H, g, A, upper, lower, np.zeros(len(upper), dtype=np.int32))
            if flag < 0:
                return None
            use = np.abs(at + linear.changes(d)) if linear is not None else at
            broken = near is not None and near.broken(d)
            self.whole = float(use.max()) <= 1.0
            if self.whole and not broken:
                break
            rows = np.union1d(rows, peaks(use, _INSIDE))
        return np.asarray(d)

    def _programme(self, at: Array, rows: Index, near: NearRows | None) -> tuple[Array, Array, Array]:
        parts = [near.rows()] if near is not None else []
        if self.linear is not None:
            here = at.ravel()[rows]
            parts.append((self.linear.rows(rows), np.minimum(-_INSIDE - here, 0.0), np.maximum(_INSIDE - here, 0.0)))
        if len(parts) == 1:
            return parts[0]
        A, lower, upper = zip(*parts, strict=True)
        return np.concatenate(A), np.concatenate(lower), np.concatenate(upper)
