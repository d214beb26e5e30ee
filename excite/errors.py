"""Failures of what ran: nothing was wrong with the input, but what was asked does not hold."""

from __future__ import annotations

from regressors.errors import ExciteError, InputError, NumericalError, TakenError, TooLargeError, UnknownName

__all__ = [
    "BrokenLimitError",
    "ConicSolverError",
    "ExciteError",
    "InputError",
    "LostMotionError",
    "LostWorkersError",
    "NoFeasibleMotionError",
    "NumericalError",
    "TakenError",
    "TooLargeError",
    "UnknownName",
]


class NoFeasibleMotionError(ExciteError, RuntimeError):
    """The search ended without a motion inside the limits."""


class BrokenLimitError(ExciteError, RuntimeError):
    """A motion that is to be played breaks a limit of its robot."""


class ConicSolverError(ExciteError, RuntimeError):
    """The conic solver ended without a solution."""


class LostMotionError(ExciteError, RuntimeError):
    """The simulated motion ran away: nothing was wrong with the input, but the controller does not hold the robot."""


class LostWorkersError(ExciteError, RuntimeError):
    """Worker processes end again and again, and no work does; or the scheduler of workers went away.

    Parameters
    ----------
    *sentences : str
        What happened; then, what becomes of the work, and what to do.
    """

    def __str__(self) -> str:
        return "; ".join(self.args)
