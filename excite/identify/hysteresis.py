"""Coulomb friction with a memory: its direction turns over a small distance, and stays where the motion stops.

At standstill ``sign(dz)`` knows nothing, while the friction of a gear keeps the direction of the last motion. Dahl's
model has a direction s that follows the path, ``ds/dz = (1 - s sign(dz)) / d`` [Dahl 1968].
"""

from __future__ import annotations

import numpy as np

from regressors.samples import Array

_FORGETS = 40.0  # distances after which nothing is left of what was before, exp(-40) = 4e-18
_LARGEST = 300.0  # exponents within a block


def dahl_direction(z: Array, distance: float) -> Array:
    """Direction of friction along a sampled path, from -1 to 1; zero at the first sample.

    Between two samples z goes straight, ``s_k = u + (s_{k-1} - u) exp(-|dz| / d)`` with ``u = sign(dz)``.

    Parameters
    ----------
    z : ndarray, shape (N, k)
        Drive coordinates [rad or m].
    distance : float
        d, over which the direction turns, > 0 [rad or m].

    Returns
    -------
    ndarray, shape (N, k)
    """
    way = np.diff(z, axis=0)
    return np.column_stack([_direction(column, distance) for column in way.T])


def _direction(way: Array, distance: float) -> Array:
    """Of one drive; the recursion solved in closed form, block by block, so that no exponent overflows."""
    decay = np.minimum(np.abs(way) / distance, _FORGETS)
    gain = np.sign(way) * -np.expm1(-decay)
    s = np.zeros(way.size + 1)
    start = 0
    while start < way.size:
        exponents = np.cumsum(decay[start : start + 4096])
        count = max(1, int(np.searchsorted(exponents, _LARGEST)))
        exponents = exponents[:count]
        part = slice(start, start + count)
        s[start + 1 : start + count + 1] = np.exp(-exponents) * (s[start] + np.cumsum(gain[part] * np.exp(exponents)))
        start += count
    return s
