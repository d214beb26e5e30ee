"""Which windows of a motion are simulated where there are too many: a bounded number, spread evenly over all of it."""

from __future__ import annotations

import numpy as np

from regressors.samples import Index

_GOLDEN = (np.sqrt(5) - 1) / 2


def chosen_windows(count: int, most: int) -> Index:
    """Windows to simulate, one in each of as many equal stretches of the motion.

    The place within the k-th stretch is the fractional part of ``k (sqrt(5) - 1) / 2``, of which any sequence is spread
    evenly over 0 to 1: at equal distances, windows of a motion that repeats itself would all see the same part of it.
    """
    if count <= most:
        return np.arange(count)
    edges = np.arange(most + 1) * count // most
    place = np.arange(most) * _GOLDEN % 1.0
    return np.asarray(edges[:-1] + (place * np.diff(edges)).astype(int))
