"""Solvers: one file each, behind `excite.design.solvers.solver.Solver`."""

from __future__ import annotations

from importlib import import_module

from excite.design.solvers.solver import Solver, SolverResult, Status
from regressors.errors import UnknownName

_REGISTRY = {
    "sqp": ("excite.design.solvers.sqp", "SequentialQuadratic"),
    "ipopt": ("excite.design.solvers.ipopt", "Ipopt"),
}


def solver(name: str) -> Solver:
    """Solver of a name, with its own settings.

    Raises
    ------
    UnknownName
        No such solver.
    """
    if name not in _REGISTRY:
        raise UnknownName("solver", name, _REGISTRY)
    module, kind = _REGISTRY[name]
    made: Solver = getattr(import_module(module), kind)()
    return made


__all__ = ["Solver", "SolverResult", "Status", "solver"]
