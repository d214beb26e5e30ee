"""Failures of what ran: nothing was wrong with the input, but what was asked does not hold."""

from __future__ import annotations

from regressors.errors import ExciteError, InputError, NumericalError, TakenError, UnknownName

__all__ = [
    "ConicSolverError",
    "ExciteError",
    "InputError",
    "LostMotionError",
    "NoFeasibleMotionError",
    "NumericalError",
    "TakenError",
    "UnknownName",
]


class NoFeasibleMotionError(ExciteError, RuntimeError):
    """The search ended without a motion inside the limits."""


class ConicSolverError(ExciteError, RuntimeError):
    """The conic solver ended without a solution."""


class LostMotionError(ExciteError, RuntimeError):
    """The simulated motion ran away: nothing was wrong with the input, but the controller does not hold the robot."""
