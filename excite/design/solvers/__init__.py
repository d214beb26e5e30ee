"""Solvers: one file each, behind `excite.design.solvers.solver.Solver`."""
