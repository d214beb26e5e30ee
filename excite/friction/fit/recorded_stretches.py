"""Recorded stretches of a log with gaps, and the noise of its positions."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from excite.logs.excitation import noise_deviation, quantum
from excite.logs.gaps import LEAST, STEPS
from regressors.samples import Array

_FEWEST = 9  # consecutive samples that noise can be estimated from


def longest_step(time: Array) -> float:
    """Longest step that is not a gap: 3.5 times the median one, or 20 ms if that is more [s]."""  # time (N,)
    return max(STEPS * float(np.median(np.diff(time))), LEAST) if time.size > 1 else np.inf


def unbroken(time: Array, longest: float) -> bool:
    """Whether no two consecutive samples are further apart than `longest`."""  # time (N,)
    return bool(np.diff(time).max(initial=0.0) <= longest)


def position_noise(time: Array, x: Array) -> Array:
    """Standard deviation of the noise of positions, over the stretches between steps longer than 3.5 median ones.

    The motion continues in a gap, so a difference across it is not noise.
    """  # time (N,); x (N, n)
    step = np.diff(time)
    broken = np.flatnonzero(step > STEPS * np.median(step)) + 1
    parts = [x[a:b] for a, b in pairwise([0, *broken.tolist(), len(x)]) if b - a >= _FEWEST]
    if not broken.size or not parts:
        return noise_deviation(x)
    power = np.array([len(part) * noise_deviation(part) ** 2 for part in parts]).sum(axis=0)
    return np.asarray(np.maximum(np.sqrt(power / sum(map(len, parts))), quantum(x) / np.sqrt(12)))
