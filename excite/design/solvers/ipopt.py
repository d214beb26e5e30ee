"""IPOPT as shipped with CasADi, a cross-check of the solver ``sqp``.

It takes every fourth row of all limits, with a limited-memory Hessian. Iterates may leave the limits; each is brought
back along the line to the start, and the best one is kept.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from excite.design.problem import Problem
from excite.design.solvers.descent import BestInside
from excite.design.solvers.solver import Solver, SolverResult, Status, Watcher
from regressors.samples import Array


class _Objective(ca.Callback):  # type: ignore[misc]
    """Smooth objective of one stage, with its gradient as the Jacobian."""

    def __init__(self, problem: Problem, sharpness: float, keep: BestInside) -> None:
        ca.Callback.__init__(self)
        self.problem, self.sharpness, self.keep = problem, sharpness, keep
        self.size = problem.rest.size
        self.construct("objective", {})

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
        A.append(limit.tangent(problem.rest)(function, instant))
        lower.append(limit.lower[function])
        upper.append(limit.upper[function])
    return np.concatenate(A), np.concatenate([np.zeros(0), *lower]), np.concatenate([np.zeros(0), *upper])
