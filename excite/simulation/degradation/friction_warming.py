"""Friction that changes while the joints warm up."""

from __future__ import annotations

import numpy as np

from regressors.samples import Array

_COURSE = 2.0  # time constants that the log lasts


def warming(time: Array, change: float) -> Array:
    """Relative change of friction at each instant, from 0 at the first to `change` at the last, shape (N,).

    ``change (1 - exp(-2 s)) / (1 - exp(-2))``, with s from 0 to 1: fast at first, as a body of one time constant warms.
    """  # time (N,)
    s = (time - time[0]) / (time[-1] - time[0])
    return np.asarray(change * np.expm1(-_COURSE * s) / np.expm1(-_COURSE))
