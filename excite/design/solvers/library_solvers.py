"""Solvers of libraries: SciPy's SLSQP [Kraft 1988] on the rows of the grid that come near their bounds, and IPOPT.

IPOPT, as shipped with CasADi, takes every fourth row of all limits, with a limited-memory Hessian. Iterates of both may
leave the limits; each is brought back along the line to the start, and the best one is kept. Rows that a solution of
SLSQP violates are added, and the stage is solved again from there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np
import scipy.optimize

from excite.design.problem import Problem
from excite.design.solvers.descent import BestInside
from excite.design.solvers.solver import Solver, SolverResult, Status, Watcher
from regressors.samples import Array, Index

_NEAR = 0.5  # peaks that use more than this fraction of their bound are rows from the beginning
_BROKEN = 1.0 + 1e-9
_STATUS = {0: Status.CONVERGED, 8: Status.NO_DESCENT, 9: Status.ITERATION_LIMIT}


class Slsqp(Solver):
    """SLSQP with a growing set of rows, stage after stage, as a cross-check of the other solvers.

    Parameters
    ----------
    iterations : int
        Limit per call of SLSQP.
    rounds : int
        Calls per stage, each with the rows that the previous one violated.
    tolerance : float
        Change of the smooth approximation of ``log`` criterion that ends a call.
    """

    name = "slsqp"
    takes_nonlinear_limits = False

    def __init__(self, iterations: int = 100, rounds: int = 6, tolerance: float = 1e-5) -> None:
        self.iterations, self.rounds, self.tolerance = iterations, rounds, tolerance

    def solve(self, problem: Problem, starts: Sequence[Array], watch: Watcher | None = None) -> SolverResult:
        """Take the best start through the criterion's stages, each from the best point of the last one."""
        start = min(starts, key=lambda x: problem.point(x, problem.criterion.stages[0]).value)
        keep = BestInside(problem, start, watch)
        rows = _Rows(problem)
        status = Status.CONVERGED
        for sharpness in problem.criterion.stages:
            x = keep.best
            rows.add(x, _NEAR)
            for _ in range(self.rounds):
                x, status = self._solution(problem, sharpness, x, rows, keep)
                if status is Status.FAILED or not rows.add(x, _BROKEN):
                    break
            keep.offer(x)
        return SolverResult(keep.best, keep.best_value, status, keep.history, keep.evaluations)

    def _solution(
        self, problem: Problem, sharpness: float, x: Array, rows: _Rows, keep: BestInside
    ) -> tuple[Array, Status]:
        """Result of one call of SLSQP; its initial point if the call fails."""
        shape = x.shape

        def objective(flat: Array) -> tuple[float, Array]:
            keep.evaluations += 1
            point = problem.point(flat.reshape(shape), sharpness)
            return point.value, problem.gradient(point).ravel()

        result = scipy.optimize.minimize(
            objective,
            x.ravel(),
            jac=True,
            method="SLSQP",
            constraints=rows.constraints(),
            callback=lambda flat: keep.offer(flat.reshape(shape)),
            options={"maxiter": self.iterations, "ftol": self.tolerance},
        )
        status = _STATUS.get(result.status, Status.FAILED)
        if status is Status.FAILED or not np.all(np.isfinite(result.x)):
            return x, Status.FAILED
        return result.x.reshape(shape), status


class _Rows:
    """Rows ``lower <= A x <= upper`` of the grid that came near their bounds or were violated."""

    def __init__(self, problem: Problem) -> None:
        self.limits = problem.limits.linear_in_x
        self.tangents = [limit.tangent(problem.rest) for limit in self.limits]
        self.instants = self.limits[0].values(problem.rest).shape[1]
        self.chosen: list[Index] = [np.zeros(0, dtype=np.intp) for _ in self.limits]

    def add(self, x: Array, threshold: float) -> bool:
        """Add the peaks over time that use more than a fraction of their bound at x; return whether any is new."""
        new = False
        for k, limit in enumerate(self.limits):
            use = limit.uses(limit.values(x))
            peak = (use >= np.roll(use, 1, axis=1)) & (use >= np.roll(use, -1, axis=1)) & (use > threshold)
            union = np.union1d(self.chosen[k], np.flatnonzero(peak))
            new |= union.size > self.chosen[k].size
            self.chosen[k] = union
        return new

    def constraints(self) -> list[dict[str, Any]]:
        """Constraints for SciPy, as functions that must not be negative, relative to the scale of their limits."""
        A, b = [], []
        for limit, tangent, flat in zip(self.limits, self.tangents, self.chosen, strict=True):
            function, instant = np.divmod(flat, self.instants)
            rows = tangent.rows(function, instant) / limit.scale[function, None]
            A += [-rows, rows]
            b += [(limit.upper / limit.scale)[function], -(limit.lower / limit.scale)[function]]
        rows, room = np.concatenate(A), np.concatenate(b)
        return [{"type": "ineq", "fun": lambda x: rows @ x + room, "jac": lambda _: rows}]


class _Objective(ca.Callback):  # type: ignore[misc]
    """Smooth objective of one stage, with its gradient as the Jacobian."""

    def __init__(self, problem: Problem, sharpness: float, keep: BestInside) -> None:
        ca.Callback.__init__(self)
        self.problem, self.sharpness, self.keep = problem, sharpness, keep
        self.size = problem.rest.size
        self.construct("objective", {})

    def get_n_in(self) -> int:
        return 1

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_in(self, _: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self.size, 1)

    def eval(self, arg: list[ca.DM]) -> list[ca.DM]:
        x = np.asarray(arg[0]).reshape(self.problem.rest.shape)
        self.keep.evaluations += 1
        return [self.problem.point(x, self.sharpness).value]

    def has_jacobian(self) -> bool:
        return True

    def get_jacobian(self, name: str, inputs: list[str], outputs: list[str], options: dict[str, object]) -> ca.Function:
        self.jacobian = _Gradient(self, name, inputs, outputs, options)
        return self.jacobian


class _Gradient(ca.Callback):  # type: ignore[misc]
    def __init__(
        self, objective: _Objective, name: str, inputs: list[str], outputs: list[str], options: dict[str, object]
    ) -> None:
        ca.Callback.__init__(self)
        self.objective, self.inputs, self.outputs = objective, inputs, outputs
        self.construct(name, options)

    def get_n_in(self) -> int:
        return 2

    def get_n_out(self) -> int:
        return 1

    def get_name_in(self, i: int) -> str:
        return self.inputs[i]

    def get_name_out(self, i: int) -> str:
        return self.outputs[i]

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self.objective.size, 1) if i == 0 else ca.Sparsity.dense(1, 1)

    def get_sparsity_out(self, _: int) -> ca.Sparsity:
        return ca.Sparsity.dense(1, self.objective.size)

    def eval(self, arg: list[ca.DM]) -> list[ca.DM]:
        problem = self.objective.problem
        x = np.asarray(arg[0]).reshape(problem.rest.shape)
        gradient = problem.gradient(problem.point(x, self.objective.sharpness))
        self.objective.keep.offer(x)
        return [ca.DM(gradient.ravel()).T]


class Ipopt(Solver):
    """IPOPT with MUMPS and a limited-memory Hessian, stage after stage."""

    name = "ipopt"
    takes_nonlinear_limits = False

    def __init__(self, iterations: int = 150) -> None:
        self.iterations = iterations

    def solve(self, problem: Problem, starts: Sequence[Array], watch: Watcher | None = None) -> SolverResult:
        """Take the best start through the criterion's stages, each from the last one's end."""
        start = min(starts, key=lambda x: problem.point(x, problem.criterion.stages[0]).value)
        keep = BestInside(problem, start, watch)
        A, lower, upper = _spaced_rows(problem)
        x = start.ravel()
        status = Status.CONVERGED
        for sharpness in problem.criterion.stages:
            objective = _Objective(problem, sharpness, keep)
            symbol = ca.MX.sym("x", x.size)
            nlp = {"x": symbol, "f": objective(symbol), "g": ca.mtimes(ca.DM(A), symbol)}
            solver = ca.nlpsol("solver", "ipopt", nlp, self._options())
            result = solver(x0=x, lbg=lower, ubg=upper)
            state = solver.stats()["return_status"]
            if state == "Invalid_Option" or not np.all(np.isfinite(np.asarray(result["x"]))):
                return SolverResult(keep.best, keep.best_value, Status.FAILED, keep.history, keep.evaluations)
            x = np.asarray(result["x"]).ravel()
            keep.offer(x.reshape(problem.rest.shape))
            status = Status.CONVERGED if solver.stats()["success"] else Status.ITERATION_LIMIT
        return SolverResult(keep.best, keep.best_value, status, keep.history, keep.evaluations)

    def _options(self) -> dict[str, object]:
        return {
            "print_time": False,
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",
            "ipopt.linear_solver": "mumps",
            "ipopt.hessian_approximation": "limited-memory",
            "ipopt.max_iter": self.iterations,
            "ipopt.tol": 1e-4,
            "ipopt.acceptable_tol": 1e-3,
            "ipopt.jac_c_constant": "yes",
            "ipopt.jac_d_constant": "yes",
        }


def _spaced_rows(problem: Problem, spacing: int = 4) -> tuple[Array, Array, Array]:
    """Every fourth instant of the grid; `BestInside` enforces the limits in between."""
    A, lower, upper = [np.zeros((0, problem.rest.size))], [], []
    for limit in problem.limits.linear_in_x:
        instants = np.arange(0, limit.values(problem.rest).shape[1], spacing)
        function, instant = (i.ravel() for i in np.meshgrid(np.arange(len(limit.lower)), instants, indexing="ij"))
        A.append(limit.tangent(problem.rest).rows(function, instant))
        lower.append(limit.lower[function])
        upper.append(limit.upper[function])
    return np.concatenate(A), np.concatenate([np.zeros(0), *lower]), np.concatenate([np.zeros(0), *upper])
