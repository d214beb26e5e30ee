"""How precise a motion makes the parameters, and how long a robot has to run until all of them are precise enough.

Torques have noise of known covariance S that is independent between samples. Weighted least squares then has the
covariance ``P = (W' S^-1 W)^-1``, and of n runs P / n; the half-width of a parameter's 99 % interval is
``h_k = z sqrt(P_kk / n)`` with z = 2.576. It shall be at most 5 % of ``s_k = max(|value_k|, FLOOR largest)``, with the
largest described value of the same unit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import scipy.linalg
import scipy.stats
from numpy.typing import NDArray

Array = NDArray[np.float64]

CONFIDENCE, SHARE, FLOOR = 0.99, 0.05, 0.1
Z = float(scipy.stats.norm.ppf(0.5 + CONFIDENCE / 2))


def deviations(W: Array, whitening: Array) -> Array:
    """Standard deviations of the estimates from one run, shape (b,).

    Parameters
    ----------
    W : ndarray, shape (N n, b)
        Instant by instant.
    whitening : ndarray, shape (n, n)
        ``V`` with ``V S V' = 1`` for the covariance S of the torques of an instant.
    """
    n = len(whitening)
    weighted = (whitening @ W.reshape(-1, n, W.shape[1])).reshape(W.shape)
    R = np.linalg.qr(weighted, mode="r")
    return np.asarray(np.linalg.norm(scipy.linalg.solve_triangular(R, np.eye(len(R))), axis=1))


def scales(values: Array, units: Sequence[str]) -> Array:
    """What 5 % are counted of, shape (b,): the described value, and for parameters about zero a part of the largest."""
    largest = [max(abs(value) for value, of in zip(values, units, strict=True) if of == unit) for unit in units]
    return np.maximum(np.abs(values), FLOOR * np.array(largest))


def relative_half_widths(deviation: Array, scale: Array, runs: float) -> Array:
    """Half-widths of the 99 % intervals after so many runs, as parts of the scales, shape (b,)."""
    return np.asarray(Z * deviation / np.sqrt(runs) / scale)


def runs_needed(deviation: Array, scale: Array) -> int:
    """Fewest runs after which every half-width is at most 5 % of its scale."""
    return max(1, math.ceil(float(np.max(relative_half_widths(deviation, scale, 1.0))) ** 2 / SHARE**2))


def share_reached(deviation: Array, scale: Array, runs: int) -> float:
    """Part of the parameters whose half-widths are at most 5 % of their scales after so many runs."""
    return float(np.mean(relative_half_widths(deviation, scale, runs) <= SHARE))
