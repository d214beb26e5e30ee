"""What a good engineer writes in an afternoon: exact gradients by CasADi, for IPOPT or for SciPy's SLSQP.

The objective is a smooth stand-in for log cond(W), ``(1 / 2p) (log tr G^p + log tr G^-p)`` with G = W'W / N at 100
instants, minimised for p = 4, then from there for p = 32. Variables, limits and random starts are those of
`baseline_slsqp`. What of each of these was tried and left is on the page of results, `afternoon`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca  # type: ignore[import-untyped]
import numpy as np
import symbolic
from baseline_slsqp import LIMIT_INSTANTS, SPACING, bases, descents, limit_rows, random_start, spent, two_sided
from cases import case
from judge import Array

POWERS = (4, 32)
_IPOPT = {
    "hessian_approximation": "limited-memory",
    "limited_memory_max_history": 20,
    "limited_memory_aug_solver": "extended",
    "jac_d_constant": "yes",
    "tol": 1e-4,
    "max_iter": 2000,
    "print_level": 0,
    "sb": "yes",
}
Iterates = list[tuple[float, Array]]


def information(name: str) -> tuple[ca.MX, ca.MX]:
    """Coefficients x of a motion, and G = W'W / N."""
    n, steps = len(case(name).middle), [ca.DM(basis) for basis in bases(LIMIT_INSTANTS)]
    x = ca.MX.sym("x", n * steps[0].shape[1])
    X = ca.reshape(x, -1, n)
    blocks = symbolic.columns(name).map(LIMIT_INSTANTS)(*((step @ X).T for step in steps))
    W = ca.vertcat(*ca.horzsplit(blocks, blocks.shape[1] // LIMIT_INSTANTS))
    return x, W.T @ W / LIMIT_INSTANTS


def stand_in(G: ca.MX, power: int) -> ca.MX:
    """The smooth criterion; powers by squaring of matrices whose traces are near one."""
    G = G / ca.trace(G) * G.shape[0]
    inverse = ca.inv(G)
    for _ in range(int(np.log2(power))):
        G, inverse = G @ G, inverse @ inverse
    return (ca.log(ca.trace(G)) + ca.log(ca.trace(inverse))) / (2 * power)


class _Watch(ca.Callback):  # type: ignore[misc]
    """Keeps IPOPT's iterates, and stops it when the processor time is spent."""

    def __init__(self, variables: int, rows: int, cpu: float) -> None:
        super().__init__()
        self.cpu, self.kept = cpu, Iterates()
        self._sizes = {"x": variables, "f": 1, "g": rows, "lam_x": variables, "lam_g": rows}
        self.construct("watch", {})

    def get_n_in(self) -> int:
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_in(self, k: int) -> ca.Sparsity:
        size = self._sizes.get(ca.nlpsol_out(k), 0)
        return ca.Sparsity.dense(size, 1 if size else 0)

    def eval(self, given: Any) -> list[int]:
        now = spent()
        if now - self.kept[-1][0] > SPACING:
            self.kept.append((now, np.array(given[0]).ravel()))
        return [int(now > self.cpu)]


def ipopt(wanted: Mapping[str, Any]) -> Iterates:
    """Processor time and iterate of descents by IPOPT, from one random start after the other."""
    arm, rng = case(wanted["case"]), np.random.default_rng(wanted["seed"])
    A, b = limit_rows(arm.limits)
    rows, lower, upper = two_sided(arm.limits)
    x, G = information(arm.name)
    watch = _Watch(x.numel(), len(upper), wanted["cpu"])
    problem = {"x": x, "g": ca.sparsify(ca.DM(rows)) @ x}
    options = {"ipopt": _IPOPT, "print_time": False, "iteration_callback": watch}
    solvers = [ca.nlpsol(f"p{p}", "ipopt", problem | {"f": stand_in(G, p)}, options) for p in POWERS]
    while spent() < wanted["cpu"]:
        begin = random_start(arm.middle, A, b, rng)
        watch.kept.append((spent(), begin))
        for solver in solvers:
            begin = np.array(solver(x0=begin, lbg=lower, ubg=upper)["x"]).ravel()
            watch.kept.append((spent(), begin))
    return watch.kept


def slsqp(wanted: Mapping[str, Any]) -> Iterates:
    """The same by SLSQP."""
    arm, rng = case(wanted["case"]), np.random.default_rng(wanted["seed"])
    A, b = limit_rows(arm.limits)
    x, G = information(arm.name)

    def objective(power: int) -> Any:
        value = stand_in(G, power)
        both = ca.Function("both", [x], [value, ca.gradient(value, x)])

        def evaluated(point: Array) -> tuple[float, Array]:
            try:
                found, slope = both(point)
            except RuntimeError:  # SLSQP tries motions of 1e5 rad, whose G has no inverse
                return np.inf, np.zeros(len(point))
            return float(found), np.array(slope).ravel()

        return evaluated

    objectives = [objective(power) for power in POWERS]
    start = lambda: random_start(arm.middle, A, b, rng)  # noqa: E731
    return descents(objectives, A, b, start, wanted["cpu"], gradients=True)
