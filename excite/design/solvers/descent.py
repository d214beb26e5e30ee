"""One descent of the SQP solver: the iterate, the Hessian approximation, the best point so far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import blas

from excite.design.problem import ObjectivePoint, Problem
from excite.design.solvers.limit_rows import Sides
from excite.design.solvers.solver import SolverResult, Status, Watcher
from regressors.samples import Array

_STEEPEST = 1e100  # a gradient beyond it is of a motion that identifies next to nothing


@dataclass(frozen=True)
class SqpOptions:
    """Settings of the solver."""

    iterations: int = 80  # limit per stage of the criterion
    tolerance: float = 2e-4  # A step that improves the smooth approximation of ``log`` criterion by less is small
    patience: int = 3  # small steps in a row that end a stage

    @property
    def last(self) -> SqpOptions:
        """Settings of the criterion's last stage, solved more exactly: some motions improve slowly for long."""
        return replace(
            self, iterations=2 * self.iterations, tolerance=0.25 * self.tolerance, patience=self.patience + 2
        )


@dataclass(frozen=True, eq=False)
class DescentStep:
    """A step, and what is known of it."""

    d: Array  # (n,)
    w: Array  # (n,) the step in whitened coordinates, ``d = J w``
    length: float = 1.0  # largest part of the step, at most 1, that is inside the limits that are linear in x

    def part(self, length: float) -> DescentStep:
        """A part of the step."""
        if length == 1.0:
            return self
        return DescentStep(length * self.d, length * self.w)


class Descent:
    """State of one descent, stage by stage of the criterion."""  # start (n, size)

    def __init__(self, problem: Problem, start: Array, watch: Watcher | None = None) -> None:
        self.problem, self.watch = problem, watch
        self.x = self.best = start
        self.value = self.best_value = np.inf  # the criterion
        self.history: list[float] = []
        self.evaluations = 0
        self.status: Status | None = None
        self.H: BfgsFactor | None = None
        self.point: ObjectivePoint | None = None
        self.g: Array = np.zeros(0)
        self.sides: Sides = np.zeros(0, dtype=np.int32)  # of each linear row, where it is expected to be active

    def begin(self, sharpness: float, options: SqpOptions) -> Descent:
        """Begin a stage; its first point is to be evaluated."""
        self.sharpness, self.options = sharpness, options
        self.status, self.point = None, None
        self._left, self._small, self._fresh = options.iterations, 0, self.H is None
        return self

    def set_out(self, point: ObjectivePoint, g: Array) -> None:
        """Take the objective where the stage begins, and its gradient."""
        if not self.history:
            self._accept(self.x, point)
        self.point, self.g = point, g.ravel()
        if not np.abs(g).max(initial=0.0) < _STEEPEST:
            self.status = Status.FAILED
        elif self.H is None:
            self.H = BfgsFactor(self.g)

    def arrive(self, x: Array, point: ObjectivePoint) -> None:
        """Accept a point of lower objective."""
        assert self.point is not None
        small = self.point.value - point.value < self.options.tolerance
        self._small = self._small + 1 if small else 0
        self._accept(x, point)
        self.point = point

    def learn(self, step: DescentStep, g: Array) -> None:
        """Take the gradient at the accepted end of a step."""
        assert self.H is not None
        g = g.ravel()
        self.H.update(step.d, g - self.g, step.w)
        self.g, self._fresh = g, False
        self._left -= 1
        if self._small >= self.options.patience:
            self.status = Status.CONVERGED
        elif not self._left:
            self.status = Status.ITERATION_LIMIT

    def result(self, among: Sequence[Descent] = ()) -> SolverResult:
        """The best point, with the evaluations of all descents that it was chosen among."""
        assert self.status is not None
        evaluations = sum(descent.evaluations for descent in among or (self,))
        return SolverResult(self.best, self.best_value, self.status, self.history, evaluations)

    def stop(self, reason: Status) -> None:
        """There is no step: end the stage, or try once more where the Hessian approximation may be outdated."""
        self._left -= 1
        if self._fresh or reason is Status.CONVERGED:
            self.status = reason
        elif not self._left:
            self.status = Status.ITERATION_LIMIT
        else:
            self.H, self._fresh = BfgsFactor(self.g), True

    def _accept(self, x: Array, point: ObjectivePoint) -> None:
        self.x = x
        self.value = value = self.problem.criterion_value(point)
        self.history.append(value)
        if value < self.best_value:
            self.best, self.best_value = x, value
        if self.watch is not None:
            self.watch(x, value)


_SMALLEST = 1e-8


class BfgsFactor:
    """Positive definite H, by a matrix J with ``H^-1 = J J'``.

    In whitened coordinates ``w = J^-1 d`` the curvature ``d'Hd`` is ``w'w``, so that a quadratic programme needs no
    factorisation, and an update of J takes n^2 operations.
    """  # g (n,); J (n, n)

    def __init__(self, g: Array) -> None:
        length = max(float(np.linalg.norm(g)), _SMALLEST)
        self.J: Array = np.asfortranarray(np.eye(g.size) / np.sqrt(length))

    def whitened(self, s: Array) -> Array:
        """``J^-1 s``, by a factorisation."""
        return np.asarray(np.linalg.solve(self.J, s))

    def update(self, s: Array, y: Array, w: Array) -> None:
        """BFGS update damped so that H stays positive definite [Powell 1978].

        With ``r = theta y + (1 - theta) H s`` and ``w = J^-1 s``, H becomes ``H - Hs s'H / s'Hs + r r' / s'r`` by
        ``J - s (J'r - sqrt(s'r / w'w) w)' / s'r`` [Brodlie, Gourlay, Greenstadt 1973].
        """  # s, y (n,); w (n,)
        curvature = float(w @ w)  # s'Hs
        if curvature <= 0.0:
            return
        sy = float(s @ y)
        theta = 1.0 if sy >= 0.2 * curvature else 0.8 * curvature / (curvature - sy)
        sr = theta * sy + (1.0 - theta) * curvature
        change = theta * (y @ self.J) + (1.0 - theta - np.sqrt(sr / curvature)) * w
        self.J = blas.dger(-1.0 / sr, s, change, a=self.J, overwrite_a=1)


_INSIDE = 1.0 - 1e-12


class BestInside:
    """Best of the iterates of a solver, each pulled towards the start until it is inside the limits."""

    def __init__(self, problem: Problem, start: Array, watch: Watcher | None) -> None:
        self.problem, self.start, self.watch = problem, start, watch
        self.best, self.best_value = start, np.inf
        self.history: list[float] = []
        self.evaluations = 0
        self.offer(start)

    def offer(self, x: Array) -> None:
        """Keep x, pulled towards the start as far as the limits require, if it is the best so far."""
        reach = min(1.0, _INSIDE * self.problem.longest_step(self.start, x - self.start))
        inside = self.start + reach * (x - self.start)
        value = self.problem.criterion_value(self.problem.point(inside, self.problem.criterion.stages[0]))
        if value < self.best_value:
            self.best, self.best_value = inside, value
        self.history.append(value)
        if self.watch is not None:
            self.watch(inside, value)
