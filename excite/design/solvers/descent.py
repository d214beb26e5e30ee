"""One descent of the SQP solver: the iterate, the Hessian approximation, the best point so far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import blas

from excite.design.grid_limits import GridConstraint
from excite.design.problem import ObjectivePoint, Problem
from excite.design.solvers.limit_rows import FREE, LeastDistance, LinearRows, NearRows, Sides, largest_part
from excite.design.solvers.solver import SolverResult, Status, Watcher
from regressors.samples import Array, Index

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
        return SqpOptions(2 * self.iterations, 0.25 * self.tolerance, self.patience + 2)


#: A step d, shape (n,), and the same in whitened coordinates, ``d = J w``.
DescentStep = tuple[Array, Array]


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
        g, (d, w) = g.ravel(), step
        self.H.update(d, g - self.g, w)
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


_KEPT_INSIDE = 0.9995  # fraction of each bound that a programme may use: violations between rows fit in the rest
_NEAR = 0.7  # rows used beyond this fraction of their bound enter the programme at once
_ROUNDS = 8


class Programmes:
    """The programmes of the descents of one problem."""

    def __init__(self, problem: Problem) -> None:
        linear = problem.limits.linear_in_x
        self._linear = LinearRows(linear, problem.shape) if linear else None
        self._nonlinear = problem.limits.nonlinear_in_x

    def steps(self, descents: Sequence[Descent]) -> list[tuple[DescentStep, float] | None]:
        """Solution of each descent's programme, see `_Programme.step`; None where its solver fails."""
        programmes = [_Programme(descent, self._linear, self._nonlinear) for descent in descents]
        if self._linear is not None and programmes:
            self._add(programmes, np.array([programme.x for programme in programmes]), _NEAR)
        left = programmes
        for _ in range(_ROUNDS):
            left = self._broken([programme for programme in left if programme.solve()])
        return [programme.step() for programme in programmes]

    def _broken(self, programmes: list[_Programme]) -> list[_Programme]:
        """Those whose solutions violate limits; the rows that they violate are added."""
        broken = {each for each in programmes if each.near is not None and each.near.broken(each.d)}
        if self._linear is not None and programmes:
            ends = np.array([programme.x + programme.d for programme in programmes])
            broken.update(self._add(programmes, ends, _KEPT_INSIDE))
        return [programme for programme in programmes if programme in broken]

    def _add(self, programmes: Sequence[_Programme], xs: Array, threshold: float) -> list[_Programme]:
        """Add the rows that peak beyond a threshold at an x of each; return those with one beyond its bound."""
        assert self._linear is not None
        which, flat, outside = self._linear.peaks(xs, threshold)
        ends = np.searchsorted(which, np.arange(1, len(programmes) + 1)).tolist()
        parts = list(zip(programmes, [0, *ends], ends, strict=False))
        for programme, begin, end in parts:
            programme.is_whole = not outside[begin:end].any()
        is_new = np.concatenate([~programme.is_chosen[flat[begin:end]] for programme, begin, end in parts])
        which, flat = which[is_new], flat[is_new]
        starts = np.array([programme.x for programme in programmes])[which]
        rows, lower, upper = self._linear.bounded(starts, flat, _KEPT_INSIDE)
        ends = np.searchsorted(which, np.arange(1, len(programmes) + 1)).tolist()
        for programme, begin, end in zip(programmes, [0, *ends], ends, strict=False):
            if end > begin:
                programme.add(flat[begin:end], rows[begin:end], lower[begin:end], upper[begin:end])
        return [programme for programme in programmes if not programme.is_whole]


class _Programme:
    """The programme of one descent, on a growing set of rows."""

    def __init__(self, descent: Descent, linear: LinearRows | None, nonlinear: Sequence[GridConstraint]) -> None:
        assert descent.H is not None
        self._descent, self._J, self._linear = descent, descent.H.J, linear
        self._programme = LeastDistance(descent.g @ self._J)
        self.near = NearRows(nonlinear, descent.x) if nonlinear else None
        self._w: Array | None = None
        self.x, self.d = descent.x.ravel(), np.zeros_like(descent.g)
        self.is_whole = True  # whether the step is inside the limits that are linear in x
        if linear is not None:
            self._chosen: Index = np.zeros(0, dtype=np.intp)
            self.is_chosen = np.zeros(linear.count, dtype=bool)
            if not descent.sides.size:
                descent.sides = np.full(linear.count, FREE, dtype=np.int32)

    def add(self, flat: Index, rows: Array, lower: Array, upper: Array) -> None:
        """Add rows of the limits that are linear in x."""
        assert self._linear is not None
        self.is_chosen[flat] = True
        self._chosen = np.concatenate([self._chosen, flat])
        bounded = self._linear.products(flat, rows, self._J), lower, upper
        self._programme.add(bounded, self._descent.sides[flat])

    def solve(self) -> bool:
        """Solve it on the rows so far; False if its solver fails."""
        others = []
        if self.near is not None:
            A, lower, upper = self.near.rows()
            others = [(A @ self._J, lower, upper)]
        self._w = self._programme.solve(others)
        if self._w is None:
            return False
        self.d = self._J @ self._w
        return True

    def step(self) -> tuple[DescentStep, float] | None:
        """The solution, and its largest part, at most 1, that is inside the limits that are linear in x.

        Rows that are active in it are expected to be active again.
        """
        if self._w is None:
            return None
        length = 1.0
        if self._linear is not None:
            self._descent.sides[:] = FREE
            self._descent.sides[self._chosen] = self._programme.sides
            if not self.is_whole:
                length = largest_part(self._linear.values(self.x), self._linear.changes(self.d))
        return (self.d, self._w), length
