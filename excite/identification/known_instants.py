"""Instants of a log that are found again by their time."""

from __future__ import annotations

import numpy as np

from regressors.samples import Array, Index


def nearest(known: Array, time: Array) -> Index:
    """Index of the known instant that each time is."""  # known (N,); time (M,)
    after = np.clip(np.searchsorted(known, time), 1, known.size - 1)
    return np.asarray(after - (time - known[after - 1] < known[after] - time))
