"""Failures of what ran: nothing was wrong with the input, but what was asked does not hold."""

from __future__ import annotations


class NoFeasibleMotionError(RuntimeError):
    """The search ended without a motion inside the limits."""


class ConicSolverError(RuntimeError):
    """The conic solver ended without a solution."""
