"""Torques that are recorded later than the positions of the same row."""

from __future__ import annotations

import numpy as np

from regressors.samples import Array


def lagging(time: Array, effort: Array, delay: tuple[float, ...]) -> Array:
    """Torques of ``t - delay`` in the row of t, by linear interpolation; before the first row they are those of it."""
    # time (N,); effort (N, n); delay (n,)
    return np.column_stack([np.interp(time - late, time, column) for late, column in zip(delay, effort.T, strict=True)])
