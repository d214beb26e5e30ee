"""Presliding Coulomb friction: its direction changes over a small distance, and is kept when the motion stops.

At standstill ``sign(dz)`` is undefined, while the friction of a gear keeps the direction of the last motion. In Dahl's
model the direction s follows the path, ``ds/dz = (1 - s sign(dz)) / d`` [Dahl 1968].
"""

from __future__ import annotations

import math

import numpy as np

from regressors.samples import Array


def measured_direction(z: Array, distance: float | Array) -> Array:
    """Direction of friction along a measured path, which begins in the midst of a motion, from -1 to 1.

    What came before is not known. A drive is taken to have come the way that it goes on, by its first displacement
    beyond the distance; the direction is zero where there is none.
    """  # z (N, k); distance (k,)
    moved = z - z[:1]
    first = np.argmax(np.abs(moved) > distance, axis=0)
    return dahl_direction(z, distance, np.sign(moved[first, np.arange(z.shape[1])]))


def dahl_direction(z: Array, distance: float | Array, start: Array | None = None) -> Array:
    """Direction of friction along a sampled path, from -1 to 1.

    z is linear between two samples: ``s_k = u + (s_{k-1} - u) exp(-|dz| / d)`` with ``u = sign(dz)``.
    """  # z (N, k); start (k,)
    way = np.diff(z, axis=0)
    keep = np.exp(-np.abs(way) / distance)
    gain = np.sign(way) * (1.0 - keep)
    first = np.zeros((1, z.shape[1])) if start is None else np.reshape(start, (1, -1)).astype(float)
    if len(gain):
        gain[:1] += keep[:1] * first
    return np.concatenate([first, _recursion(keep, gain)])


def _recursion(keep: Array, gain: Array) -> Array:
    """``s_k = keep_k s_{k-1} + gain_k`` from zero, shape (N, k), vectorised over blocks of equal length.

    Each block starts from zero; the final value of the block before is added afterwards.
    """
    count, drives = keep.shape
    length = max(1, math.isqrt(count))
    shape = (-(-count // length), length, drives)
    missing = ((0, shape[0] * length - count), (0, 0))
    a, s = (np.pad(x, missing).reshape(shape) for x in (keep, gain))
    for k in range(1, length):
        s[:, k] += a[:, k] * s[:, k - 1]
        a[:, k] *= a[:, k - 1]
    for block in range(1, shape[0]):
        s[block] += a[block] * s[block - 1, -1]
    return np.asarray(s.reshape(-1, drives)[:count])
