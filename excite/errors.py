"""Failures of a design that ran: nothing was wrong with the input, but what was asked does not hold."""

from __future__ import annotations


class NoFeasibleMotionError(RuntimeError):
    """The search ended without a motion inside the limits."""
